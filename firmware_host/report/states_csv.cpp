#include "firmware_host/report/states_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "firmware_host/report/names.hpp"

namespace swiftlet {
namespace {

constexpr int kPoseDim = 6;
constexpr std::size_t kFirstVariance = 17;
constexpr std::size_t kFirstCovariance = kFirstVariance + kStateDim;
constexpr std::size_t kCovariances = kPoseDim * (kPoseDim - 1) / 2;
constexpr std::size_t kFigures = 11;  ///< health and what follows it

void append(std::string& row, double value) { row += fmt::format(",{:.17g}", value); }

void append(std::string& row, const Eigen::Vector3d& v) {
  for (const double x : v) append(row, x);
}

/// The keyframe's figures, from at_rest on; health and epoch stand before them.
constexpr std::size_t kFirstFigure = kFirstCovariance + kCovariances + 2;
constexpr std::size_t kFigures = 9;

void readFigures(const CsvReader& csv, StoredState& state) {
  std::array<double, kFigures> figures{};
  for (std::size_t i = 0; i < kFigures; ++i) {
    if (!parseDouble(csv.field(kFirstFigure + i), figures[i])) return;
  }
  state.has_figures = true;
  state.figures.keyframe = true;
  state.figures.at_rest = figures[0] != 0;
  std::array<int*, 4> counts = {&state.figures.tracks, &state.figures.landmarks, &state.figures.inliers_mono,
                                &state.figures.inliers_stereo};
  for (std::size_t i = 0; i < counts.size(); ++i) *counts[i] = static_cast<int>(figures[1 + i]);
  state.figures.track_length = figures[5];
  state.figures.reprojection_rms = figures[6];
  state.figures.imu_residual = figures[7];
  state.figures.iterations = static_cast<int>(figures[8]);
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
  constexpr std::size_t kNumbers = kFirstCovariance + kCovariances;
  std::array<const char*, kNumbers - 1> names{};
  names.fill("state or covariance");
  std::array<double, kNumbers - 1> v{};
  std::vector<StoredState> states;
  while (csv.next(kNumbers)) {
    StoredState state;
    if (!parseNanoseconds(csv.field(0), state.stamp)) {
      csv.reject("timestamp", "not a stamp in ns");
      continue;
    }
    if (!csv.numbers(1, names, v.data())) continue;
    state.T_world_body = SE3(Eigen::Quaterniond(v[3], v[4], v[5], v[6]), {v[0], v[1], v[2]});
    state.v_world_body = {v[7], v[8], v[9]};
    state.bias_gyro = {v[10], v[11], v[12]};
    state.bias_accel = {v[13], v[14], v[15]};
    for (int i = 0; i < kStateDim; ++i) {
      state.variances[i] = v[kFirstVariance - 1 + static_cast<std::size_t>(i)];
    }
    readFigures(csv, state);
    std::size_t next = kFirstCovariance - 1;
    for (int i = 0; i < kPoseDim; ++i) {
      state.covariance(i, i) = v[kFirstVariance - 1 + static_cast<std::size_t>(i)];
      for (int j = i + 1; j < kPoseDim; ++j) {
        state.covariance(i, j) = v[next++];
        state.covariance(j, i) = state.covariance(i, j);
      }
    }
    states.push_back(state);
  }
  csv.finish("states", "Give a states.csv that `swiftlet replay` wrote");
  std::ranges::stable_sort(states, {}, &StoredState::stamp);
  return states;
}

namespace {

bool readHealth(std::string_view name, Health& health) {
  for (const Health candidate : {Health::kInitializing, Health::kGood, Health::kDegraded, Health::kFailed}) {
    if (healthName(candidate) != name) continue;
    health = candidate;
    return true;
  }
  return false;
}

/// What stands behind the covariances, in the order of statesRow().
bool readFigures(CsvReader& csv, std::size_t first, KeyframeState& keyframe) {
  if (!readHealth(csv.field(first), keyframe.state.health)) {
    csv.reject("health", quoteInput(csv.field(first)) + " is no health");
    return false;
  }
  constexpr std::array<const char*, kFigures - 1> kNames = {
      "epoch",          "at_rest",      "tracks",           "landmarks",    "inliers_mono",
      "inliers_stereo", "track_length", "reprojection_rms", "imu_residual", "iterations"};
  std::array<double, kNames.size()> v{};
  if (!csv.numbers(first + 1, kNames, v.data())) return false;
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
  return true;
}

}  // namespace

std::vector<KeyframeState> readKeyframes(const std::string& path) {
  constexpr std::size_t kNumbers = kFirstCovariance + kCovariances;
  LogCounters counters;
  LogWarnings warnings;
  CsvReader csv(path, CsvReader::Separator::kComma, counters, warnings);
  std::array<const char*, kNumbers - 1> names{};
  names.fill("state or covariance");
  std::array<double, kNumbers - 1> v{};
  std::vector<KeyframeState> keyframes;
  while (csv.next(kNumbers + kFigures)) {
    KeyframeState keyframe;
    NavState& state = keyframe.state;
    if (!parseNanoseconds(csv.field(0), state.stamp)) {
      csv.reject("timestamp", "not a stamp in ns");
      break;
    }
    if (!csv.numbers(1, names, v.data()) || !readFigures(csv, kNumbers, keyframe)) break;
    const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
    if (!(std::abs(q.norm() - 1) < 1e-6)) {
      csv.reject("quaternion", fmt::format("its norm is {:.4g}, not 1", q.norm()));
      break;
    }
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
    keyframes.push_back(keyframe);
  }
  if (csv.firstBad()) {
    const InputError& bad = *csv.firstBad();
    throw InputError(bad.file, bad.line, bad.field, bad.message,
                     "Replay again, or delete the row if a run that ended badly cut it short");
  }
  return keyframes;
}

}  // namespace swiftlet
