#pragma once
// Replaces the smoother if poses are given: landmarks are triangulated from tracks over a sliding window.
//
// States are kept by the smoother's rules: the newest four frames, then keyframes, up to twelve in all. A
// keyframe whose landmarks are out of sight is removed first, otherwise the one in the densest place
// (estimator/smoother). A landmark is triangulated from all its sightings in the window, again whenever they
// change. The worst sighting is removed while any is off by more than a few pixels, up to a third of them.
// The remaining ones must see it in front and determine its depth to a third. Poses count as exact:
// inverse_depth_sigma is that of the pixel noise alone. Frames: world of the given poses. Host side:
// allocates; about 1 ms per frame of 300 features.

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
  double horizon = 30.0;                  ///< s: older states are removed
  int max_recent = 4;
  int max_keyframes = 12;
  /// Keep sightings in keyframes permanently, so that a landmark that is found again has all of them. Memory
  /// grows with the flight.
  bool keep_sightings = false;
};

/// Outcomes of all triangulations.
struct GivenPoseCounters {
  std::uint64_t triangulated = 0;
  std::uint64_t sightings_left_out = 0;  ///< removed because they did not fit
  std::uint64_t no_parallax = 0;
  std::uint64_t no_fit = 0;  ///< behind the camera, too near or far, or too many bad sightings
};

class GivenPoseWindow {
 public:
  GivenPoseWindow(const Rig& rig, const GivenPoseSettings& settings);

  /// Predicts for the front-end at this pose.
  void predict(const SE3& T_world_body, FrontendPrediction& prediction) const;
  /// Adds the frame and makes room; window() is then the window after this frame. Features with pixels that
  /// are not finite or outside the lens model are omitted.
  void add(const TrackedFrame& tracked, const SE3& T_world_body);
  /// The poses have jumped: forgets everything; the next window belongs to a new epoch.
  void startEpoch();

  /// `newest` holds stamp, epoch, pose and velocity.
  [[nodiscard]] const SmoothedWindow& window() const { return window_; }
  [[nodiscard]] const GivenPoseCounters& counters() const { return counters_; }

 private:
  struct View {
    std::uint64_t frame_index = 0;
    Eigen::Vector3d bearing;  ///< unit, in the camera frame
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
  using Landmarks = std::map<TrackId, Landmark>;  // ordered by id: the same bytes every time

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
