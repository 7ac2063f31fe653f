#pragma once
// The seconds of log in the repository as keyframes of loop closure, with an odometry made of the truth.

#include <catch2/catch.hpp>
#include <memory>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "firmware_host/lab/evaluation/association.hpp"
#include "mapping/loop/loop_stage.hpp"

namespace swiftlet::picture_flight {

inline constexpr double kSpacing = 2.1;  // s of the stage's time between keyframes: each is a node
inline constexpr double kVisitGap = 60;  // s between the visits

struct Picture {
  std::array<std::vector<std::uint8_t>, kMaxCameras> pixels;
  std::array<ImageView, kMaxCameras> image;
  SE3 T_truth_body;
};

struct Pictures {
  Rig rig;
  std::vector<Picture> all;
};

inline const Pictures& pictures() {
  static const Pictures kept = [] {
    Pictures out;
    const auto log = openLog(std::string(SWIFTLET_SOURCE_ROOT) + "/tests/data/euroc_mh01_4s");
    out.rig = log->rig();
    const Trajectory truth = log->groundTruth();
    constexpr std::uint64_t kEvery = 8;
    SensorMessage message;
    std::array<std::uint64_t, kMaxCameras> seen{};
    while (log->next(message)) {
      const auto* frame = std::get_if<CameraFrame>(&message);
      if (frame == nullptr || seen[frame->camera]++ % kEvery != 0) continue;
      if (frame->camera == 0) {
        out.all.emplace_back();
        const auto pose = interpolate(truth, frame->stamp, Duration::fromMilliseconds(20));
        REQUIRE(pose.has_value());
        out.all.back().T_truth_body = *pose;
      }
      Picture& picture = out.all.back();
      std::vector<std::uint8_t>& pixels = picture.pixels[frame->camera];
      for (int y = 0; y < frame->image.height; ++y) {
        pixels.insert(pixels.end(), frame->image.row(y), frame->image.row(y) + frame->image.width);
      }
      picture.image[frame->camera] = {pixels.data(), frame->image.width, frame->image.height,
                                      frame->image.width};
    }
    return out;
  }();
  return kept;
}

/// Keyframe after keyframe, as the odometry would hand them over.
class Flight {
 public:
  explicit Flight(const LoopLimits& limits = {60, 100}, const LoopSettings& settings = {})
      : stage(std::make_unique<LoopStage>(pictures().rig, settings, limits)),
        window_(std::make_unique<SmoothedWindow>()),
        tracks_(std::make_unique<TrackedFrame>()) {
    window_->started = true;
  }

  /// `T_world_truth` is how wrong the odometry is by now.
  LoopReport see(const Picture& picture, double seconds, const SE3& T_world_truth, bool with_images = true) {
    const SE3 T_world_body = T_world_truth * picture.T_truth_body;
    WindowPose pose;
    pose.stamp = Stamp{} + Duration::fromSeconds(seconds);
    pose.frame_index = ++frame_;
    pose.keyframe = true;
    pose.T_world_body = T_world_body;
    window_->poses.clear();
    static_cast<void>(window_->poses.tryPushBack(pose));
    tracks_->stamp = pose.stamp;
    tracks_->index = frame_;
    KeyframeLink link;
    link.linked = linked_;
    link.previous = frame_ - 1;
    link.T_previous_this = T_world_before_.inverse() * T_world_body;
    const double elapsed = seconds - seconds_before_;
    link.covariance.diagonal() << Eigen::Vector3d::Constant(elapsed * 1e-4),
        Eigen::Vector3d::Constant(elapsed * 4e-4);
    link.covariance *= covariance_factor;
    LoopInput input{tracks_.get(), window_.get(), &link, {}};
    if (with_images) input.image = picture.image;
    LoopReport report;
    status = stage->step(input, LoopEffort{}, report);
    CHECK(report.candidates.size() <= LoopEffort{}.candidates);
    T_world_before_ = T_world_body;
    seconds_before_ = seconds;
    linked_ = true;
    return report;
  }

  void newEpoch() {
    ++window_->epoch;
    linked_ = false;
  }

  /// m, of the map's node against the truth in the frame of the first node.
  [[nodiscard]] double errorOfNode(std::size_t node, const Picture& picture) const {
    const SE3 T_truth_map = pictures().all.front().T_truth_body * stage->node(0).T_map_body.inverse();
    return ((T_truth_map * stage->node(node).T_map_body).translation - picture.T_truth_body.translation)
        .norm();
  }

  std::unique_ptr<LoopStage> stage;
  Status status;
  double covariance_factor = 1;  ///< of the odometry's links

 private:
  std::unique_ptr<SmoothedWindow> window_;
  std::unique_ptr<TrackedFrame> tracks_;
  std::uint64_t frame_ = 0;
  bool linked_ = false;
  SE3 T_world_before_;
  double seconds_before_ = 0;
};

}  // namespace swiftlet::picture_flight
