#include "drivers/simulated/session_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <iterator>
#include <stdexcept>
#include <vector>

#include "drivers/recorded/asl_text.hpp"
#include "drivers/recorded/image_files.hpp"
#include "drivers/simulated/parallel.hpp"
#include "drivers/simulated/truth_text.hpp"
#include "drivers/target/target_file.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSessionOrigin = "simulated";

// Gaussian blur of `sigma` px in both directions; pixels beyond the edge repeat the edge.
void blurBy(double sigma, int width, int height, int threads, std::vector<float>& image) {
  if (sigma <= 0) return;
  const int reach = std::max(1, static_cast<int>(std::ceil(3.5 * sigma)));
  std::vector<float> weight;
  float sum = 0;
  for (int i = -reach; i <= reach; ++i) {
    weight.push_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma))));
    sum += weight.back();
  }
  for (float& w : weight) w /= sum;
  std::vector<float> along(image.size());
  parallelFor(height, threads, [&](int y) {
    const float* in = image.data() + static_cast<std::ptrdiff_t>(y) * width;
    float* out = along.data() + static_cast<std::ptrdiff_t>(y) * width;
    for (int x = 0; x < width; ++x) {
      float value = 0;
      for (int i = -reach; i <= reach; ++i) {
        value += weight[static_cast<std::size_t>(i + reach)] * in[std::clamp(x + i, 0, width - 1)];
      }
      out[x] = value;
    }
  });
  parallelFor(height, threads, [&](int y) {
    float* out = image.data() + static_cast<std::ptrdiff_t>(y) * width;
    std::fill(out, out + width, 0.0F);
    for (int i = -reach; i <= reach; ++i) {
      const float w = weight[static_cast<std::size_t>(i + reach)];
      const float* in = along.data() + static_cast<std::ptrdiff_t>(std::clamp(y + i, 0, height - 1)) * width;
      for (int x = 0; x < width; ++x) out[x] += w * in[x];
    }
  });
}

CalibrationRig sessionRig(const SessionFolderSettings& settings) {
  CalibrationRig rig = makeCalibrationRig(settings.rig, settings.rig_seed);
  if (!isRandom(settings.rig)) {
    rig.rig.camera_to_imu_shift = -settings.image_stamp_offset;
    rig.rig.readout = settings.readout;
  }
  if (settings.mono) rig.rig.camera_count = 1;
  return rig;
}

std::string rowsYaml(const char* name, const Eigen::Matrix3d& m) {
  return fmt::format(
      "{}: [[{:.12g}, {:.12g}, {:.12g}], [{:.12g}, {:.12g}, {:.12g}], [{:.12g}, {:.12g}, {:.12g}]]\n", name,
      m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2));
}

std::string sessionYaml(const CalibrationSession& session, const SessionFolderSettings& settings) {
  const CalibrationRig& rig = session.truth();
  const SE3& T = session.T_world_board();
  std::string text = fmt::format(
      "rig: {}\nrig_seed: {}\nseed: {}\nduration: {:g}\nrate: {:g}\nexposure: {:g}\nlens_blur: [{:g}, "
      "{:g}]\n",
      rigName(settings.rig), settings.rig_seed, session.settings().seed, session.settings().duration,
      session.settings().camera_rate, settings.exposure, settings.lens_blur[0], settings.lens_blur[1]);
  text += "# t_imu = t_image + shift [s]; reading = M true + bias, M as in Kalibr's imu.yaml\n";
  text += fmt::format("timeshift_cam_imu: {:.9f}\nreadout_ms: {:.9g}\n",
                      rig.rig.camera_to_imu_shift.seconds(), 1e3 * rig.rig.readout.seconds());
  text += rowsYaml("gyroscope_matrix", rig.gyro_matrix) + rowsYaml("accelerometer_matrix", rig.accel_matrix);
  text += fmt::format(
      "# p [m], q (x, y, z, w)\nT_world_board: [{:.12g}, {:.12g}, {:.12g}, {:.12g}, {:.12g}, {:.12g}, "
      "{:.12g}]\n",
      T.translation.x(), T.translation.y(), T.translation.z(), T.rotation.x(), T.rotation.y(), T.rotation.z(),
      T.rotation.w());
  return text;
}

void writeSessionTexts(const CalibrationSession& session, const SessionFolderSettings& settings,
                       const fs::path& folder) {
  const CalibrationRig& truth = session.truth();
  const double rate = session.settings().camera_rate;
  const auto writeSensor = [&folder](const std::string& sensor, const std::string& text) {
    fs::create_directories(folder / sensor);
    writeText(folder / sensor / "sensor.yaml", text);
  };
  const std::string times =
      fmt::format("timeshift_cam_imu: {:.9f}\n", truth.rig.camera_to_imu_shift.seconds()) +
      shutterYaml(truth.rig.readout);
  for (std::size_t c = 0; c < truth.rig.camera_count; ++c) {
    const std::string text =
        cameraYaml(truth.rig.camera[c], truth.rig.T_body_cam[c], rate, kSessionOrigin, times);
    writeSensor(fmt::format("truth/calibration/cam{}", c), text);
    if (settings.calibrated) writeSensor(fmt::format("mav0/cam{}", c), text);
  }
  const std::string imu = imuYaml(truth.noise, kSessionOrigin);
  writeSensor("truth/calibration/imu0", imu);
  writeSensor("mav0/imu0", imu);
  std::string samples = imuCsvHeader();
  for (const ImuSample& sample : session.imu().samples) samples += imuCsvRow(sample);
  writeText(folder / "mav0/imu0/data.csv", samples);
  fs::create_directories(folder / "mav0/state_groundtruth_estimate0");
  writeText(
      folder / "mav0/state_groundtruth_estimate0/data.csv",
      groundTruthCsv(session.trajectory(), session.imu(), session.settings().start, truth.noise.rate_hz));
  writeText(folder / "truth/board.yaml", targetYaml(session.target()));
  writeText(folder / "truth/session.yaml", sessionYaml(session, settings));
}

void writeImage(const SessionFolderSettings& settings, const fs::path& file, const CameraModel& lens,
                const std::vector<std::uint8_t>& grey) {
  if (settings.format == ImageFormat::kJpeg) {
    writeJpeg(file, grey.data(), lens.width(), lens.height(), settings.jpeg_quality);
  } else {
    writePng8(file, grey.data(), lens.width(), lens.height());
  }
}

void writeSessionImages(const CalibrationSession& session, const SessionFolderSettings& settings,
                        const fs::path& folder, const SimulationProgress& progress) {
  const Rig& rig = session.truth().rig;
  PaintSettings paint;
  paint.threads = settings.threads;
  const TexturedWorld world(sessionRoom(session), paint);
  std::vector<SessionCamera> cameras;
  std::vector<std::string> rows(rig.camera_count);
  for (std::size_t c = 0; c < rig.camera_count; ++c) {
    cameras.emplace_back(session, world, c, settings);
    fs::create_directories(folder / fmt::format("mav0/cam{}/data", c));
  }
  SensorSettings sensor = settings.sensor;
  sensor.seed = session.settings().seed;
  sensor.start_error = 1;  // the exposure has settled before the recording begins
  GainControl gain(sensor);
  std::vector<float> radiance;
  std::vector<std::uint8_t> grey;
  for (int k = 0; k < session.imageCount(); ++k) {
    const std::string name =
        fmt::format("{}.{}", session.imageStamp(k).ns, settings.format == ImageFormat::kJpeg ? "jpg" : "png");
    double mean = 0;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      const CameraModel& lens = rig.camera[c];
      cameras[c].render(k, radiance);
      if (!gain.started()) gain.start(sensor.light * meanRadiance(radiance, lens.width(), lens.height()));
      grey.resize(radiance.size());
      const double own = exposeImage(radiance, lens.width(), lens.height(), sensor, gain.gain(),
                                     static_cast<std::uint64_t>(k), static_cast<std::uint32_t>(c),
                                     settings.threads, grey.data());
      if (c == 0) mean = own;
      writeImage(settings, folder / fmt::format("mav0/cam{}/data", c) / name, lens, grey);
      fmt::format_to(std::back_inserter(rows[c]), "{},{}\n", session.imageStamp(k).ns, name);
    }
    gain.update(mean, 1 / session.settings().camera_rate);
    if (progress) progress(k + 1, session.imageCount());
  }
  for (std::size_t c = 0; c < rows.size(); ++c) {
    writeText(folder / fmt::format("mav0/cam{}/data.csv", c), "#timestamp [ns],filename\n" + rows[c]);
  }
}

}  // namespace

World sessionRoom(const CalibrationSession& session) {
  std::vector<Eigen::Vector3d> kept;
  for (double t = 0; t <= session.settings().duration; t += 0.5) {
    kept.push_back(session.trajectory().pose(t).translation);
  }
  const CalibrationTarget& target = session.target();
  for (int id = 0; id < target.cornerCount(); ++id) {
    kept.push_back(session.T_world_board() * target.corner(id));
  }
  WorldSettings room;
  room.seed = session.settings().seed;
  if (!fitWorld(room, kept)) throw std::invalid_argument("board: larger than any room");
  return buildWorld(room, kept);
}

SessionCamera::SessionCamera(const CalibrationSession& session, const TexturedWorld& world,
                             std::size_t camera, const SessionFolderSettings& settings)
    : session_(&session),
      room_(world, session.truth().rig.camera[camera], session.truth().rig.T_body_cam[camera]),
      board_(session.target(), session.T_world_board(), session.truth().rig.camera[camera],
             session.truth().rig.T_body_cam[camera]),
      blur_(settings.lens_blur[camera]) {
  render_.exposure = settings.exposure;
  render_.readout = session.truth().rig.readout.seconds();
  render_.threads = settings.threads;
}

void SessionCamera::render(int k, std::vector<float>& radiance) const {
  RenderSettings background = render_;
  background.samples = 1;  // the background is not measured
  const double seconds = session_->imageTime(k);
  room_.renderImage(session_->trajectory(), seconds, background, radiance);
  board_.paint(session_->trajectory(), seconds, render_, radiance);
  blurBy(blur_, room_.camera().width(), room_.camera().height(), render_.threads, radiance);
}

Status simulateSessionToFolder(const CalibrationTarget& target, const SessionFolderSettings& settings,
                               const std::string& folder, const SimulationProgress& progress,
                               std::string* message) {
  try {
    if (settings.exposure <= 0 || settings.exposure >= 1 / settings.session.camera_rate) {
      throw std::invalid_argument("exposure: must be positive and shorter than a frame");
    }
    const CalibrationSession session(sessionRig(settings), target, settings.session);
    writeSessionTexts(session, settings, folder);
    writeSessionImages(session, settings, folder, progress);
    return okStatus();
  } catch (const std::invalid_argument& error) {
    if (message != nullptr) *message = error.what();
    return {StatusCode::kInvalidInput, "a simulation setting is out of range"};
  } catch (const fs::filesystem_error& error) {
    if (message != nullptr) *message = error.path1().string() + ": " + error.code().message();
    return {StatusCode::kFailed, "a folder could not be created"};
  } catch (const std::exception& error) {
    if (message != nullptr) *message = error.what();
    return {StatusCode::kFailed, "the calibration session could not be generated or written"};
  }
}

}  // namespace swiftlet
