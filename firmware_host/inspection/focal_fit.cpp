#include "firmware_host/inspection/focal_fit.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr int kSteps = 22;  // in each direction, to ratios of 0.41 and 2.4
constexpr double kStep = 0.04;
constexpr int kStride = 4;  // steps in the first search; the minimum is wider
// px, a track's distance from its epipolar line; errors beyond are down-weighted
constexpr double kEpipolarNoise = 0.5;
constexpr std::size_t kMostTurns = 150;
constexpr int kRounds = 3;
constexpr std::size_t kFewestOfFocal = 20;

/// Tracks of one turn, and the gyro's rotation for it.
struct TurnTracks {
  std::vector<TrackPair> pairs;
  Eigen::Matrix3d R_cur_prev;
};

CameraModel scaled(const CameraModel& camera, double ratio) {
  Eigen::Vector4d intrinsics = camera.intrinsics();
  intrinsics.head<2>() *= ratio;
  return {camera.kind(), camera.width(), camera.height(), intrinsics, camera.distortion()};
}

/// Robust sum of squared distances from the epipolar lines, in units of kEpipolarNoise squared, for the best
/// translation.
double costOf(const TurnTracks& turn, const CameraModel& camera) {
  std::vector<Eigen::Vector3d> normals;
  std::vector<std::array<Eigen::Vector3d, 2>> rays;
  for (const TrackPair& pair : turn.pairs) {
    Eigen::Vector3d from;
    Eigen::Vector3d to;
    if (!camera.unproject(pair.from, from) || !camera.unproject(pair.to, to)) continue;
    from = turn.R_cur_prev * from;
    normals.push_back(from.cross(to));
    rays.push_back({from, to});
  }
  constexpr double kWorst = 6;  // for a pair that the lens cannot have seen
  const double cost = kWorst * static_cast<double>(turn.pairs.size() - normals.size());
  std::vector<double> weights(normals.size(), 1);
  double left = 0;
  for (int round = 1; round <= kRounds; ++round) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < normals.size(); ++i) sum += weights[i] * normals[i] * normals[i].transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum);
    const Eigen::Vector3d t = solver.eigenvectors().col(0);
    for (std::size_t i = 0; i < normals.size(); ++i) {
      const double gradient = t.cross(rays[i][0]).squaredNorm() + t.cross(rays[i][1]).squaredNorm() + 1e-12;
      const double distance = t.dot(normals[i]) * camera.focal() / kEpipolarNoise;
      const double squared = distance * distance / gradient;
      weights[i] = 1 / ((1 + squared) * gradient);
      if (round == kRounds) left += std::log1p(squared);
    }
  }
  return cost + left;
}

}  // namespace

std::optional<FocalFit> fitFocal(const std::vector<TrackedImage>& images,
                                 const std::vector<CameraTurn>& turns, const GyroIntegral& gyro,
                                 const MotionFit& fit, const Eigen::Matrix3d& gyro_to_camera,
                                 const CameraModel& camera) {
  // The largest turns are the most informative.
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < turns.size(); ++k) {
    if (fit.weights[k] > 0.3) order.push_back(k);
  }
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) {
    return turns[a].turn.squaredNorm() > turns[b].turn.squaredNorm();
  });
  if (order.size() > kMostTurns) order.resize(kMostTurns);
  std::vector<TurnTracks> tracks;
  for (const std::size_t k : order) {
    const CameraTurn& turn = turns[k];
    if (!gyro.covers(turn.from + fit.shift, turn.to + fit.shift)) continue;
    const Eigen::Vector3d turned =
        gyro_to_camera * (gyro.at(turn.to + fit.shift) - gyro.at(turn.from + fit.shift)) +
        fit.offset * (turn.to - turn.from);
    TurnTracks entry{commonTracks(images[turn.first], images[turn.last]), expSo3Matrix(-turned)};
    if (entry.pairs.size() >= kFewestOfFocal) tracks.push_back(std::move(entry));
  }
  const auto total = [&](double ratio) {
    const CameraModel model = scaled(camera, ratio);
    double sum = 0;
    for (const TurnTracks& turn : tracks) sum += costOf(turn, model);
    return sum;
  };
  constexpr std::size_t kFewestTurns = 15;
  if (tracks.size() < kFewestTurns) return {};
  // Ratios are steps from the calibrated one, so all are compared in the same way.
  std::map<int, double> costs;
  const auto at = [&](int step) {
    const auto [entry, fresh] = costs.try_emplace(step, 0.0);
    if (fresh) entry->second = total(std::exp(step * kStep));
    return entry->second;
  };
  int best = 0;
  const auto look = [&](int from, int to, int stride) {
    for (int step = from; step <= to; step += stride) {
      if (at(step) < at(best)) best = step;
    }
  };
  look(-kSteps / kStride * kStride, kSteps, kStride);
  look(std::max(best - kStride + 1, -kSteps), std::min(best + kStride - 1, kSteps), 1);
  if (std::abs(best) == kSteps) return {};
  const double curvature = at(best - 1) - 2 * at(best) + at(best + 1);
  if (!(curvature > 0)) return {};
  const double place = 0.5 * (at(best - 1) - at(best + 1)) / curvature;
  FocalFit result;
  result.ratio = std::exp(kStep * (best + place));
  result.sigma = kStep / std::sqrt(curvature);
  result.gain = 0.5 * (at(0) - at(best));
  return result;
}

}  // namespace swiftlet
