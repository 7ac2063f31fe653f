#pragma once
// The moments of a run for pages: of each its pose, the cameras' images out of the run's log, and what the
// run folder keeps of them (docs/report.md). A message is what the page's image panel takes (docs/view.md).
//
// The moments are the images of camera 0 or, without images, the poses of odometry.tum. Pixels are those of
// the raw images.
// Memory: LogImages' and KeptFrames', 40 bytes a moment. Cost of a message: one image decoded and encoded per
// camera, some 10 ms. One thread at a time.

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware_host/lab/report/kept_frames.hpp"
#include "firmware_host/lab/report/log_images.hpp"
#include "firmware_host/lab/report/run_files.hpp"
#include "firmware_host/outputs/view/picture_coder.hpp"

namespace swiftlet {

/// How large pictures may be.
struct PictureBounds {
  int most_width = 0;          ///< px
  std::size_t most_bytes = 0;  ///< of a picture as text; quality is lowered until it has no more
};

class RunMoments {
 public:
  /// `log`: empty: the one that logOf() finds. Where it cannot be read, missing() says so and there are no
  /// images.
  RunMoments(const RunFiles& files, const std::string& log);

  [[nodiscard]] std::size_t count() const { return stamps_.size(); }
  [[nodiscard]] bool hasImages() const { return images_ != nullptr; }
  /// What could not be read.
  [[nodiscard]] const std::vector<MissingFile>& missing() const { return missing_; }
  /// Keyframes, or any moments of a run without: at most `most`, spread over the run.
  [[nodiscard]] std::vector<std::size_t> spread(std::size_t most) const;

  /// The document's "cameras": [{"width", "height"}]; empty without images.
  [[nodiscard]] nlohmann::ordered_json camerasJson() const;
  /// The document's "playback" of the chosen moments: {"count", "t", "poses", "keyframes", "note"}.
  [[nodiscard]] nlohmann::ordered_json playbackJson(std::span<const std::size_t> moments) const;
  /// One moment for the image panel, and under "scene" what the 3D view gets. `moment` below count().
  [[nodiscard]] nlohmann::ordered_json message(std::size_t moment, const PictureBounds& bounds);

 private:
  using Json = nlohmann::ordered_json;
  [[nodiscard]] bool isKeyframe(Stamp stamp) const;
  [[nodiscard]] std::optional<SE3> poseAt(Stamp stamp) const;
  [[nodiscard]] const Rig* rig() const;
  [[nodiscard]] std::string pictureText(const ImageView& image, const PictureBounds& bounds);
  [[nodiscard]] Json cameraJson(Stamp stamp, std::size_t camera, const std::optional<TriangleMesh>& mesh,
                                const PictureBounds& bounds);
  [[nodiscard]] Json tracksJson(const KeptKeyframe& keyframe, std::size_t camera) const;
  [[nodiscard]] Json loopJson(const LoopRevisit& loop, std::size_t camera) const;
  [[nodiscard]] Json meshJson(const TriangleMesh& mesh, const SE3& T_world_body, std::size_t camera) const;

  Stamp first_;
  Trajectory poses_;
  std::vector<Stamp> keyframes_;  ///< of states.csv
  std::vector<MissingFile> missing_;
  KeptFrames kept_;
  std::unique_ptr<LogImages> images_;
  std::vector<Stamp> stamps_;
  PictureCoder coder_;
};

/// The document's {"cameras", "playback"} of all moments: the page asks for each at `source`, beside it.
nlohmann::ordered_json servedMoments(const RunMoments& moments, const std::string& source);

/// The same of a handful of keyframes, with their messages in it: at most `most_bytes` of pictures. Null
/// without images.
nlohmann::ordered_json embeddedMoments(RunMoments& moments, std::size_t most_bytes);

}  // namespace swiftlet
