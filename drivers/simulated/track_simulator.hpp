#pragma once
// Feature tracks of a flight without rendering, like those that a front-end gives to the smoother.
//
// Landmarks are drawn uniformly over the world's surfaces. In each frame surviving tracks are projected with
// the rig's true calibration and lost ones are replaced by new landmarks spread over the image, with pixel
// noise, outliers, drop-outs and limited lifetimes. A landmark seen again after its track ended gets a new
// id. Frames: pixels distorted, (0,0) the centre of the top-left pixel. Cost: about 0.4 ms per frame with 150
// tracks among 400 surfaces, mostly for occlusion.

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/simulated/spline_trajectory.hpp"
#include "drivers/simulated/world.hpp"
#include "estimator/camera/rig.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

struct TrackSettings {
  int landmarks = 4000;        ///< on the world's surfaces
  int max_tracks = 150;        ///< features per frame; at most kMaxFeatures
  double pixel_sigma = 0.5;    ///< px per axis and camera, 1 sigma
  double mean_lifetime = 4.0;  ///< s; exponentially distributed, shorter if the landmark leaves the image
  double dropout = 0.02;       ///< share of sightings missing in one frame, per track
  double right_share = 0.85;   ///< share of sightings visible in camera 1 that stereo matching finds
  double outlier_share = 0.0;  ///< share of sightings displaced at random
  double outlier_low = 5;      ///< px
  double outlier_high = 100;   ///< px
  double min_range = 0.3;      ///< m
  double max_range = 15;       ///< m
  double max_slant = 80;       ///< deg between the line of sight and the surface's normal
  bool occlusion = true;       ///< surfaces hide what is behind them
  double keyframe_interval = 0.25;  ///< s at most between keyframes
  double keyframe_motion = 40;      ///< px, median motion since the last keyframe that triggers a new one
  double border = 4;                ///< px without features at the image's edge
  bool mono = false;                ///< camera 0 only
  std::uint64_t seed = 1;
};

/// Truth of each feature of a frame.
struct TrackTruth {
  Eigen::Vector3d landmark = Eigen::Vector3d::Zero();  ///< world
  std::uint32_t landmark_index = 0;
  std::array<Eigen::Vector2d, kMaxCameras> pixel{};  ///< without noise, valid where seen
  std::array<bool, kMaxCameras> outlier{};
};

class TrackSimulator {
 public:
  /// The world, rig and trajectory must outlive this.
  TrackSimulator(const World& world, const Rig& rig, const SplineTrajectory& trajectory,
                 const TrackSettings& settings);

  /// The tracks at `seconds` of the trajectory, which must be later than in the previous call. `stamp` is the
  /// frame's.
  void step(double seconds, Stamp stamp, TrackedFrame& frame, std::vector<TrackTruth>* truth = nullptr);

 private:
  struct Landmark {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
    bool tracked = false;
  };
  struct Track {
    TrackId id = 0;
    std::uint32_t landmark = 0;
    double end = 0;  ///< s of the trajectory
    bool has_keyframe = false;
    Eigen::Vector2d keyframe = Eigen::Vector2d::Zero();  ///< true left pixel in the last keyframe
    Eigen::Vector2d now = Eigen::Vector2d::Zero();
  };
  /// Poses of the cameras at one time of the trajectory.
  struct Place {
    double seconds = 0;
    std::array<SE3, kMaxCameras> T_world_cam;
    std::array<SE3, kMaxCameras> T_cam_world;
  };
  [[nodiscard]] Place placeAt(double seconds) const;
  [[nodiscard]] bool visible(const Place& place, std::size_t camera, const Landmark& landmark,
                             Eigen::Vector2d& pixel) const;
  [[nodiscard]] bool atItsRow(double seconds, std::size_t camera, const Eigen::Vector3d& position,
                              Eigen::Vector2d& pixel) const;
  [[nodiscard]] bool inSight(const SE3& T_world_cam, const Landmark& landmark) const;
  void keepTracks(const Place& place);
  void startTracks(const Place& place);
  void chooseKeyframe(double seconds, TrackedFrame& frame);
  Eigen::Vector2d disturbed(const Eigen::Vector2d& pixel, const CameraModel& camera, bool& outlier);

  const World* world_;
  const Rig* rig_;
  const SplineTrajectory* trajectory_;
  TrackSettings settings_;
  Random random_;
  std::vector<Landmark> landmarks_;
  std::vector<Track> tracks_;
  TrackId next_id_ = 1;
  std::uint64_t frame_index_ = 0;
  double last_keyframe_ = -1e9;
};

}  // namespace swiftlet
