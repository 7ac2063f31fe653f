#include "firmware_host/inspection/camera_turns.hpp"

#include <algorithm>

#include "estimator/geometry/ransac.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kPixelSigma = 0.6;
constexpr std::size_t kFewestOfTurn = 20;
// Longest time between two images of one turn; a longer gap separates stretches of the log.
constexpr double kLongestTurnTime = 0.5;  // s

}  // namespace

std::vector<CameraTurn> cameraTurns(const std::vector<TrackedImage>& images, const CameraModel& camera,
                                    Stamp origin) {
  RansacSettings settings;
  settings.bearing_sigma = kPixelSigma / camera.focal();
  settings.confidence = 0.99;
  settings.max_iterations = 100;
  settings.min_inliers = kFewestOfTurn;
  MonoRansac ransac(settings);
  std::vector<CameraTurn> turns;
  std::size_t first = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (!images[i].follows) first = i;
    const double seconds = (images[i].stamp - images[first].stamp).seconds();
    if (i == first || seconds < kLeastTurnTime) continue;
    std::vector<Eigen::Vector3d> from;
    std::vector<Eigen::Vector3d> to;
    for (const TrackPair& pair : commonTracks(images[first], images[i])) {
      Eigen::Vector3d a;
      Eigen::Vector3d b;
      if (!camera.unproject(pair.from, a) || !camera.unproject(pair.to, b)) continue;
      from.push_back(a);
      to.push_back(b);
    }
    RansacResult result;
    const bool tried = seconds < kLongestTurnTime && from.size() >= kFewestOfTurn;
    if (tried && (ransac.fivePoint(from, to, i, result).ok() || result.no_parallax) &&
        2 * result.inlier_count >= from.size()) {
      CameraTurn turn;
      turn.from = (images[first].stamp - origin).seconds();
      turn.to = (images[i].stamp - origin).seconds();
      turn.first = first;
      turn.last = i;
      turn.turn = -logSo3(result.T_cur_prev.rotation);
      turns.push_back(turn);
    }
    first = i;
  }
  return turns;
}

GyroIntegral::GyroIntegral(const std::vector<ImuSample>& samples, Stamp origin) {
  times_.reserve(samples.size());
  sums_.reserve(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    times_.push_back((samples[i].stamp - origin).seconds());
    if (i == 0) {
      sums_.push_back(Eigen::Vector3d::Zero());
      continue;
    }
    const double step = times_[i] - times_[i - 1];
    sums_.push_back(sums_[i - 1] + 0.5 * step * (samples[i].gyro + samples[i - 1].gyro));
  }
}

Eigen::Vector3d GyroIntegral::at(double time) const {
  const auto after = std::ranges::upper_bound(times_, time);
  if (after == times_.begin()) return sums_.front();
  if (after == times_.end()) return sums_.back();
  const auto i = static_cast<std::size_t>(after - times_.begin());
  const double share = (time - times_[i - 1]) / (times_[i] - times_[i - 1]);
  return sums_[i - 1] + share * (sums_[i] - sums_[i - 1]);
}

}  // namespace swiftlet
