#include "firmware_host/outputs/run_folder/states_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "estimator/messages/names.hpp"

namespace swiftlet {
namespace {

constexpr double kUnit = 1e-6;  // tolerance of a quaternion's norm, written with 17 digits
constexpr std::size_t kFirstVariance = 17;
constexpr std::size_t kFirstCovariance = kFirstVariance + kStateDim;
constexpr std::size_t kCovariances = kPoseDim * (kPoseDim - 1) / 2;
constexpr std::size_t kNumbers = kFirstCovariance + kCovariances;
constexpr std::size_t kFigures = 11;  // health and the columns after it

void append(std::string& row, double value) { row += fmt::format(",{:.17g}", value); }

void append(std::string& row, const Eigen::Vector3d& v) {
  for (const double x : v) append(row, x);
}

/// Reads the row up to the covariances, and its quaternion's norm. False: rejected.
bool readState(CsvReader& csv, NavState& state, double& norm) {
  std::array<const char*, kNumbers - 1> names{};
  names.fill("state or covariance");
  std::array<double, kNumbers - 1> v{};
  if (!parseNanoseconds(csv.field(0), state.stamp)) {
    csv.reject("timestamp", "not a stamp in ns");
    return false;
  }
  if (!csv.numbers(1, names, v.data())) return false;
  const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
  norm = q.norm();
  state.T_world_body = SE3(q, {v[0], v[1], v[2]});
  state.v_world_body = {v[7], v[8], v[9]};
  state.bias_gyro = {v[10], v[11], v[12]};
  state.bias_accel = {v[13], v[14], v[15]};
  std::size_t next = kFirstVariance - 1;
  for (int i = 0; i < kStateDim; ++i) state.covariance(i, i) = v[next++];
  for (int i = 0; i < kPoseDim; ++i) {
    for (int j = i + 1; j < kPoseDim; ++j) {
      state.covariance(i, j) = v[next++];
      state.covariance(j, i) = state.covariance(i, j);
    }
  }
  return true;
}

constexpr std::array<const char*, kFigures> kFigureNames = {
    "health",         "epoch",        "at_rest",          "tracks",       "landmarks", "inliers_mono",
    "inliers_stereo", "track_length", "reprojection_rms", "imu_residual", "iterations"};

/// Reads the columns after the covariances, in the order of statesRow(). Returns the index of the first wrong
/// one in kFigureNames, or their number.
std::size_t readFigures(const CsvReader& csv, KeyframeState& keyframe) {
  const std::optional<Health> health = healthNamed(csv.field(kNumbers));
  if (!health) return 0;
  std::array<double, kFigures - 1> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (!parseDouble(csv.field(kNumbers + 1 + i), v[i]) || !std::isfinite(v[i])) return 1 + i;
  }
  keyframe.state.health = *health;
  keyframe.state.epoch = static_cast<std::uint32_t>(v[0]);
  FrameStatistics& figures = keyframe.statistics;
  figures.keyframe = true;
  figures.at_rest = v[1] != 0;
  figures.tracks = static_cast<int>(v[2]);
  figures.landmarks = static_cast<int>(v[3]);
  figures.inliers_mono = static_cast<int>(v[4]);
  figures.inliers_stereo = static_cast<int>(v[5]);
  figures.track_length = v[6];
  figures.reprojection_rms = v[7];
  figures.imu_residual = v[8];
  figures.iterations = static_cast<int>(v[9]);
  return kFigures;
}

}  // namespace

std::string statesHeader() {
  std::string header =
      "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z [],v_x [m s^-1],v_y [m s^-1],"
      "v_z [m s^-1],bg_x [rad s^-1],bg_y [rad s^-1],bg_z [rad s^-1],ba_x [m s^-2],ba_y [m s^-2],"
      "ba_z [m s^-2]";
  constexpr std::array<const char*, 5> kBlocks = {"phi", "p", "v", "bg", "ba"};
  for (const char* block : kBlocks) {
    for (const char axis : {'x', 'y', 'z'}) header += fmt::format(",var_{}_{}", block, axis);
  }
  for (int i = 0; i < kPoseDim; ++i) {
    for (int j = i + 1; j < kPoseDim; ++j) {
      header += fmt::format(",cov_{}_{}_{}_{}", kBlocks[static_cast<std::size_t>(i) / 3], "xyz"[i % 3],
                            kBlocks[static_cast<std::size_t>(j) / 3], "xyz"[j % 3]);
    }
  }
  return header +
         ",health,epoch,at_rest,tracks,landmarks,inliers_mono,inliers_stereo,track_length [frames],"
         "reprojection_rms [px],imu_residual [],iterations";
}

std::string statesRow(const KeyframeState& keyframe) {
  const NavState& state = keyframe.state;
  const FrameStatistics& figures = keyframe.statistics;
  std::string row = fmt::format("{}", state.stamp.ns);
  append(row, state.T_world_body.translation);
  Eigen::Quaterniond q = state.T_world_body.rotation;
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  for (const double x : {q.w(), q.x(), q.y(), q.z()}) append(row, x);
  append(row, state.v_world_body);
  append(row, state.bias_gyro);
  append(row, state.bias_accel);
  for (int i = 0; i < kStateDim; ++i) append(row, state.covariance(i, i));
  for (int i = 0; i < kPoseDim; ++i) {
    for (int j = i + 1; j < kPoseDim; ++j) append(row, state.covariance(i, j));
  }
  return row + fmt::format(",{},{},{},{},{},{},{},{:.3f},{:.4f},{:.4f},{}", healthName(state.health),
                           state.epoch, figures.at_rest ? 1 : 0, figures.tracks, figures.landmarks,
                           figures.inliers_mono, figures.inliers_stereo, figures.track_length,
                           figures.reprojection_rms, figures.imu_residual, figures.iterations);
}

std::vector<StoredState> readStates(const std::string& path) {
  LogCounters counters;
  LogWarnings warnings;
  CsvReader csv(path, CsvReader::Separator::kComma, counters, warnings);
  std::vector<StoredState> states;
  while (csv.next(kNumbers)) {
    KeyframeState keyframe;
    double norm = 0;
    if (!readState(csv, keyframe.state, norm)) continue;
    StoredState state;
    state.stamp = keyframe.state.stamp;
    state.T_world_body = keyframe.state.T_world_body;
    state.v_world_body = keyframe.state.v_world_body;
    state.bias_gyro = keyframe.state.bias_gyro;
    state.bias_accel = keyframe.state.bias_accel;
    state.covariance = keyframe.state.covariance.topLeftCorner<kPoseDim, kPoseDim>();
    state.variances = keyframe.state.covariance.diagonal();
    state.has_figures = readFigures(csv, keyframe) == kFigures;
    if (state.has_figures) state.figures = keyframe.statistics;
    states.push_back(state);
  }
  csv.finish("states", "Give a states.csv written by `swiftlet replay`");
  std::ranges::stable_sort(states, {}, &StoredState::stamp);
  return states;
}

std::vector<KeyframeState> readKeyframes(const std::string& path) {
  LogCounters counters;
  LogWarnings warnings;
  CsvReader csv(path, CsvReader::Separator::kComma, counters, warnings);
  std::vector<KeyframeState> keyframes;
  while (csv.next(kNumbers + kFigures)) {
    KeyframeState keyframe;
    double norm = 0;
    if (!readState(csv, keyframe.state, norm)) break;
    if (const std::size_t wrong = readFigures(csv, keyframe); wrong < kFigures) {
      const std::string text = quoteInput(csv.field(kNumbers + wrong));
      csv.reject(kFigureNames[wrong], text + (wrong == 0 ? " is not a health" : " is not a finite number"));
      break;
    }
    if (!(std::abs(norm - 1) < kUnit)) {
      csv.reject("quaternion", fmt::format("its norm is {:.4g}, not 1", norm));
      break;
    }
    keyframes.push_back(keyframe);
  }
  if (csv.firstBad()) {
    const InputError& bad = *csv.firstBad();
    throw InputError(bad.file, bad.line, bad.field, bad.message,
                     "Replay again, or delete the row if an interrupted run truncated it");
  }
  return keyframes;
}

}  // namespace swiftlet
