#pragma once
// Camera images of the live view, with the estimator's results as vectors (docs/view.md).
//
// sample() takes new images; when the tracks and all images of a frame are available, that frame becomes the
// instant to show. If no tracks arrive for kPatience (for example without an IMU), images are shown alone.
// One thread. Memory: one picture per camera; the images stay in the graph's slots, at most kViewQuota of
// each camera, and none without viewers.

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
  /// `now`: host's clock [s]. `watched`: there are viewers. True: there is an instant that has not been
  /// shown.
  [[nodiscard]] bool sample(LiveOutlet& outlet, double now, bool watched);
  /// Stamp of that instant.
  [[nodiscard]] Stamp stamp() const { return stamp_; }
  /// The message for that instant; releases its images. `t`: its time on the page [s].
  [[nodiscard]] nlohmann::ordered_json take(LiveOutlet& outlet, double t, const PictureSize& size);
  /// Releases the instant without making a message.
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
    std::deque<Loan> held;           ///< in order, until their tracks arrive
    Loan shown;                      ///< image of the instant
    std::uint64_t counted_from = 0;  ///< number and stamp from which the rate is counted
    Stamp counted_stamp;
    double rate = 0;  ///< Hz; 0: unknown
  };

  Rig rig_;
  std::array<Camera, kMaxCameras> camera_;
  std::uint64_t sight_number_ = 0;
  bool has_sight_ = false;  ///< the instant is the feed's newest sight
  bool fresh_ = false;      ///< an instant is waiting to be shown
  Stamp stamp_;
  double waiting_ = -1;  ///< host time since which images wait for tracks; negative: none wait
  PictureCoder coder_;
  std::vector<TrackId> landmarks_;  ///< of the window at the instant, sorted
};

}  // namespace swiftlet
