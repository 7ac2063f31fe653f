#pragma once
// State and steps of the front-end; private to this folder. Stage and contract: frontend.hpp.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/usual_interval.hpp"
#include "estimator/frontend/anchor_pool.hpp"
#include "estimator/frontend/corners.hpp"
#include "estimator/frontend/frontend.hpp"
#include "estimator/frontend/lucas_kanade.hpp"
#include "estimator/frontend/stereo_matcher.hpp"
#include "estimator/geometry/ransac.hpp"
#include "estimator/messages/camera_scan.hpp"

namespace swiftlet {

/// A feature in the cameras' newest images.
struct Track {
  TrackId id = 0;
  int slot = -1;       ///< in the anchor pool
  int age = 0;         ///< frames since detection
  int unmatched = 0;   ///< consecutive failed attempts to find it in the other camera
  int match_wait = 0;  ///< keyframes until the next attempt
  int landmark = -1;   ///< index of its prediction in this frame's list
  /// Whether it has a position in that camera's newest image, which may be of an earlier frame.
  std::array<bool, kMaxCameras> live{};
  std::array<bool, kMaxCameras> had_previous{};  ///< whether `previous_bearing` is of the previous frame
  std::array<Eigen::Vector2f, kMaxCameras> pixel{};
  std::array<Eigen::Vector3d, kMaxCameras> bearing{};
  /// For a rolling shutter, as seen from the middle row for a point at infinity.
  std::array<Eigen::Vector3d, kMaxCameras> previous_bearing{};
  std::array<bool, kMaxCameras> in_keyframe{};
  std::array<Eigen::Vector3d, kMaxCameras> keyframe_bearing{};
};

class Frontend::Impl {
 public:
  Impl(const Rig& rig, const FrontendSettings& settings);

  Status step(const StereoFrame& frame, const FrontendPrediction& prediction, int max_features,
              TrackedFrame& out);
  void reset();
  [[nodiscard]] const FrontendStatistics& statistics() const { return statistics_; }
  [[nodiscard]] const LostSightings& lost() const { return lost_; }

 private:
  struct Camera {
    std::array<Pyramid, 2> pyramid;
    std::size_t newest = 0;
    bool present = false;      ///< has an image in this frame
    bool has_history = false;  ///< the other pyramid holds its last image
    bool seen = false;         ///< since the last reset: `last` is valid
    Stamp last;                ///< stamp of its newest image
    UsualInterval interval;    ///< between its images
    bool rotation_known = false;
    Eigen::Quaterniond R_prev_cur = Eigen::Quaterniond::Identity();  ///< camera axes, since `last`
    Eigen::Matrix3d R_cur_prev = Eigen::Matrix3d::Identity();        ///< its inverse
    ScanTurn scan;                                                   ///< of the newest image's rows
    ScanTurn scan_before;                                            ///< of the image before

    [[nodiscard]] const Pyramid& now() const { return pyramid[newest]; }
    [[nodiscard]] const Pyramid& before() const { return pyramid[1 - newest]; }
  };

  Status check(const StereoFrame& frame) const;
  void takeExtrinsics(const FrontendPrediction& prediction);
  void takeImages(const StereoFrame& frame, const FrontendPrediction& prediction);
  void joinPredictions(const FrontendPrediction& prediction);
  void trackCamera(std::size_t c, const FrontendPrediction& prediction);
  /// Predicted position of a feature, and the number of pyramid levels to search.
  struct Guess {
    Eigen::Vector2f pixel;
    int levels = 0;
    bool of_landmark = false;
  };
  [[nodiscard]] Guess predict(const Track& track, std::size_t c, const FrontendPrediction& prediction) const;
  [[nodiscard]] bool follow(const Track& track, std::size_t c, const Guess& guess, Eigen::Vector2f& pixel);
  [[nodiscard]] Eigen::Matrix2f turn(std::size_t c, const Eigen::Vector3d& from_bearing) const;
  void verifyMotion(std::size_t c, std::uint64_t seed);
  [[nodiscard]] Eigen::Vector3d inMiddleRow(std::size_t c, const ScanTurn& scan, const Eigen::Vector2f& pixel,
                                            const Eigen::Vector3d& bearing) const;
  void verifyStereo();
  void findAgain(const FrontendPrediction& prediction, int max_features);
  [[nodiscard]] bool locate(AnchorPatch& anchor, std::size_t c, const PredictedLandmark& landmark,
                            Eigen::Vector2f& pixel) const;
  void dropLost();
  [[nodiscard]] bool keyframeDue(Stamp stamp) const;
  [[nodiscard]] float medianParallax() const;
  void replenish(int max_features);
  void detect(std::size_t c, int wanted, int max_features);
  void matchMissing(bool only_new);
  void markKeyframe(Stamp stamp);
  void write(const StereoFrame& frame, bool keyframe, TrackedFrame& out);
  void darkImages();
  void lose(const Track& track, std::size_t c, SightingLoss loss);
  bool place(Track& track, std::size_t c, const Eigen::Vector2f& pixel);
  [[nodiscard]] bool usesStereo() const { return rig_.camera_count > 1; }

  Rig rig_;
  FrontendSettings settings_;
  std::array<Camera, kMaxCameras> camera_;
  std::vector<CornerDetector> detector_;
  StereoMatcher matcher_;
  MonoRansac ransac_;
  RansacResult ransac_result_;
  AnchorPool anchors_;
  FixedVector<Track, kMaxFeatures> tracks_;
  FixedVector<Corner, kMaxFeatures> corners_;
  CornerDetector::Pixels occupied_;
  struct LandmarkIndex {
    TrackId id = 0;
    int index = 0;
  };
  FixedVector<LandmarkIndex, kMaxLandmarks> landmark_order_;  ///< by id
  std::array<int, kMaxLandmarks> track_of_landmark_{};        ///< -1: not tracked
  FixedVector<Eigen::Vector3d, kMaxFeatures> bearings_prev_, bearings_cur_;
  FixedVector<std::size_t, kMaxFeatures> owners_;
  TrackId next_id_ = 1;
  bool has_keyframe_ = false;
  Stamp keyframe_stamp_;
  int keyframe_tracks_ = 0;
  bool keyframe_rotation_known_ = false;
  Eigen::Quaterniond R_keyframe_cur_ = Eigen::Quaterniond::Identity();  ///< body axes
  FrontendStatistics statistics_;
  LostSightings lost_;
};

}  // namespace swiftlet
