#include "mesher/delaunay.hpp"

#include <algorithm>
#include <utility>

namespace swiftlet {
namespace {

/// Cells a side of the grid whose order along the Hilbert curve build() follows; a power of two. 256 cells:
/// about one point in each, with the features of one image.
constexpr std::uint32_t kCurveSide = 16;

/// Number of the cell x, y along the Hilbert curve.
constexpr std::uint32_t hilbertIndex(std::uint32_t x, std::uint32_t y) {
  std::uint32_t index = 0;
  for (std::uint32_t side = kCurveSide / 2; side > 0; side /= 2) {
    const std::uint32_t right = (x & side) != 0 ? 1 : 0;
    const std::uint32_t up = (y & side) != 0 ? 1 : 0;
    index += side * side * ((3 * right) ^ up);
    if (up == 0) {  // turn the quadrant so that its curve begins where the one before ended
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

constexpr std::uint32_t next(std::uint32_t i) { return i == 2 ? 0 : i + 1; }
constexpr std::uint32_t previous(std::uint32_t i) { return i == 0 ? 2 : i - 1; }

constexpr std::uint16_t edgeOf(std::uint32_t cell, std::uint32_t edge) {
  return static_cast<std::uint16_t>(4 * cell + edge);
}
constexpr std::uint16_t cellOf(std::uint16_t edge) { return edge / 4; }

}  // namespace

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
  for (std::size_t i = 0; i < valid; ++i) static_cast<void>(place(order_[i]));  // what it skips is counted
  if (points.size() > count) {
    return {StatusCode::kCapacityReached,
            "more points than a triangulation holds: the last ones are skipped"};
  }
  if (cell_count_ == 0) return {StatusCode::kDegenerate, "fewer than three points that are not on one line"};
  return okStatus();
}

Status Delaunay::insert(const Eigen::Vector2f& point) {
  if (point_count_ == kMaxDelaunayPoints) {
    ++skipped_.over_capacity;
    return {StatusCode::kCapacityReached, "the triangulation is full: the point is skipped"};
  }
  const auto index = static_cast<std::uint16_t>(point_count_++);
  if (!snapToGrid(point, point_[index])) {
    ++skipped_.invalid;
    return {StatusCode::kInvalidInput, "the point is not finite or out of range: it is skipped"};
  }
  collected_ = false;
  return place(index);
}

// Counting sort: stable, hence the lowest index of a duplicate point comes first.
void Delaunay::sortAlongCurve(std::size_t count) {
  if (count == 0) return;
  GridPoint low = point_[order_[0]];
  GridPoint high = low;
  for (std::size_t i = 1; i < count; ++i) {
    const GridPoint& p = point_[order_[i]];
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  // Cells per grid step as a fixed-point number: offset * scale < kCurveSide * 2^32 < 2^63.
  const auto scaleOf = [](std::int32_t from, std::int32_t to) {
    return (std::int64_t{kCurveSide} << 32U) / (std::int64_t{to} - from + 1);
  };
  const std::int64_t scale_x = scaleOf(low.x, high.x);
  const std::int64_t scale_y = scaleOf(low.y, high.y);
  // rank_ and line_ are not in use yet.
  std::array<std::uint16_t, kHilbert.size() + 1> start{};
  for (std::size_t i = 0; i < count; ++i) {
    const GridPoint& p = point_[order_[i]];
    const auto x = static_cast<std::size_t>(((std::int64_t{p.x} - low.x) * scale_x) >> 32U);
    const auto y = static_cast<std::size_t>(((std::int64_t{p.y} - low.y) * scale_y) >> 32U);
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

// Until three vertices span a triangle they are kept in their order on the line; then each is inserted.
Status Delaunay::placeOnLine(std::uint16_t index) {
  const GridPoint& p = point_[index];
  const auto before = [this](std::uint16_t i, const GridPoint& q) { return point_[i] < q; };
  const auto at =
      static_cast<std::size_t>(std::lower_bound(line_.begin(), line_.end(), p, before) - line_.begin());
  if (at < line_.size() && point_[line_[at]] == p) {
    return {StatusCode::kInvalidInput, "the point falls together with another: it is skipped"};
  }
  if (line_.size() >= 2 && orientation(point_[line_[0]], point_[line_[1]], p) != 0) {
    startWith(line_[0], line_[1], index);
    // Each lies beyond the one before, outside the hull: no walk is longer than two steps.
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
  cell_[0].vertex = {a, b, c};
  cell_[1].vertex = {b, a, kInfinite};
  cell_[2].vertex = {c, b, kInfinite};
  cell_[3].vertex = {a, c, kInfinite};
  cell_count_ = 4;
  for (std::uint32_t i = 0; i < 3; ++i) {
    join(edgeOf(0, i), edgeOf(1 + i, 0));
    // From a hull vertex to infinity and back: the next infinite cell counter-clockwise comes before this
    // one.
    join(edgeOf(1 + i, 2), edgeOf(1 + next(i), 1));
  }
  last_ = 0;
}

void Delaunay::join(std::uint16_t edge, std::uint16_t twin) {
  cell_[cellOf(edge)].twin[edge % 4U] = twin;
  cell_[cellOf(twin)].twin[twin % 4U] = edge;
}

Status Delaunay::placeInPlane(std::uint16_t index) {
  const GridPoint& p = point_[index];
  std::uint16_t cell = 0;
  if (!locate(p, cell)) return {StatusCode::kNumerical, "the walk to the point did not end: it is skipped"};
  if (isVertexOf(cell_[cell], p)) {
    return {StatusCode::kInvalidInput, "the point falls together with another: it is skipped"};
  }
  split(cell, index);
  flipAround(cell, index);
  last_ = cell;
  return okStatus();
}

// The triangle that p is in or on the border of, or an infinite one whose edge p is strictly outside of. No
// triangle is entered twice, for along the walk the power of p to the circumcircles falls; hence the limit.
bool Delaunay::locate(const GridPoint& p, std::uint16_t& cell) const {
  constexpr std::uint32_t kNoEdge = 3;
  std::uint16_t at = last_;
  if (isInfinite(cell_[at])) {
    const auto& vertex = cell_[at].vertex;
    const std::uint32_t infinite = vertex[0] == kInfinite ? 0 : vertex[1] == kInfinite ? 1 : 2;
    at = cellOf(cell_[at].twin[next(infinite)]);
  }
  std::uint32_t entered = kNoEdge;
  for (std::size_t steps = 0; steps <= cell_count_; ++steps) {
    const Cell& c = cell_[at];
    std::uint32_t leave = kNoEdge;
    for (std::uint32_t i = 0; i < 3 && leave == kNoEdge; ++i) {
      if (i != entered && orientation(point_[c.vertex[i]], point_[c.vertex[next(i)]], p) < 0) leave = i;
    }
    if (leave == kNoEdge) {
      cell = at;
      return true;
    }
    const std::uint16_t edge = c.twin[leave];
    at = cellOf(edge);
    entered = edge % 4U;
    if (isInfinite(cell_[at])) {
      cell = at;
      return true;
    }
  }
  return false;
}

bool Delaunay::isVertexOf(const Cell& cell, const GridPoint& p) const {
  return std::any_of(cell.vertex.begin(), cell.vertex.end(),
                     [&](std::uint16_t i) { return i != kInfinite && point_[i] == p; });
}

// Three triangles for one; p is the last vertex of each, as flips keep it. If p is on the edge opposite to
// it, that triangle is flat until flipAround() flips the edge, which it does as p is inside the circle
// beyond.
void Delaunay::split(std::uint16_t cell, std::uint16_t p) {
  const Cell old = cell_[cell];
  const std::array<std::uint16_t, 3> at = {cell, static_cast<std::uint16_t>(cell_count_),
                                           static_cast<std::uint16_t>(cell_count_ + 1)};
  cell_count_ += 2;
  for (std::uint32_t i = 0; i < 3; ++i) {
    cell_[at[i]].vertex = {old.vertex[i], old.vertex[next(i)], p};
    cell_[at[i]].twin[1] = edgeOf(at[next(i)], 2);
    cell_[at[i]].twin[2] = edgeOf(at[previous(i)], 1);
    join(edgeOf(at[i], 0), old.twin[i]);
  }
}

// Counter-clockwise around p, beginning at `cell`. Every flip gives p one more neighbour, every other step
// passes one of them, and p has no more neighbours than there are vertices (the infinite one included): hence
// the limit.
void Delaunay::flipAround(std::uint16_t cell, std::uint16_t p) {
  const std::uint16_t first = cell_[cell].vertex[0];
  for (std::size_t steps = 0; steps <= 2 * (vertex_count_ + 2); ++steps) {
    const Cell& c = cell_[cell];
    const std::uint16_t twin = c.twin[0];
    const std::uint16_t beyond = cell_[cellOf(twin)].vertex[previous(twin % 4U)];
    if (mustFlip(c.vertex[0], c.vertex[1], p, beyond)) {
      flip(cell, p);
      continue;
    }
    if (c.vertex[1] == first) return;
    cell = cellOf(c.twin[1]);
  }
}

// Of the triangles a, b, p and b, a, d: is the edge a b to be replaced by p d?
bool Delaunay::mustFlip(std::uint16_t a, std::uint16_t b, std::uint16_t p, std::uint16_t d) const {
  // Is the hull's edge b d (d a) seen from p? In line with p it is not: its ends stay on the hull.
  if (a == kInfinite) return orientation(point_[d], point_[b], point_[p]) > 0;
  if (b == kInfinite) return orientation(point_[a], point_[d], point_[p]) > 0;
  // p is inside the hull or, if the triangle is flat, on its edge.
  if (d == kInfinite) return orientation(point_[a], point_[b], point_[p]) == 0;
  const int side = inCircle(point_[a], point_[b], point_[p], point_[d]);
  if (side != 0) return side > 0;
  return std::max(point_[a], point_[b]) > std::max(point_[p], point_[d]);
}

// The edge opposite to p, from a to b, becomes the edge from p to the vertex d beyond.
void Delaunay::flip(std::uint16_t cell, std::uint16_t p) {
  Cell& c = cell_[cell];
  const std::uint16_t twin = c.twin[0];
  const std::uint16_t other = cellOf(twin);
  Cell& o = cell_[other];
  const std::uint32_t edge = twin % 4U;
  const std::uint16_t b = c.vertex[1];
  const std::uint16_t d = o.vertex[previous(edge)];
  const std::uint16_t a_d = o.twin[next(edge)];
  const std::uint16_t d_b = o.twin[previous(edge)];
  const std::uint16_t b_p = c.twin[1];
  c.vertex[1] = d;
  o.vertex = {d, b, p};
  join(edgeOf(cell, 0), a_d);
  join(edgeOf(other, 0), d_b);
  join(edgeOf(other, 1), b_p);
  join(edgeOf(cell, 1), edgeOf(other, 2));
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
  std::uint16_t infinite = 0;
  for (std::size_t i = 0; i < cell_count_; ++i) {
    const bool outside = isInfinite(cell_[i]);
    rank_[i] = outside ? DelaunayTriangle::kNoNeighbour : count++;
    if (outside) infinite = static_cast<std::uint16_t>(i);
  }
  triangles_.resize(count);
  for (std::size_t i = 0; i < cell_count_; ++i) {
    if (rank_[i] == DelaunayTriangle::kNoNeighbour) continue;
    DelaunayTriangle& triangle = triangles_[rank_[i]];
    triangle.vertex = cell_[i].vertex;
    for (std::size_t k = 0; k < 3; ++k) triangle.neighbour[k] = rank_[cellOf(cell_[i].twin[k])];
  }
  if (cell_count_ > 0) collectHull(infinite);
}

// Around the infinite vertex; the infinite cell of the hull's edge s e has it from e to s.
void Delaunay::collectHull(std::uint16_t infinite_cell) {
  std::uint16_t at = infinite_cell;
  for (std::size_t i = 0; i < vertex_count_; ++i) {
    const Cell& c = cell_[at];
    const std::uint32_t infinite = c.vertex[0] == kInfinite ? 0 : c.vertex[1] == kInfinite ? 1 : 2;
    static_cast<void>(hull_.tryPushBack(c.vertex[previous(infinite)]));
    at = cellOf(c.twin[infinite]);
    if (at == infinite_cell) return;
  }
}

}  // namespace swiftlet
