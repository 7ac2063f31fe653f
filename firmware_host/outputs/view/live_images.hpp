#pragma once
// The camera images of the live view, with what the estimator made of them as vectors (docs/view.md).
//
// sample() takes what came; where a frame's tracks and its images are both there it becomes the instant to be
// shown. Without tracks for kPatience (no IMU, say) images come alone. One thread. Memory: one picture a
// camera; the images stay in the graph's slots, at most kViewQuota of each camera, and none while nobody
// looks.

#include <array>
#include <cstdint>
#include <deque>
#include <nlohmann/json.hpp>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/outputs/view/picture_coder.hpp"

namespace swiftlet {

class LiveImages {
 public:
  static constexpr double kPatience = 0.5;   ///< s
  static constexpr double kLoopShown = 1.5;  ///< s after its keyframe
  static constexpr std::size_t kMostMeshEdges = 1500;

  /// `rig`: the cameras in use.
  explicit LiveImages(const Rig& rig) : rig_(rig) {}

  /// [{"width", "height"}] of the cameras' images [px].
  [[nodiscard]] nlohmann::ordered_json cameras() const;
  /// `now`: host's clock [s]. `watched`: somebody looks. True: there is an instant that was not shown.
  [[nodiscard]] bool sample(LiveOutlet& outlet, double now, bool watched);
  /// Stamp of that instant.
  [[nodiscard]] Stamp stamp() const { return stamp_; }
  /// It, and lets go of its images. `t`: its time on the page [s].
  [[nodiscard]] nlohmann::ordered_json take(LiveOutlet& outlet, double t, const PictureSize& size);
  /// The same without making anything of it.
  void skip();

 private:
  using Json = nlohmann::ordered_json;
  using Loan = ImagePool::Loan;

  void receive(ImageFeed& feed);
  void choose(ImageFeed& feed, double now);
  [[nodiscard]] Json cameraJson(const LiveOutlet& outlet, std::size_t c, const PictureSize& size);
  void addSight(const LiveOutlet& outlet, std::size_t c, Json& json) const;
  [[nodiscard]] Json meshJson(const LocalMesh& mesh, const SE3& T_world_cam) const;

  struct Camera {
    std::deque<Loan> held;           ///< in order, until their tracks are there
    Loan shown;                      ///< of the instant
    std::uint64_t counted_from = 0;  ///< number and stamp from which the rate is counted
    Stamp counted_stamp;
    double rate = 0;  ///< Hz; 0: unknown
  };

  Rig rig_;
  std::array<Camera, kMaxCameras> camera_;
  std::uint64_t sight_number_ = 0;
  bool has_sight_ = false;  ///< the instant is the feed's newest sight
  bool fresh_ = false;      ///< an instant waits to be shown
  Stamp stamp_;
  double waiting_ = -1;  ///< host's clock, since when images wait for tracks; negative: none do
  PictureCoder coder_;
  std::vector<TrackId> landmarks_;  ///< of the window at the instant, sorted
};

}  // namespace swiftlet
