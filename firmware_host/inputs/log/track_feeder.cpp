#include "firmware_host/inputs/log/track_feeder.hpp"

#include "estimator/core/median.hpp"

namespace swiftlet {
namespace {

constexpr Duration kMinInterval = Duration::fromMilliseconds(140);
constexpr Duration kMaxInterval = Duration::fromMilliseconds(1000);
constexpr double kSurvival = 0.7;
constexpr float kMotion = 20.F;  // px

/// Median displacement of the tracks in both frames [px]; negative if there are none. `common`: their number.
float medianMotion(const std::map<TrackId, Eigen::Vector2f>& before,
                   const std::map<TrackId, Eigen::Vector2f>& now, std::size_t& common) {
  std::vector<float> moved;
  for (const auto& [id, pixel] : now) {
    const auto found = before.find(id);
    if (found != before.end()) moved.push_back((pixel - found->second).norm());
  }
  common = moved.size();
  if (moved.empty()) return -1.F;
  return medianOf(moved);
}

}  // namespace

TrackFeeder::TrackFeeder(TrackReader* reader) : reader_(reader) {}

const TrackedFrame* TrackFeeder::dueBefore(Stamp stamp) {
  if (reader_ == nullptr) return nullptr;
  if (!ready_ && !read()) return nullptr;
  return frame_.stamp < stamp ? &frame_ : nullptr;
}

bool TrackFeeder::read() {
  if (!reader_->next(frame_)) {
    reader_ = nullptr;
    return false;
  }
  Pixels now;
  for (const TrackedFeature& feature : frame_.features) {
    now[feature.id] = feature.pixel[feature.seen[0] ? 0 : 1];
  }
  if (!reader_->hasKeyframes()) chooseKeyframe(now);
  ready_ = true;
  return true;
}

void TrackFeeder::chooseKeyframe(const Pixels& now) {
  const Duration since = frame_.stamp - keyframe_stamp_;
  std::size_t common = 0;
  const float motion = medianMotion(keyframe_, now, common);
  const bool worn = static_cast<double>(common) < kSurvival * static_cast<double>(keyframe_.size());
  frame_.keyframe =
      keyframe_.empty() || since >= kMaxInterval || (since >= kMinInterval && (worn || motion > kMotion));
  if (!frame_.keyframe) return;
  keyframe_ = now;
  keyframe_stamp_ = frame_.stamp;
}

}  // namespace swiftlet
