#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "firmware_host/lab/calibrate/board/grid_search.hpp"
#include "firmware_host/lab/calibrate/board/homography.hpp"
#include "firmware_host/lab/calibrate/board/saddle.hpp"

namespace swiftlet {
namespace {

constexpr double kBorder = 0.2;     ///< of a tag's edge
constexpr double kWindow = 0.65;    ///< of the distance to the next edge, which blur widens
constexpr double kLeastRadius = 2;  ///< px
constexpr double kMostRadius = 6;   ///< px; beyond it a lens bends edges and the time grows
constexpr double kSearch = 0.1;     ///< of a tag's edge, around a prediction: half the way to the next cell
constexpr double kMostSearch = 8;   ///< px
constexpr double kLeastEdge = 8;    ///< px; below it a cell of a tag is less than a pixel
constexpr double kLeastAgreement = 0.7;  ///< correlation of cells and code; two codes have at most 0.4

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Interpolated grey value; `at` must be inside the image.
double sample(const ImageView& image, const Eigen::Vector2d& at) {
  const double x = std::clamp(at.x(), 0.0, image.width - 1.001);
  const double y = std::clamp(at.y(), 0.0, image.height - 1.001);
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const double right = x - column;
  const double down = y - row;
  const std::uint8_t* upper = image.row(row) + column;
  const std::uint8_t* lower = image.row(row + 1) + column;
  return (1 - down) * ((1 - right) * upper[0] + right * upper[1]) +
         down * ((1 - right) * lower[0] + right * lower[1]);
}

/// How well a point matches a crossing of this polarity: contrast between the darker and brighter areas
/// `reach` px away.
double crossing(const ImageView& image, const Eigen::Vector2d& at, const Eigen::Vector2d& dark,
                const Eigen::Vector2d& bright) {
  const double d1 = sample(image, at + dark);
  const double d2 = sample(image, at - dark);
  const double b1 = sample(image, at + bright);
  const double b2 = sample(image, at - bright);
  // The worst pair decides: at a plain edge, one pair of areas is equal.
  return std::min(b1, b2) - std::max(d1, d2);
}

/// The mean position of the best matches within `reach`.
Eigen::Vector2d searchCrossing(const ImageView& image, const SaddleGuess& guess, double reach) {
  const Eigen::Vector2d e1 = guess.edge1.normalized();
  const Eigen::Vector2d e2 = guess.edge2.normalized();
  const Eigen::Vector2d dark = (e1 + e2).normalized() * guess.radius;
  const Eigen::Vector2d bright = (e1 - e2).normalized() * guess.radius;
  const int half = static_cast<int>(std::ceil(reach));
  double best = -std::numeric_limits<double>::infinity();
  std::vector<std::pair<double, Eigen::Vector2d>> places;
  for (int dy = -half; dy <= half; ++dy) {
    for (int dx = -half; dx <= half; ++dx) {
      const Eigen::Vector2d at = guess.pixel + Eigen::Vector2d(dx, dy);
      places.emplace_back(crossing(image, at, dark, bright), at);
      best = std::max(best, places.back().first);
    }
  }
  if (!(best > 0)) return guess.pixel;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0;
  for (const auto& [score, at] : places) {
    const double above = score - 0.7 * best;
    if (above <= 0) continue;
    sum += above * at;
    weight += above;
  }
  return sum / weight;
}

}  // namespace

TagGridSearch::TagGridSearch(const CalibrationTarget& target) : target_(target) {
  for (int tag = 0; tag < target.columns * target.rows; ++tag) codes_.push_back(finder_.code(tag));
}

std::vector<int> TagGridSearch::around(int tag) const {
  std::vector<int> tags;
  const int column = tag % target_.columns;
  const int row = tag / target_.columns;
  for (int y = std::max(0, row - 1); y <= std::min(target_.rows - 1, row + 1); ++y) {
    for (int x = std::max(0, column - 1); x <= std::min(target_.columns - 1, column + 1); ++x) {
      if (x != column || y != row) tags.push_back(target_.columns * y + x);
    }
  }
  return tags;
}

bool TagGridSearch::hasCode(const ImageView& image, int tag, const Quad& quad) const {
  std::array<PointPair, 4> pairs;
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d corner = (target_.corner(static_cast<int>(k))).head<2>() / target_.size;
    pairs[k] = {corner, quad[k]};
  }
  Eigen::Matrix3d H;
  if (!fitHomography(pairs, H)) return false;
  TagFinder::Code grey;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      double sum = 0;
      for (const double dy : {-0.02, 0.02}) {
        for (const double dx : {-0.02, 0.02}) {
          const Eigen::Vector2d cell(kBorder + 0.1 * (column + 0.5) + dx,
                                     1 - kBorder - 0.1 * (row + 0.5) + dy);
          sum += sample(image, mapPoint(H, cell));
        }
      }
      grey[6 * row + column] = sum;
    }
  }
  const TagFinder::Code& code = codes_[static_cast<std::size_t>(tag)];
  const TagFinder::Code a = grey.array() - grey.mean();
  const TagFinder::Code b = code.array() - code.mean();
  return a.dot(b) > kLeastAgreement * a.norm() * b.norm();
}

bool TagGridSearch::take(const ImageView& image, int tag, const Quad& predicted) {
  Quad quad = predicted;
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d edge1 = predicted[(k + 1) % 4] - predicted[k];
    const Eigen::Vector2d edge2 = predicted[(k + 3) % 4] - predicted[k];
    const double longest = std::max(edge1.norm(), edge2.norm());
    // Of the parallelogram at this corner.
    const double height = std::abs(cross(edge1, edge2)) / std::max(longest, 1e-9);
    if (!(height > kLeastEdge) || longest > std::max(image.width, image.height)) return false;
    SaddleGuess guess;
    guess.edge1 = edge1;
    guess.edge2 = edge2;
    guess.pixel = predicted[k];
    guess.radius = std::clamp(kWindow * height * std::min(kBorder, target_.gap), kLeastRadius, kMostRadius);
    const double reach = std::clamp(kSearch * height, 1.0, kMostSearch);
    guess.pixel = searchCrossing(image, guess, reach);
    Saddle saddle;
    if (!refineSaddle(image, guess, saddle)) return false;
    if ((saddle.pixel - predicted[k]).norm() > 2 * reach) return false;
    quad[k] = saddle.pixel;
  }
  if (!hasCode(image, tag, quad)) return false;
  taken_[static_cast<std::size_t>(tag)] = quad;
  return true;
}

bool TagGridSearch::predict(int from, int tag, Quad& quad) const {
  std::vector<PointPair> pairs;
  const auto add = [&](int known) {
    const auto& corners = taken_[static_cast<std::size_t>(known)];
    if (!corners) return;
    for (std::size_t k = 0; k < 4; ++k) {
      pairs.push_back({target_.corner(4 * known + static_cast<int>(k)).head<2>(), (*corners)[k]});
    }
  };
  add(from);
  // Tags adjacent to both are nearest to the prediction.
  const std::vector<int> beside = around(tag);
  for (const int known : beside) {
    if (known != from) add(known);
  }
  Eigen::Matrix3d H;
  if (!fitHomography(pairs, H)) return false;
  for (std::size_t k = 0; k < 4; ++k) {
    quad[k] = mapPoint(H, target_.corner(4 * tag + static_cast<int>(k)).head<2>());
    if (!quad[k].allFinite()) return false;
  }
  return true;
}

void TagGridSearch::follow(const ImageView& image, int tag) {
  std::vector<int> open = {tag};
  for (std::size_t next = 0; next < open.size(); ++next) {
    for (const int other : around(open[next])) {
      Quad quad;
      if (taken_[static_cast<std::size_t>(other)] || !predict(open[next], other, quad)) continue;
      if (take(image, other, quad)) open.push_back(other);
    }
  }
}

void TagGridSearch::keepLargest() {
  std::vector<bool> seen(taken_.size(), false);
  std::vector<int> largest;
  for (std::size_t first = 0; first < taken_.size(); ++first) {
    if (!taken_[first] || seen[first]) continue;
    std::vector<int> part = {static_cast<int>(first)};
    seen[first] = true;
    for (std::size_t next = 0; next < part.size(); ++next) {
      for (const int other : around(part[next])) {
        const auto index = static_cast<std::size_t>(other);
        Quad quad;
        if (!taken_[index] || seen[index] || !predict(part[next], other, quad)) continue;
        // If an image shows two boards only one is followed, because their parts do not predict each other.
        const double edge = (quad[0] - quad[2]).norm();
        bool agrees = true;
        for (std::size_t k = 0; k < 4; ++k) {
          agrees = agrees && (quad[k] - (*taken_[index])[k]).norm() < 3 * kSearch * edge;
        }
        if (!agrees) continue;
        seen[index] = true;
        part.push_back(other);
      }
    }
    if (part.size() > largest.size()) largest = part;
  }
  std::vector<bool> kept(taken_.size(), false);
  for (const int tag : largest) kept[static_cast<std::size_t>(tag)] = true;
  for (std::size_t tag = 0; tag < taken_.size(); ++tag) {
    if (!kept[tag]) taken_[tag].reset();
  }
}

std::vector<BoardCorner> TagGridSearch::find(const ImageView& image, bool enlarged) {
  for (const bool twice : {false, true}) {
    if (twice && !enlarged) break;
    taken_.assign(codes_.size(), std::nullopt);
    bool any = false;
    for (const FoundTag& tag : finder_.find(image, twice)) {
      const auto index = static_cast<std::size_t>(tag.id);
      if (index >= taken_.size() || taken_[index] || !take(image, tag.id, tag.corners)) continue;
      follow(image, tag.id);
      any = true;
    }
    if (any) break;
  }
  keepLargest();
  std::vector<BoardCorner> corners;
  for (std::size_t tag = 0; tag < taken_.size(); ++tag) {
    if (!taken_[tag]) continue;
    for (std::size_t k = 0; k < 4; ++k) {
      corners.push_back({static_cast<int>(4 * tag + k), (*taken_[tag])[k]});
    }
  }
  return corners;
}

}  // namespace swiftlet
