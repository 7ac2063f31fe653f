#pragma once
// The two searches of BoardDetector (board_detector.hpp). Private to this folder.

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/core/image_view.hpp"
#include "firmware_host/lab/calibrate/board/tag_finder.hpp"

namespace swiftlet {

class TagGridSearch {
 public:
  explicit TagGridSearch(const CalibrationTarget& target);

  /// `enlarged`: if the image shows no tag, also search it at twice its size.
  [[nodiscard]] std::vector<BoardCorner> find(const ImageView& image, bool enlarged);

 private:
  using Quad = std::array<Eigen::Vector2d, 4>;

  /// Refines a predicted tag and compares its cells with its code.
  bool take(const ImageView& image, int tag, const Quad& predicted);
  /// Takes all tags that can be reached from `tag`, which has been taken.
  void follow(const ImageView& image, int tag);
  [[nodiscard]] bool predict(int from, int tag, Quad& quad) const;
  [[nodiscard]] bool hasCode(const ImageView& image, int tag, const Quad& quad) const;
  [[nodiscard]] std::vector<int> around(int tag) const;
  /// Keeps only the largest connected part.
  void keepLargest();

  CalibrationTarget target_;
  TagFinder finder_;
  std::vector<TagFinder::Code> codes_;
  std::vector<std::optional<Quad>> taken_;
};

/// All inner corners, or none.
[[nodiscard]] std::vector<BoardCorner> findCheckerboard(const ImageView& image,
                                                        const CalibrationTarget& target);

}  // namespace swiftlet
