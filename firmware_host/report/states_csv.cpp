#include "firmware_host/report/states_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"
#include "firmware_host/report/names.hpp"

namespace swiftlet {
namespace {

constexpr int kPoseDim = 6;
constexpr std::size_t kFirstVariance = 17;
constexpr std::size_t kFirstCovariance = kFirstVariance + kStateDim;
constexpr std::size_t kCovariances = kPoseDim * (kPoseDim - 1) / 2;

void append(std::string& row, double value) { row += fmt::format(",{:.17g}", value); }

void append(std::string& row, const Eigen::Vector3d& v) {
  for (const double x : v) append(row, x);
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

}  // namespace swiftlet
