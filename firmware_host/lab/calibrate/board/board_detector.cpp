#include "firmware_host/lab/calibrate/board/board_detector.hpp"

#include <algorithm>

#include "firmware_host/lab/calibrate/board/grid_search.hpp"

namespace swiftlet {

class BoardDetector::Search {
 public:
  Search(const CalibrationTarget& target, Effort effort) : effort_(effort), target_(target) {
    if (target.hasTags()) grid_ = std::make_unique<TagGridSearch>(target);
  }

  std::vector<BoardCorner> detect(const ImageView& image) {
    if (image.empty() || std::min(image.width, image.height) < kSmallestImage) return {};
    return grid_ ? grid_->find(image, effort_ == Effort::kFull) : findCheckerboard(image, target_);
  }

 private:
  static constexpr int kSmallestImage = 32;  ///< px

  Effort effort_;
  CalibrationTarget target_;
  std::unique_ptr<TagGridSearch> grid_;
};

BoardDetector::BoardDetector(const CalibrationTarget& target, Effort effort)
    : search_(std::make_unique<Search>(target, effort)) {}

BoardDetector::~BoardDetector() = default;

std::vector<BoardCorner> BoardDetector::detect(const ImageView& image) { return search_->detect(image); }

}  // namespace swiftlet
