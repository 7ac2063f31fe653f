#include "mesher/delaunay.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace swiftlet {
namespace {

/// Side length of the grid, in cells, whose Hilbert curve determines the order of insertion in build(); a
/// power of two. 256 cells hold about one feature of an image each.
constexpr std::uint32_t kCurveSide = 16;

/// Number of the cell x, y along the Hilbert curve.
constexpr std::uint32_t hilbertIndex(std::uint32_t x, std::uint32_t y) {
  std::uint32_t index = 0;
  for (std::uint32_t side = kCurveSide / 2; side > 0; side /= 2) {
    const std::uint32_t right = (x & side) != 0 ? 1 : 0;
    const std::uint32_t up = (y & side) != 0 ? 1 : 0;
    index += side * side * ((3 * right) ^ up);
    if (up == 0) {  // rotate the quadrant so that its curve continues the previous one
      if (right == 1) {
        x = kCurveSide - 1 - x;
        y = kCurveSide - 1 - y;
      }
      std::swap(x, y);
    }
  }
  return index;
}

constexpr auto kHilbert = [] {
  std::array<std::uint8_t, kCurveSide * kCurveSide> table{};
  static_assert(table.size() <= 256);
  for (std::uint32_t y = 0; y < kCurveSide; ++y) {
    for (std::uint32_t x = 0; x < kCurveSide; ++x) {
      table[y * kCurveSide + x] = static_cast<std::uint8_t>(hilbertIndex(x, y));
    }
  }
  return table;
}();

}  // namespace

Delaunay::Delaunay() {
  constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();
  point_[kInfinite] = {kNotANumber, kNotANumber};
}

void Delaunay::clear() {
  point_count_ = 0;
  vertex_count_ = 0;
  skipped_ = {};
  cell_count_ = 0;
  line_.clear();
  collected_ = false;
}

Status Delaunay::build(std::span<const Eigen::Vector2f> points) {
  clear();
  const std::size_t count = std::min(points.size(), kMaxDelaunayPoints);
  std::size_t valid = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (snapToGrid(points[i], point_[i])) order_[valid++] = static_cast<std::uint16_t>(i);
  }
  point_count_ = count;
  skipped_.invalid = static_cast<std::uint32_t>(count - valid);
  skipped_.over_capacity = static_cast<std::uint32_t>(points.size() - count);
  sortAlongCurve(valid);
  for (std::size_t i = 0; i < valid; ++i) static_cast<void>(place(order_[i]));  // skipped points are counted
  if (points.size() > count) {
    return {StatusCode::kCapacityReached,
            "more points than the triangulation can hold: the last ones are skipped"};
  }
  if (cell_count_ == 0) return {StatusCode::kDegenerate, "fewer than three points that are not collinear"};
  return okStatus();
}

// Counting sort: stable, so the lowest index of coincident points comes first.
void Delaunay::sortAlongCurve(std::size_t count) {
  if (count == 0) return;
  GridPoint low = point_[order_[0]];
  GridPoint high = low;
  for (std::size_t i = 1; i < count; ++i) {
    const GridPoint& p = point_[order_[i]];
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  // Less than kCurveSide despite rounding, since the range is one step wider than the points.
  const double scale_x = kCurveSide / (high.x - low.x + 1);
  const double scale_y = kCurveSide / (high.y - low.y + 1);
  // rank_ and line_ are not in use yet and serve as scratch.
  std::array<std::uint16_t, kHilbert.size() + 1> start{};
  for (std::size_t i = 0; i < count; ++i) {
    const GridPoint& p = point_[order_[i]];
    const auto x = static_cast<std::uint32_t>((p.x - low.x) * scale_x);
    const auto y = static_cast<std::uint32_t>((p.y - low.y) * scale_y);
    rank_[i] = kHilbert[y * kCurveSide + x];
    ++start[rank_[i] + 1U];
  }
  for (std::size_t i = 1; i < start.size(); ++i)
    start[i] = static_cast<std::uint16_t>(start[i] + start[i - 1]);
  line_.resize(count);
  for (std::size_t i = 0; i < count; ++i) line_[start[rank_[i]]++] = order_[i];
  std::copy(line_.begin(), line_.end(), order_.begin());
  line_.clear();
}

Status Delaunay::place(std::uint16_t index) {
  const Status status = cell_count_ == 0 ? placeOnLine(index) : placeInPlane(index);
  if (status.ok()) {
    ++vertex_count_;
  } else {
    ++skipped_.duplicate;
  }
  return status;
}

// Until three vertices span a triangle, vertices are kept in their order on the line; then all are inserted.
Status Delaunay::placeOnLine(std::uint16_t index) {
  const GridPoint& p = point_[index];
  const auto before = [this](std::uint16_t i, const GridPoint& q) { return isBefore(point_[i], q); };
  const auto at =
      static_cast<std::size_t>(std::lower_bound(line_.begin(), line_.end(), p, before) - line_.begin());
  if (at < line_.size() && point_[line_[at]] == p) {
    return {StatusCode::kInvalidInput, "the point coincides with another: it is skipped"};
  }
  if (line_.size() >= 2 && orientation(point_[line_[0]], point_[line_[1]], p) != 0) {
    startWith(line_[0], line_[1], index);
    // Each point lies beyond the previous one, outside the hull: no walk is longer than two steps.
    for (std::size_t i = 2; i < line_.size(); ++i) static_cast<void>(placeInPlane(line_[i]));
    line_.clear();
    return okStatus();
  }
  line_.resize(line_.size() + 1);
  std::copy_backward(line_.begin() + at, line_.end() - 1, line_.end());
  line_[at] = index;
  return okStatus();
}

void Delaunay::startWith(std::uint16_t a, std::uint16_t b, std::uint16_t c) {
  if (orientation(point_[a], point_[b], point_[c]) < 0) std::swap(a, b);
  setVertices(0, a, b, c);
  setVertices(4, b, a, kInfinite);
  setVertices(8, c, b, kInfinite);
  setVertices(12, a, c, kInfinite);
  cell_count_ = 4;
  for (Edge side = 0; side < 3; ++side) {
    const auto beyond = static_cast<Edge>(4 + 4 * side);
    join(side, beyond);
    // Counter-clockwise along the hull: a cell's edge from infinity is the twin of the next infinite cell's
    // edge to infinity.
    join(static_cast<Edge>(beyond + 2), static_cast<Edge>(4 + 4 * nextOf(side) + 1));
  }
  last_ = 0;
}

Status Delaunay::placeInPlane(std::uint16_t index) {
  const GridPoint& p = point_[index];
  Edge cell = 0;
  if (!locate(p, cell))
    return {StatusCode::kNumerical, "the search for the point's triangle did not end: the point is skipped"};
  if (point_[origin_[cell]] == p || point_[origin_[cell + 1U]] == p || point_[origin_[cell + 2U]] == p) {
    return {StatusCode::kInvalidInput, "the point coincides with another: it is skipped"};
  }
  split(cell, index);
  flipAround(cell, index);
  last_ = cell;
  return okStatus();
}

// Finds the triangle that contains p (border included), or an infinite one whose edge p is strictly outside
// of. No triangle is entered twice, because the power of p with respect to the circumcircles decreases along
// the walk; hence the limit.
bool Delaunay::locate(const GridPoint& p, Edge& cell) const {
  const auto arm_to = [&](Edge edge) { return armOf(p, point_[origin_[edge]]); };
  const auto is_beyond = [](const GridArm& from, const GridArm& to) {
    return from.x * to.y - from.y * to.x < 0;
  };
  const Edge from_infinite = edgeFromInfinite(last_);
  Edge entered = from_infinite < last_ + 3 ? twin_[nextOf(from_infinite)] : last_;
  GridArm start = arm_to(entered);
  GridArm end = arm_to(nextOf(entered));
  if (is_beyond(start, end)) {
    entered = twin_[entered];
    std::swap(start, end);
  }
  for (std::size_t steps = 0; steps <= cell_count_; ++steps) {
    const Edge left = previousOf(entered);
    const GridArm apex = arm_to(left);
    if (is_beyond(end, apex)) {
      entered = twin_[nextOf(entered)];
      start = apex;
    } else if (is_beyond(apex, start)) {
      entered = twin_[left];
      end = apex;
    } else {
      cell = firstOf(entered);
      return true;
    }
  }
  return false;
}

// Replaces a triangle by three; p is the last vertex of each, and flips keep it so. If p is on the edge
// opposite to it, that triangle is flat until flipAround() flips the edge, which it does because p is inside
// the circle beyond.
void Delaunay::split(Edge cell, std::uint16_t p) {
  const auto second = static_cast<Edge>(4 * cell_count_);
  const auto third = static_cast<Edge>(second + 4);
  cell_count_ += 2;
  const std::uint16_t a = origin_[cell];
  const std::uint16_t b = origin_[cell + 1U];
  const std::uint16_t c = origin_[cell + 2U];
  join(second, twin_[cell + 1U]);
  join(third, twin_[cell + 2U]);
  setVertices(cell, a, b, p);
  setVertices(second, b, c, p);
  setVertices(third, c, a, p);
  const auto join_fan = [this](Edge right, Edge left) {
    join(static_cast<Edge>(right + 1), static_cast<Edge>(left + 2));
  };
  join_fan(cell, second);
  join_fan(second, third);
  join_fan(third, cell);
}

// Goes counter-clockwise around p, beginning at `cell`. Every flip gives p one more neighbour, every other
// step passes one, and p has no more neighbours than there are vertices (the infinite one included); hence
// the limit.
void Delaunay::flipAround(Edge cell, std::uint16_t p) {
  const GridPoint centre = point_[p];
  const std::uint16_t first = origin_[cell];
  // The edge a b is opposite to p, and d is the vertex beyond: b, a, d are counter-clockwise.
  GridArm a = armOf(centre, point_[first]);
  GridArm b = armOf(centre, point_[origin_[cell + 1U]]);
  for (std::size_t steps = 0; steps <= 2 * (vertex_count_ + 2); ++steps) {
    const std::uint16_t beyond = origin_[previousOf(twin_[cell])];
    const GridArm d = armOf(centre, point_[beyond]);
    const int side = inCircleByFilter(b, a, d);
    if (side > 0 || (side == 0 && mustFlipUndecided(cell, p, beyond))) {
      flip(cell, p);
      b = d;
      continue;
    }
    if (origin_[cell + 1U] == first) return;
    cell = firstOf(twin_[cell + 1U]);
    a = b;
    b = armOf(centre, point_[origin_[cell + 1U]]);
  }
}

// Whether to replace the edge from a to b, opposite to p, by the edge p d, with d beyond. Called if the
// filter cannot decide.
bool Delaunay::mustFlipUndecided(Edge edge, std::uint16_t p, std::uint16_t d) const {
  const std::uint16_t a = origin_[edge];
  const std::uint16_t b = origin_[nextOf(edge)];
  // Whether p sees the hull's edge b d (d a). If p is in line with it, it does not: the edge's ends stay on
  // the hull.
  if (a == kInfinite) return orientation(point_[d], point_[b], point_[p]) > 0;
  if (b == kInfinite) return orientation(point_[a], point_[d], point_[p]) > 0;
  // p is inside the hull or, if the triangle is flat, on its edge.
  if (d == kInfinite) return orientation(point_[a], point_[b], point_[p]) == 0;
  const int side = inCircle(point_[b], point_[a], point_[d], point_[p]);
  if (side != 0) return side > 0;
  // All on one circle: the diagonal avoids the last of the four points in their order.
  return isBefore(std::max(point_[p], point_[d], isBefore), std::max(point_[a], point_[b], isBefore));
}

// Replaces the edge opposite to p, from a to b, by the edge from p to the vertex d beyond.
void Delaunay::flip(Edge edge, std::uint16_t p) {
  const Edge twin = twin_[edge];
  const Edge other = firstOf(twin);
  const Edge a_d = twin_[nextOf(twin)];
  const Edge d_b = twin_[previousOf(twin)];
  const Edge b_p = twin_[edge + 1U];
  const std::uint16_t b = origin_[edge + 1U];
  const std::uint16_t d = origin_[previousOf(twin)];
  origin_[edge + 1U] = d;
  setVertices(other, d, b, p);
  join(edge, a_d);
  join(other, d_b);
  join(static_cast<Edge>(other + 1), b_p);
  join(static_cast<Edge>(edge + 1), static_cast<Edge>(other + 2));
}

std::span<const DelaunayTriangle> Delaunay::triangles() {
  collect();
  return {triangles_.data(), triangles_.size()};
}

std::span<const std::uint16_t> Delaunay::hull() {
  collect();
  return {hull_.data(), hull_.size()};
}

void Delaunay::collect() {
  if (collected_) return;
  collected_ = true;
  triangles_.clear();
  hull_.clear();
  std::uint16_t count = 0;
  Edge infinite_cell = 0;
  for (std::size_t i = 0; i < cell_count_; ++i) {
    const bool outside = std::max({origin_[4 * i], origin_[4 * i + 1], origin_[4 * i + 2]}) == kInfinite;
    rank_[i] = outside ? DelaunayTriangle::kNoNeighbour : count++;
    if (outside) infinite_cell = static_cast<Edge>(4 * i);
  }
  triangles_.resize(count);
  for (std::size_t i = 0; i < cell_count_; ++i) {
    if (rank_[i] == DelaunayTriangle::kNoNeighbour) continue;
    DelaunayTriangle& triangle = triangles_[rank_[i]];
    for (std::size_t k = 0; k < 3; ++k) {
      triangle.vertex[k] = origin_[4 * i + k];
      triangle.neighbour[k] = rank_[twin_[4 * i + k] / 4U];
    }
  }
  if (cell_count_ > 0) collectHull(edgeFromInfinite(infinite_cell));
}

// Goes around the infinite vertex. The infinite cell beyond the hull's edge from s to e is e, s, infinite;
// the next one is beyond its edge from infinity to e.
void Delaunay::collectHull(Edge from_infinite) {
  Edge at = from_infinite;
  for (std::size_t i = 0; i < vertex_count_; ++i) {
    static_cast<void>(hull_.tryPushBack(origin_[previousOf(at)]));
    at = nextOf(twin_[at]);
    if (at == from_infinite) return;
  }
}

}  // namespace swiftlet
