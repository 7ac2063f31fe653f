// Simulated rigs through the batch: a line a rig, the errors beside their standard deviations, a table.
//
// usage: imu_camera_campaign RESULTS FIRST LAST [FOLDER [--corners]]
//
// Calibrates the rigs with seeds FIRST to LAST that RESULTS (a CSV) does not have. Delete RESULTS after a
// change of the code. FOLDER/rig_<seed> gets the calibration, found and true; the session's images are
// rendered there and searched for corners. With --corners, as without FOLDER, corners are simulated instead.

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <set>
#include <sstream>

#include "drivers/simulated/session_folder.hpp"
#include "firmware_host/lab/calibrate/board/log_views.hpp"
#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"
#include "firmware_host/lab/calibrate/imu_camera/imu_camera_files.hpp"
#include "firmware_host/outputs/run_folder/calibration_files.hpp"
#include "tests/firmware_host/calibrate/simulated_calibration.hpp"

using namespace swiftlet;

namespace {

struct Row {
  std::string name;
  std::string unit;
  double error = 0;
  double sigma = 0;
};

std::map<std::uint64_t, std::vector<Row>> readRows(const std::string& path) {
  std::map<std::uint64_t, std::vector<Row>> rows;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream text(line);
    std::string seed;
    Row row;
    std::string error;
    std::string sigma;
    if (std::getline(text, seed, ',') && std::getline(text, row.name, ',') &&
        std::getline(text, row.unit, ',') && std::getline(text, error, ',') &&
        std::getline(text, sigma, ',')) {
      row.error = std::stod(error);
      row.sigma = std::stod(sigma);
      rows[std::stoull(seed)].push_back(row);
    }
  }
  return rows;
}

/// The session as images: corners are found, and cameras calibrated, as the command does it.
ImuCameraInput renderedInput(const CalibrationSession& session, RigKind kind, const std::string& folder) {
  SessionFolderSettings settings;
  settings.rig = kind;
  settings.rig_seed = session.settings().seed;
  settings.session = session.settings();
  std::string message;
  if (!simulateSessionToFolder(session.target(), settings, folder, {}, &message).ok()) {
    std::cerr << folder << ": " << message << "\n";
    std::exit(EXIT_FAILURE);
  }
  LogViewsRequest request;
  request.log = folder;
  request.target = session.target();
  const LogViews log = readLogViews(request);
  CameraInput cameras;
  cameras.target = request.target;
  cameras.views = log.views;
  cameras.camera_count = log.camera_count;
  cameras.image_size = log.image_size;
  ImuCameraInput input;
  input.target = request.target;
  input.views = log.views;
  input.samples = log.samples;
  input.noise = session.truth().noise;
  input.cameras = calibrateCameras(cameras);
  // The truth stays, the images are large.
  std::filesystem::remove_all(folder + "/mav0");
  return input;
}

std::string runRig(std::uint64_t seed, const std::string& folder, bool rendered_images) {
  SessionSettings settings;
  settings.seed = seed;
  const RigKind kind = seed % 2 == 0 ? RigKind::kRandomPinhole : RigKind::kRandomFisheye;
  const CalibrationSession session(makeCalibrationRig(kind, seed), CalibrationTarget{}, settings);
  const std::string rendered = fmt::format("{}/rig_{}", folder, seed);
  const ImuCameraInput input = rendered_images ? renderedInput(session, kind, rendered) : batchInput(session);
  const auto begin = std::chrono::steady_clock::now();
  const ImuCameraSolution solution = calibrateImuCamera(input);
  if (!folder.empty() && !solution.values.empty()) {
    Calibration calibration = calibrationOf(solution, input.noise);
    for (const char* name : {"/found", "/true"}) {
      std::filesystem::create_directories(rendered + name);
      writeCalibration(rendered + name, calibration);
      calibration.rig = session.truth().rig;
      calibration.gyro_matrix = session.truth().gyro_matrix;
      calibration.accel_matrix = session.truth().accel_matrix;
    }
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::string text;
  for (const std::string& reason : solution.reasons) std::cerr << "rig " << seed << ": " << reason << "\n";
  if (solution.values.empty()) return fmt::format("{},failed,,1,0\n", seed);
  const CalibrationErrors errors = errorsOf(solution, session);
  for (const ValueError& v : errors.values) {
    text += fmt::format("{},{},{},{:.9g},{:.9g}\n", seed, v.name, v.unit, v.error, v.sigma);
  }
  text += fmt::format("{},nees,,{:.6g},{}\n", seed, errors.nees, errors.values.size());
  text +=
      fmt::format("{},reasons,,{},0\n{},seconds,,{:.1f},0\n", seed, solution.reasons.size(), seed, seconds);
  std::cerr << fmt::format(
      "rig {}: NEES {:.1f} of {}, {:.1f} s, corner {:.4f} px, gyro {:.3f}, accel {:.3f}\n", seed, errors.nees,
      errors.values.size(), seconds, solution.corner_sigma, solution.gyro_sigma, solution.accel_sigma);
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::cerr << "usage: imu_camera_campaign RESULTS FIRST LAST [FOLDER [--corners]]\n";
    return 2;
  }
  const std::string path = argv[1];
  const std::uint64_t first = std::stoull(argv[2]);
  const std::uint64_t last = std::stoull(argv[3]);
  const std::string folder = argc > 4 ? argv[4] : "";
  const bool rendered_images = !folder.empty() && argc < 6;
  const auto done = readRows(path);
  for (std::uint64_t seed = first; seed <= last; ++seed) {
    if (done.count(seed) != 0) continue;
    const std::string text = runRig(seed, folder, rendered_images);
    std::ofstream(path, std::ios::app) << text;
  }

  struct Kind {
    double most = 0;
    double most_sigmas = 0;
    double square = 0;
    int count = 0;
    int beyond3 = 0;
    int beyond5 = 0;
  };
  std::map<std::string, Kind> kinds;
  double nees = 0;
  double dimension = 0;
  int outside = 0;
  int rigs = 0;
  int refused = 0;
  double slowest = 0;
  Kind all;
  for (const auto& [seed, rows] : readRows(path)) {
    if (seed < first || seed > last) continue;
    ++rigs;
    for (const Row& row : rows) {
      if (row.name == "nees") {
        nees += row.error;
        dimension += row.sigma;
        const double ratio = row.error / row.sigma;
        if (ratio < 0.7 || ratio > 1.4) ++outside;
      } else if (row.name == "reasons" || row.name == "failed") {
        refused += row.error > 0 ? 1 : 0;
      } else if (row.name == "seconds") {
        slowest = std::max(slowest, row.error);
      } else {
        // Axes of one quantity are one row.
        std::string name = row.name.substr(0, row.name.find_last_of(' '));
        if (row.name == "time offset" || row.name.starts_with("cam")) name = row.name;
        if (name.starts_with("cam")) name = name.substr(5);
        if (name.starts_with("T_body_cam")) name = "T_body_cam" + name.substr(11);
        for (Kind* kind : {&kinds[name + " [" + row.unit + "]"], &all}) {
          const double sigmas = std::abs(row.error) / row.sigma;
          kind->most = std::max(kind->most, std::abs(row.error));
          kind->most_sigmas = std::max(kind->most_sigmas, sigmas);
          kind->square += sigmas * sigmas;
          kind->beyond3 += sigmas > 3 ? 1 : 0;
          kind->beyond5 += sigmas > 5 ? 1 : 0;
          ++kind->count;
        }
      }
    }
  }
  fmt::print(
      "| value | rigs x values | largest error | largest, sigmas | rms, sigmas | beyond 3 sigma "
      "|\n|---|---|---|---|---|---|\n");
  for (const auto& [name, kind] : kinds) {
    fmt::print("| {} | {} | {:.4g} | {:.2f} | {:.3f} | {} |\n", name, kind.count, kind.most, kind.most_sigmas,
               std::sqrt(kind.square / kind.count), kind.beyond3);
  }
  fmt::print(
      "{} rigs, {} refused; {:.2f} % of {} values within 3 sigma, {} beyond 5; NEES {:.3f} of its dimension, "
      "{} rigs outside 0.7 to 1.4; slowest {:.1f} s\n",
      rigs, refused, 100.0 * (all.count - all.beyond3) / std::max(all.count, 1), all.count, all.beyond5,
      nees / std::max(dimension, 1.0), outside, slowest);
  const bool good = all.beyond5 == 0 && all.beyond3 <= 0.01 * all.count && refused == 0 &&
                    nees > 0.7 * dimension && nees < 1.4 * dimension;
  return good ? EXIT_SUCCESS : EXIT_FAILURE;
}
