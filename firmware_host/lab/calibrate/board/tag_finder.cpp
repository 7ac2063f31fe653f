#include "firmware_host/lab/calibrate/board/tag_finder.hpp"

#include <apriltag/tag36h11.h>

#include <algorithm>
#include <cstddef>

namespace swiftlet {
namespace {

/// Wrong cells that are corrected: enough to find initial tags, with a tenth of the memory that two would
/// need.
constexpr int kCorrectedCells = 1;
constexpr int kCodeCells = 6;
constexpr int kBorderCells = 2;

/// Doubles width and height, linear between pixels: pixel x of the result is x / 2 - 1/4 of the image.
void enlarge(const ImageView& image, std::vector<std::uint8_t>& out) {
  const int width = 2 * image.width;
  out.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(2 * image.height));
  for (int y = 0; y < 2 * image.height; ++y) {
    const std::uint8_t* near = image.row(y / 2);
    const std::uint8_t* far = image.row(std::clamp(y / 2 + (y % 2 == 0 ? -1 : 1), 0, image.height - 1));
    std::uint8_t* to = out.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    for (int x = 0; x < image.width; ++x) {
      const int left = std::max(0, x - 1);
      const int right = std::min(image.width - 1, x + 1);
      const int here = 3 * near[x] + far[x];
      to[2 * x] = static_cast<std::uint8_t>((3 * here + 3 * near[left] + far[left] + 8) / 16);
      to[2 * x + 1] = static_cast<std::uint8_t>((3 * here + 3 * near[right] + far[right] + 8) / 16);
    }
  }
}

/// The brightest of each 3 x 3 pixels.
void widenWhite(const ImageView& image, std::vector<std::uint8_t>& out) {
  const auto width = static_cast<std::size_t>(image.width);
  out.resize(width * static_cast<std::size_t>(image.height));
  std::vector<std::uint8_t> columns(width);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* above = image.row(std::max(0, y - 1));
    const std::uint8_t* here = image.row(y);
    const std::uint8_t* below = image.row(std::min(image.height - 1, y + 1));
    for (std::size_t x = 0; x < width; ++x) columns[x] = std::max({above[x], here[x], below[x]});
    std::uint8_t* to = out.data() + static_cast<std::size_t>(y) * width;
    to[0] = std::max(columns[0], columns[1]);
    for (std::size_t x = 1; x + 1 < width; ++x)
      to[x] = std::max({columns[x - 1], columns[x], columns[x + 1]});
    to[width - 1] = std::max(columns[width - 2], columns[width - 1]);
  }
}

}  // namespace

TagFinder::TagFinder() : family_(tag36h11_create()), detector_(apriltag_detector_create()) {
  // The library's family has a border of one cell; this copy belongs to this finder alone.
  family_->width_at_border += 2;
  family_->total_width += 2;
  for (std::size_t bit = 0; bit < family_->nbits; ++bit) {
    ++family_->bit_x[bit];
    ++family_->bit_y[bit];
  }
  apriltag_detector_add_family_bits(detector_, family_, kCorrectedCells);
  detector_->quad_decimate = 1;
  detector_->nthreads = 1;
}

TagFinder::~TagFinder() {
  apriltag_detector_destroy(detector_);
  tag36h11_destroy(family_);
}

std::vector<FoundTag> TagFinder::find(const ImageView& image, bool twice) {
  ImageView source = image;
  if (twice) {
    enlarge(image, enlarged_);
    source = {enlarged_.data(), 2 * image.width, 2 * image.height, 2 * image.width};
  }
  widenWhite(source, widened_);
  image_u8_t input{source.width, source.height, source.width, widened_.data()};
  zarray_t* detections = apriltag_detector_detect(detector_, &input);
  std::vector<FoundTag> tags;
  for (int i = 0; i < zarray_size(detections); ++i) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(detections, i, static_cast<void*>(&detection));
    FoundTag tag;
    tag.id = detection->id;
    const double scale = twice ? 0.5 : 1;
    std::array<Eigen::Vector2d, 4> narrow;
    for (std::size_t k = 0; k < 4; ++k) narrow[k] = {detection->p[k][0], detection->p[k][1]};
    for (std::size_t k = 0; k < 4; ++k) {
      // Widening white moved each edge inward by one pixel. The library's pixel (0,0) begins at 0.
      const Eigen::Vector2d outward = (narrow[k] - narrow[(k + 1) % 4]).stableNormalized() +
                                      (narrow[k] - narrow[(k + 3) % 4]).stableNormalized();
      tag.corners[k] = scale * (narrow[k] + outward) - Eigen::Vector2d::Constant(0.5);
    }
    tags.push_back(tag);
  }
  apriltag_detections_destroy(detections);
  std::stable_sort(tags.begin(), tags.end(),
                   [](const FoundTag& a, const FoundTag& b) { return a.id < b.id; });
  std::vector<FoundTag> single;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const bool again =
        (i > 0 && tags[i - 1].id == tags[i].id) || (i + 1 < tags.size() && tags[i + 1].id == tags[i].id);
    if (!again) single.push_back(tags[i]);
  }
  return single;
}

TagFinder::Code TagFinder::code(int id) const {
  Code cells;
  for (std::size_t bit = 0; bit < family_->nbits; ++bit) {
    const auto column = static_cast<int>(family_->bit_x[bit]) - kBorderCells;
    const auto row = static_cast<int>(family_->bit_y[bit]) - kBorderCells;
    const bool white = (family_->codes[id] >> (family_->nbits - 1 - bit)) & 1U;
    cells[kCodeCells * row + column] = white ? 1 : -1;
  }
  return cells;
}

}  // namespace swiftlet
