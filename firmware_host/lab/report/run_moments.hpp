#pragma once
// The moments of a run for pages: the pose, the cameras' images from the run's log, and the data of these
// images in the run folder (docs/report.md). A message has the form that the page's image panel takes
// (docs/view.md).
//
// The moments are the images of camera 0 or, without images, the poses of odometry.tum. Pixels are those of
// the raw images. Memory: that of LogImages and KeptFrames, and 40 bytes per moment. Cost of a message: one
// image decoded and encoded per camera, some 10 ms. One thread at a time.

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

/// Size limits of pictures.
struct PictureBounds {
  int most_width = 0;          ///< px
  std::size_t most_bytes = 0;  ///< of a picture as text; the quality is reduced until it fits
};

class RunMoments {
 public:
  /// `log`: empty: the log found by logOf(). If it cannot be read, missing() says so and there are no images.
  RunMoments(const RunFiles& files, const std::string& log);

  [[nodiscard]] std::size_t count() const { return stamps_.size(); }
  [[nodiscard]] bool hasImages() const { return images_ != nullptr; }
  /// What could not be read.
  [[nodiscard]] const std::vector<MissingFile>& missing() const { return missing_; }
  /// At most `most` keyframes, or moments if the run has no keyframes, spread over the run.
  [[nodiscard]] std::vector<std::size_t> spread(std::size_t most) const;

  /// The document's "cameras": [{"width", "height"}]; empty without images.
  [[nodiscard]] nlohmann::ordered_json camerasJson() const;
  /// The document's "playback" of the chosen moments: {"count", "t", "poses", "keyframes", "note"}.
  [[nodiscard]] nlohmann::ordered_json playbackJson(std::span<const std::size_t> moments) const;
  /// Message of one moment for the image panel; "scene" holds the data for the 3D view. `moment` is below
  /// count().
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
  std::vector<Stamp> keyframes_;  ///< from states.csv
  std::vector<MissingFile> missing_;
  KeptFrames kept_;
  std::unique_ptr<LogImages> images_;
  std::vector<Stamp> stamps_;
  PictureCoder coder_;
};

/// The document's {"cameras", "playback"} of all moments, which the page requests at the relative address
/// `source`.
nlohmann::ordered_json servedMoments(const RunMoments& moments, const std::string& source);

/// The same for a few keyframes, with their messages included: at most `most_bytes` of pictures. Null without
/// images.
nlohmann::ordered_json embeddedMoments(RunMoments& moments, std::size_t most_bytes);

}  // namespace swiftlet
