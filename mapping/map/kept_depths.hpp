#pragma once
// Depth images that were fused, kept to be fused again when it turns out where they really belong.
//
// Every third pixel of every third row: as fine as a voxel of 5 cm up to 7 m with a focal length of 430 px;
// more images in the same memory tell more than more pixels. 5 bytes a pixel kept: depth in 1/65535 of the
// range, sigma in steps of 4 %, grey, label. Full: of the kept frames the one goes that another is most like:
// nearest in place and view, the older of the two. Memory: all reserved at construction. Cost: a pass over
// the image and one over the frames. Not thread safe.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "estimator/messages/depth_image.hpp"
#include "mapping/depth/depth_buffer.hpp"

namespace swiftlet {

struct KeptFrame {
  std::uint64_t frame = 0;
  SE3 T_map_world;   ///< of the odometry's world at that frame
  SE3 T_world_body;  ///< as the odometry has it by now
  SE3 T_map_fused;   ///< body, where it was when the image was fused last
  bool fused = false;
  bool pending = false;     ///< to be fused again
  std::uint32_t since = 0;  ///< blocks born after this revision of the volume lack the image
  SE3 T_body_camera;
  PinholeIntrinsics camera;  ///< of the pixels kept
  float mean_depth = 0;      ///< m

  [[nodiscard]] SE3 T_map_body() const { return T_map_world * T_world_body; }
};

/// The deepest measurement of each square of a kept image [m]; 0: none.
struct DepthTiles {
  static constexpr int kSide = 8;  ///< kept pixels
  int columns = 0;
  int rows = 0;
  std::vector<float> deepest;  ///< row by row
};

class KeptDepths {
 public:
  /// `bytes`: of everything; none are kept where not even one image fits. `pixels`: of any image to come.
  KeptDepths(std::size_t bytes, std::size_t pixels, double most_range);

  [[nodiscard]] std::size_t capacity() const { return frames_.capacity(); }
  [[nodiscard]] std::size_t size() const { return frames_.size(); }
  [[nodiscard]] KeptFrame& frame(std::size_t i) { return frames_[i]; }
  [[nodiscard]] const KeptFrame& frame(std::size_t i) const { return frames_[i]; }
  [[nodiscard]] std::uint64_t given_up() const { return given_up_; }
  [[nodiscard]] std::size_t bytes() const;

  /// `about` gives poses and state; camera and depths are the image's. The place in which it is kept, kNone
  /// without room for any.
  std::size_t keep(const DepthImageView& image, const KeptFrame& about);
  /// The image kept at i, valid until the next call.
  DepthImageView read(std::size_t i);
  /// In `out`, whose memory is used again.
  void deepestOf(std::size_t i, DepthTiles& out) const;
  void clear() {
    frames_.clear();
    neighbour_.clear();
  }
  [[nodiscard]] std::size_t mostPixels() const { return pixels_; }

  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

 private:
  /// The frame that one was most like when either came.
  struct Neighbour {
    double distance = std::numeric_limits<double>::infinity();
    std::size_t at = kNone;
  };

  std::size_t place(const KeptFrame& newest);

  double most_range_;
  std::size_t pixels_;  ///< kept, of an image
  std::vector<KeptFrame> frames_;
  std::vector<Neighbour> neighbour_;
  std::vector<double> to_newest_;     ///< scratch
  std::vector<std::uint16_t> depth_;  ///< frame by frame, as the others
  std::vector<std::uint8_t> sigma_;
  std::vector<std::uint8_t> grey_;
  std::vector<std::uint8_t> labels_;
  std::vector<std::uint8_t> contents_;  ///< of each frame: grey values, labels, sigma
  DepthBuffer scratch_;
  std::uint64_t given_up_ = 0;
};

}  // namespace swiftlet
