#pragma once
// The smoother's part where the poses are given: landmarks triangulated from tracks over a sliding window.
//
// States stay by the smoother's rules: the newest four frames whole, then keyframes up to twelve in all; a
// keyframe whose landmarks are out of sight goes first, else the one in the densest place
// (estimator/smoother). A landmark is triangulated from all its sightings in the window, again whenever they
// changed; the sighting that fits worst is left out while any misses by more than a few pixels, up to a third
// of them. What is left must see it in front, and determine its depth to a third. Poses count as exact:
// inverse_depth_sigma is that of the pixel noise alone. Frames: world of the given poses. Host side:
// allocates; about 1 ms a frame of 300 features.

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/frontend/frontend_prediction.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/track_noise.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

struct GivenPoseSettings {
  double pixel_sigma = kTrackPixelSigma;  ///< px
  double horizon = 30.0;                  ///< s: no state older than this stays
  int max_recent = 4;
  int max_keyframes = 12;
  /// Sightings in keyframes are kept permanently, so that a landmark found again is known by all of them.
  /// Memory grows with the flight.
  bool keep_sightings = false;
};

/// What became of triangulations, summed over all that were done.
struct GivenPoseCounters {
  std::uint64_t triangulated = 0;
  std::uint64_t sightings_left_out = 0;  ///< did not fit
  std::uint64_t no_parallax = 0;
  std::uint64_t no_fit = 0;  ///< behind, too near or far, or too many sightings that miss
};

class GivenPoseWindow {
 public:
  GivenPoseWindow(const Rig& rig, const GivenPoseSettings& settings);

  /// What the front-end may expect at this pose.
  void predict(const SE3& T_world_body, FrontendPrediction& prediction) const;
  /// Takes the frame in and makes room; window() is then that after this frame. Features with pixels that are
  /// no numbers, or beyond the lens model, are left out.
  void add(const TrackedFrame& tracked, const SE3& T_world_body);
  /// The poses have jumped: forgets everything, the next window belongs to a new epoch.
  void startEpoch();

  /// `newest` holds stamp, epoch, pose and velocity.
  [[nodiscard]] const SmoothedWindow& window() const { return window_; }
  [[nodiscard]] const GivenPoseCounters& counters() const { return counters_; }

 private:
  struct View {
    std::uint64_t frame_index = 0;
    Eigen::Vector3d bearing;  ///< unit, camera frame
    SE3 T_world_cam;
  };
  struct Point {
    bool valid = false;
    Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
    double inverse_depth_sigma = 0;
  };
  struct Landmark {
    std::vector<View> views;
    std::uint64_t last_frame = 0;
    bool changed = true;
    Point point;
  };
  using Landmarks = std::map<TrackId, Landmark>;  // by id: the same bytes every time

  void addViews(const TrackedFrame& tracked, const SE3& T_world_body);
  void trim();
  [[nodiscard]] std::size_t chooseKeyframeToDrop(std::size_t candidates) const;
  void dropState(std::size_t position);
  [[nodiscard]] Point locate(const Landmark& landmark);
  void writeWindow();

  Rig rig_;
  GivenPoseSettings settings_;
  GivenPoseCounters counters_;
  std::uint32_t epoch_ = 0;
  std::vector<WindowPose> states_;  ///< in order of time
  Landmarks landmarks_;
  SmoothedWindow window_;
};

}  // namespace swiftlet
