#include "drivers/simulated/folder_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <tuple>

#include "drivers/recorded/asl_text.hpp"
#include "drivers/recorded/image_files.hpp"
#include "drivers/simulated/parallel.hpp"
#include "drivers/simulated/simulated_flight.hpp"
#include "drivers/simulated/truth_text.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kOrigin = "simulated";
constexpr double kMaxDepth = 10.0;      // m; farther surfaces count as not seen
constexpr double kPinholeFocal = 0.94;  // focal length of the ideal camera relative to that of a narrow lens
constexpr double kWideFocal = 0.45;  // over the image width, for lenses wider than a pinhole's useful field
constexpr double kObservedCell = 0.03;  // m
constexpr int kObservedStride = 2;      // every n-th pixel of every n-th row

// The ideal camera of the depth images.
CameraModel depthCamera(const CameraModel& camera) {
  const double focal = camera.kind() == CameraKind::kPinholeRadtan
                           ? std::round(kPinholeFocal * camera.focal())
                           : kWideFocal * camera.width();
  return {CameraKind::kPinholeRadtan,
          camera.width(),
          camera.height(),
          {focal, focal, 0.5 * (camera.width() - 1), 0.5 * (camera.height() - 1)},
          Eigen::Vector4d::Zero()};
}

// Writes depth, labels and the points they show, at every n-th frame.
class TruthWriter {
 public:
  TruthWriter(const SimulatedFlight& flight, const TexturedWorld& world, const fs::path& folder)
      : flight_(flight),
        folder_(folder),
        depth_(world, depthCamera(flight.trueRig().camera[0]), flight.trueRig().T_body_cam[0]),
        labels_(world, flight.trueRig().camera[0], flight.trueRig().T_body_cam[0]) {
    fs::create_directories(folder / "mav0/depth0/data");
    fs::create_directories(folder / "mav0/labels0/data");
    const double rate = flight.settings().camera_rate / flight.settings().depth_every;
    const SE3& T = flight.givenRig().T_body_cam[0];
    writeText(folder / "mav0/depth0/sensor.yaml",
              cameraYaml(depth_.camera(), T, rate, kOrigin, "depth_unit_m: 0.001\n"));
    writeText(folder / "mav0/labels0/sensor.yaml", cameraYaml(labels_.camera(), T, rate, kOrigin, ""));
    writeText(folder / "mav0/labels0/labels.csv", labelsCsv());
  }

  void write(int k) {
    const SE3 T_world_body = flight_.trajectory().pose(flight_.imageTime(k));
    const std::string name = fmt::format("{}.png", flight_.imageStamp(k).ns);
    const int width = depth_.camera().width();
    const int height = depth_.camera().height();
    depth_.renderGeometry(T_world_body, flight_.settings().threads, geometry_);
    millimetres_.clear();
    for (const float depth : geometry_.depth) {
      const bool seen = static_cast<double>(depth) <= kMaxDepth;
      millimetres_.push_back(seen ? static_cast<std::uint16_t>(std::lround(1000.0F * depth))
                                  : std::uint16_t{0});
    }
    collectPoints(T_world_body * flight_.trueRig().T_body_cam[0]);
    writePng16(folder_ / "mav0/depth0/data" / name, millimetres_.data(), width, height);
    labels_.renderGeometry(T_world_body, flight_.settings().threads, geometry_);
    writePng8(folder_ / "mav0/labels0/data" / name, geometry_.label.data(), width, height);
    fmt::format_to(std::back_inserter(rows_), "{},{}\n", flight_.imageStamp(k).ns, name);
  }

  void finish() {
    for (const char* sensor : {"mav0/depth0", "mav0/labels0"}) {
      writeText(folder_ / sensor / "data.csv", "#timestamp [ns],filename\n" + rows_);
    }
    std::vector<LabelledPoint> points;
    points.reserve(observed_.size());
    for (const auto& [cell, point] : observed_) points.push_back(point);
    writeText(folder_ / "truth/observed.ply", pointsPly(points));
  }

 private:
  void collectPoints(const SE3& T_world_cam) {
    const Eigen::Vector4d& k = depth_.camera().intrinsics();
    const int width = depth_.camera().width();
    for (int y = 0; y < depth_.camera().height(); y += kObservedStride) {
      for (int x = 0; x < width; x += kObservedStride) {
        const auto i =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        if (millimetres_[i] == 0) continue;
        const auto z = static_cast<double>(geometry_.depth[i]);
        const Eigen::Vector3d p =
            T_world_cam * Eigen::Vector3d((x - k[2]) / k[0] * z, (y - k[3]) / k[1] * z, z);
        const auto cell = [](double value) { return static_cast<int>(std::floor(value / kObservedCell)); };
        observed_.try_emplace({cell(p.x()), cell(p.y()), cell(p.z())},
                              LabelledPoint{p.cast<float>(), geometry_.label[i]});
      }
    }
  }

  const SimulatedFlight& flight_;
  fs::path folder_;
  CameraRenderer depth_;
  CameraRenderer labels_;
  GeometryImage geometry_;
  std::vector<std::uint16_t> millimetres_;
  std::string rows_;
  std::map<std::tuple<int, int, int>, LabelledPoint> observed_;
};

void writeImages(const SimulatedFlight& flight, const fs::path& folder, const SimulationProgress& progress) {
  const SimulationSettings& settings = flight.settings();
  FlightCameras cameras(flight);
  const std::size_t count = cameras.cameraCount();
  std::array<std::vector<std::uint8_t>, kMaxCameras> buffers;
  std::array<std::uint8_t*, kMaxCameras> grey{};
  std::array<std::string, kMaxCameras> rows;
  for (std::size_t c = 0; c < count; ++c) {
    const CameraModel& camera = flight.trueRig().camera[c];
    buffers[c].resize(static_cast<std::size_t>(camera.width()) * static_cast<std::size_t>(camera.height()));
    grey[c] = buffers[c].data();
    fs::create_directories(folder / fmt::format("mav0/cam{}/data", c));
  }
  std::unique_ptr<TruthWriter> truth;
  if (settings.depth_every > 0) truth = std::make_unique<TruthWriter>(flight, cameras.world(), folder);

  const bool jpeg = settings.format == ImageFormat::kJpeg;
  for (int k = 0; k < flight.imageCount(); ++k) {
    std::array<bool, kMaxCameras> present{};
    cameras.render(k, grey, present);
    const std::string name = fmt::format("{}.{}", flight.imageStamp(k).ns, jpeg ? "jpg" : "png");
    std::array<std::string, kMaxCameras> failed;
    parallelFor(static_cast<int>(count), settings.threads, [&](int i) {
      const auto c = static_cast<std::size_t>(i);
      if (!present[c]) return;
      const CameraModel& camera = flight.trueRig().camera[c];
      const fs::path path = folder / fmt::format("mav0/cam{}/data", c) / name;
      try {
        if (jpeg) {
          writeJpeg(path, grey[c], camera.width(), camera.height(), settings.jpeg_quality);
        } else {
          writePng8(path, grey[c], camera.width(), camera.height());
        }
      } catch (const std::runtime_error& error) {  // must not leave the thread
        failed[c] = error.what();
      }
    });
    for (std::size_t c = 0; c < count; ++c) {
      if (!failed[c].empty()) throw std::runtime_error(failed[c]);
      if (present[c]) fmt::format_to(std::back_inserter(rows[c]), "{},{}\n", flight.imageStamp(k).ns, name);
    }
    if (truth != nullptr && k % settings.depth_every == 0) truth->write(k);
    if (progress) progress(k + 1, flight.imageCount());
  }
  for (std::size_t c = 0; c < count; ++c) {
    writeText(folder / fmt::format("mav0/cam{}/data.csv", c), "#timestamp [ns],filename\n" + rows[c]);
  }
  if (truth != nullptr) truth->finish();
}

// Removes what the flight's faults hide; false if no camera took an image.
bool applyFaults(const SimulatedFlight& flight, double seconds, TrackedFrame& frame) {
  bool any_image = false;
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    const bool missing =
        c >= flight.trueRig().camera_count || flight.hasFault(FaultKind::kCameraMissing, c, seconds);
    any_image = any_image || !missing;
    frame.camera_present[c] = !missing && !flight.hasFault(FaultKind::kBlackout, c, seconds);
  }
  std::size_t kept = 0;
  for (TrackedFeature& feature : frame.features) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      feature.seen[c] = feature.seen[c] && frame.camera_present[c];
    }
    if (feature.seen[0] || feature.seen[1]) frame.features[kept++] = feature;
  }
  frame.features.resize(kept);
  return any_image;
}

void makeTracks(const SimulatedFlight& flight, const TrackSink& sink, const SimulationProgress& progress) {
  TrackSimulator simulator(flight.world(), flight.trueRig(), flight.trajectory(), flight.settings().tracks);
  const auto frame = std::make_unique<TrackedFrame>();
  for (int k = 0; k < flight.imageCount(); ++k) {
    simulator.step(flight.imageTime(k), flight.imageStamp(k), *frame);
    if (applyFaults(flight, flight.imageTime(k), *frame)) sink(*frame);
    if (progress) progress(k + 1, flight.imageCount());
  }
}

// The image list that already exists in the folder; empty if there is none.
std::string imageListIn(const fs::path& folder) {
  std::error_code error;
  for (const char* camera : {"cam0", "cam1"}) {
    const fs::path list = folder / "mav0" / camera / "data.csv";
    if (fs::exists(list, error)) return list.string();
  }
  return {};
}

std::string simulationYaml(const SimulatedFlight& flight) {
  const SimulationSettings& s = flight.settings();
  static constexpr std::array<const char*, 4> kFaults{"blackout", "camera_missing", "imu_gap",
                                                      "imu_saturation"};
  std::string text = fmt::format(
      "seed: {}\nworld: {}\nworld_seed: {}\nrig: {}\nmotion: {}\nduration: {:g}\nspeed: "
      "{:g}\naggressiveness: {:g}\n"
      "rest_at_start: {:g}\nexposure: {:g}\nlight: {:g}\nvibration_accel: {:g}\n",
      s.seed, worldName(s.world.kind), s.world.seed, rigName(s.rig),
      s.given_motion.empty() ? "own" : fs::path(s.given_motion).filename().string(), flight.duration(),
      s.flight.speed, s.flight.aggressiveness, s.flight.rest_at_start, s.render.exposure, s.sensor.light,
      s.imu.vibration.accel_amplitude);
  static constexpr std::array<const char*, 3> kModes{"gain", "odometry", "fixed"};
  fmt::format_to(std::back_inserter(text), "exposure_control: {}\n",
                 kModes[static_cast<std::size_t>(s.exposure_mode)]);
  text += s.light_changes.empty() ? "light_changes: []\n" : "light_changes:\n";
  for (const LightChange& change : s.light_changes) {
    fmt::format_to(std::back_inserter(text), "  - {{begin: {:g}, level: {:g}}}\n", change.begin,
                   change.level);
  }
  // The true value of t_imu = t_image + shift, in seconds.
  fmt::format_to(std::back_inserter(text), "timeshift_cam_imu: {:g}\n",
                 flight.trueRig().camera_to_imu_shift.seconds());
  text += s.faults.empty() ? "faults: []\n" : "faults:\n";
  for (const Fault& fault : s.faults) {
    fmt::format_to(std::back_inserter(text), "  - {{kind: {}, begin: {:g}, end: {:g}, camera: {}}}\n",
                   kFaults[static_cast<std::size_t>(fault.kind)], fault.span.begin, fault.span.end,
                   fault.camera);
  }
  return text;
}

void writeFlight(const SimulatedFlight& flight, const fs::path& folder) {
  const SimulationSettings& s = flight.settings();
  fs::create_directories(folder / "mav0/imu0");
  fs::create_directories(folder / "mav0/state_groundtruth_estimate0");
  fs::create_directories(folder / "truth");
  for (std::size_t c = 0; c < flight.trueRig().camera_count; ++c) {
    fs::create_directories(folder / fmt::format("mav0/cam{}", c));
    const CameraModel& camera = flight.trueRig().camera[c];
    const std::string shutter = shutterYaml(flight.trueRig().readout);
    writeText(folder / fmt::format("mav0/cam{}/sensor.yaml", c),
              cameraYaml(camera, flight.givenRig().T_body_cam[c], s.camera_rate, kOrigin, shutter));
    writeText(folder / fmt::format("truth/cam{}.yaml", c),
              cameraYaml(camera, flight.trueRig().T_body_cam[c], s.camera_rate, kOrigin, shutter));
  }
  writeText(folder / "mav0/imu0/sensor.yaml", imuYaml(s.imu.noise, kOrigin));
  std::string samples = imuCsvHeader();
  for (const ImuSample& sample : flight.imu().samples) samples += imuCsvRow(sample);
  writeText(folder / "mav0/imu0/data.csv", samples);
  writeText(folder / "mav0/state_groundtruth_estimate0/data.csv",
            groundTruthCsv(flight.trajectory(), flight.imu(), s.start, s.imu.noise.rate_hz));
  writeText(folder / "truth/mesh.ply", meshPly(flight.world().mesh()));
  writeText(folder / "truth/simulation.yaml", simulationYaml(flight));
}

// Creates the flight, writes the files common to both kinds of output, and calls `write` for the rest.
template <typename Write>
Status simulateWith(const SimulationSettings& settings, const fs::path& folder, std::string* message,
                    const Write& write) {
  try {
    const SimulatedFlight flight(settings);
    writeFlight(flight, folder);
    write(flight);
    return okStatus();
  } catch (const std::invalid_argument& error) {
    if (message != nullptr) *message = error.what();
    return {StatusCode::kInvalidInput, "a simulation setting is out of range"};
  } catch (const fs::filesystem_error& error) {
    if (message != nullptr) *message = error.path1().string() + ": " + error.code().message();
    return {StatusCode::kFailed, "a folder could not be created"};
  } catch (const std::exception& error) {
    if (message != nullptr) *message = error.what();
    return {StatusCode::kFailed, "the simulated flight could not be generated or written"};
  }
}

}  // namespace

Status simulateToFolder(const SimulationSettings& settings, const std::string& folder,
                        const SimulationProgress& progress, std::string* message) {
  return simulateWith(settings, folder, message,
                      [&](const SimulatedFlight& flight) { writeImages(flight, folder, progress); });
}

Status simulateTracksToFolder(const SimulationSettings& settings, const std::string& folder,
                              const TrackSink& sink, const SimulationProgress& progress,
                              std::string* message) {
  const std::string images = imageListIn(folder);
  if (!images.empty()) {
    if (message != nullptr) *message = images + ": the folder already holds the images of another flight";
    return {StatusCode::kFailed, "the folder already holds the images of another flight"};
  }
  return simulateWith(settings, folder, message,
                      [&](const SimulatedFlight& flight) { makeTracks(flight, sink, progress); });
}

}  // namespace swiftlet
