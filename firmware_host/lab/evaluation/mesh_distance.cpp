#include "firmware_host/lab/evaluation/mesh_distance.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace swiftlet {
namespace {

constexpr std::uint32_t kLeaf = 4;  ///< triangles; smaller nodes are not split
constexpr std::size_t kBins = 16;
// From this depth on a span is halved: at most 32 more halvings, for up to 2^32 triangles.
constexpr int kHalvingDepth = 24;
constexpr std::size_t kStack = kHalvingDepth + 32 + 2;
constexpr double kEdge = 1e-9;    ///< widening of a triangle for rays, in barycentric coordinates
constexpr double kTiny = 1e-300;  ///< replaces zero in a direction, so that no product is NaN

struct Waiting {
  std::uint32_t node;
  double bound;  ///< lower bound of the distance to the triangles below
};

/// Nodes still to be visited; the nearest is on top.
class Stack {
 public:
  void push(std::uint32_t node, double bound) { waiting_[size_++] = {node, bound}; }
  bool pop(Waiting& next) {
    if (size_ == 0) return false;
    next = waiting_[--size_];
    return true;
  }

 private:
  std::array<Waiting, kStack> waiting_;
  std::size_t size_ = 0;
};

}  // namespace

double MeshDistance::Box::halfArea() const {
  const Eigen::Array3d side = (high - low).max(0.0);
  return side.x() * side.y() + side.y() * side.z() + side.z() * side.x();
}

double MeshDistance::Box::squaredDistance(const Eigen::Array3d& p) const {
  return (low - p).max(p - high).max(0.0).matrix().squaredNorm();
}

MeshDistance::MeshDistance(const TriangleMesh& mesh) {
  std::vector<Item> items(mesh.faces.size());
  for (std::size_t i = 0; i < items.size(); ++i) {
    items[i].face = static_cast<std::uint32_t>(i);
    for (const std::uint32_t v : mesh.faces[i]) {
      const Eigen::Array3d p = mesh.vertices[v].cast<double>().array();
      items[i].box.add({p, p});
    }
    items[i].centre = 0.5 * (items[i].box.low + items[i].box.high);
  }
  build(items);
  triangles_.reserve(items.size());
  faces_.reserve(items.size());
  place_.resize(items.size());
  for (const Item& item : items) {
    const auto& face = mesh.faces[item.face];
    const Eigen::Vector3d a = mesh.vertices[face[0]].cast<double>();
    place_[item.face] = static_cast<std::uint32_t>(faces_.size());
    faces_.push_back(item.face);
    triangles_.push_back(
        {a, mesh.vertices[face[1]].cast<double>() - a, mesh.vertices[face[2]].cast<double>() - a});
  }
}

void MeshDistance::build(std::vector<Item>& items) {
  if (items.empty()) return;
  nodes_.reserve(items.size());
  nodes_.emplace_back();
  std::vector<Span> open = {{0, 0, static_cast<std::uint32_t>(items.size()), 0}};
  while (!open.empty()) {
    const Span span = open.back();
    open.pop_back();
    Box centres;
    Node node;
    for (std::uint32_t i = span.begin; i < span.end; ++i) {
      node.box.add(items[i].box);
      centres.add({items[i].centre, items[i].centre});
    }
    if (span.end - span.begin <= kLeaf) {
      node.first = span.begin;
      node.count = span.end - span.begin;
    } else {
      const std::uint32_t middle = split(items, span, centres);
      node.first = static_cast<std::uint32_t>(nodes_.size());
      nodes_.resize(nodes_.size() + 2);
      open.push_back({node.first, span.begin, middle, span.depth + 1});
      open.push_back({node.first + 1, middle, span.end, span.depth + 1});
    }
    nodes_[span.node] = node;
  }
}

std::uint32_t MeshDistance::split(std::vector<Item>& items, const Span& span, const Box& centres) {
  Eigen::Index axis = 0;
  const double width = (centres.high - centres.low).maxCoeff(&axis);
  const double low = centres.low[axis];
  const auto begin = items.begin() + span.begin;
  const auto end = items.begin() + span.end;
  const auto halve = [&] {
    const auto middle = begin + (end - begin) / 2;
    std::nth_element(begin, middle, end,
                     [axis](const Item& a, const Item& b) { return a.centre[axis] < b.centre[axis]; });
    return static_cast<std::uint32_t>(middle - items.begin());
  };
  if (span.depth >= kHalvingDepth || !(width > 0)) return halve();

  const auto bin_of = [&](const Item& item) {
    const double share = (item.centre[axis] - low) / width;
    return std::min(static_cast<std::size_t>(share * static_cast<double>(kBins)), kBins - 1);
  };
  std::array<Box, kBins> box;
  std::array<std::uint32_t, kBins> count{};
  for (auto item = begin; item != end; ++item) {
    box[bin_of(*item)].add(item->box);
    ++count[bin_of(*item)];
  }
  // cost_above[k]: cost of the bins from k on. The sweep from below then finds the cheapest split.
  std::array<double, kBins> cost_above{};
  Box swept;
  std::uint32_t number = 0;
  for (std::size_t k = kBins; k-- > 1;) {
    swept.add(box[k]);
    number += count[k];
    cost_above[k] = number > 0 ? number * swept.halfArea() : 0;
  }
  swept = Box();
  number = 0;
  double best = kAnyDistance;
  std::size_t border = 0;
  for (std::size_t k = 1; k < kBins; ++k) {
    swept.add(box[k - 1]);
    number += count[k - 1];
    if (number == 0 || number == span.end - span.begin) continue;
    const double cost = number * swept.halfArea() + cost_above[k];
    if (cost >= best) continue;
    best = cost;
    border = k;
  }
  if (border == 0) return halve();
  const auto middle = std::partition(begin, end, [&](const Item& item) { return bin_of(item) < border; });
  return static_cast<std::uint32_t>(middle - items.begin());
}

double MeshDistance::nearestOf(const Triangle& triangle, const Eigen::Vector3d& p) {
  const Eigen::Vector3d& ab = triangle.ab;
  const Eigen::Vector3d& ac = triangle.ac;
  const Eigen::Vector3d ap = p - triangle.a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return ap.squaredNorm();
  const Eigen::Vector3d bp = ap - ab;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return bp.squaredNorm();
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) return (ap - d1 / (d1 - d3) * ab).squaredNorm();
  const Eigen::Vector3d cp = ap - ac;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return cp.squaredNorm();
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) return (ap - d2 / (d2 - d6) * ac).squaredNorm();
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return (bp - w * (ac - ab)).squaredNorm();
  }
  const double sum = va + vb + vc;
  // A sliver whose area is lost to rounding.
  if (!(sum > 0)) return std::min({ap.squaredNorm(), bp.squaredNorm(), cp.squaredNorm()});
  return (ap - vb / sum * ab - vc / sum * ac).squaredNorm();
}

std::optional<MeshDistance::Answer> MeshDistance::nearest(const Eigen::Vector3d& p, double most) const {
  if (nodes_.empty()) return std::nullopt;
  double best = most * most;
  std::uint32_t found = 0;
  bool any = false;
  Stack stack;
  stack.push(0, nodes_[0].box.squaredDistance(p.array()));
  Waiting next{};
  while (stack.pop(next)) {
    if (next.bound > best) continue;
    const Node& node = nodes_[next.node];
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const double squared = nearestOf(triangles_[i], p);
      // A distance of exactly `most` counts, and of equal ones the first is kept.
      if (!(any ? squared < best : squared <= best)) continue;
      any = true;
      best = squared;
      found = faces_[i];
    }
    if (node.count > 0) continue;
    const double left = nodes_[node.first].box.squaredDistance(p.array());
    const double right = nodes_[node.first + 1].box.squaredDistance(p.array());
    const std::uint32_t nearer = left <= right ? 0 : 1;
    stack.push(node.first + 1 - nearer, std::max(left, right));
    stack.push(node.first + nearer, std::min(left, right));
  }
  if (!any) return std::nullopt;
  return Answer{std::sqrt(best), found};
}

std::optional<MeshDistance::Answer> MeshDistance::cast(const Eigen::Vector3d& origin,
                                                       const Eigen::Vector3d& direction, double most) const {
  if (nodes_.empty()) return std::nullopt;
  Eigen::Array3d inverse;
  for (int k = 0; k < 3; ++k) {
    inverse[k] = 1.0 / (std::abs(direction[k]) < kTiny ? kTiny : direction[k]);
  }
  // Distance at which the ray enters a box; larger than `most` if it misses the box.
  const auto entry = [&](const Box& box) {
    const Eigen::Array3d a = (box.low - origin.array()) * inverse;
    const Eigen::Array3d b = (box.high - origin.array()) * inverse;
    const double in = std::max(a.min(b).maxCoeff(), 0.0);
    const double out = a.max(b).minCoeff();
    // Tolerance, because rounding may lose the ray in a flat box.
    return in <= out * (1 + kEdge) + kEdge ? in : kAnyDistance;
  };
  double best = most;
  std::uint32_t found = 0;
  bool any = false;
  Stack stack;
  stack.push(0, entry(nodes_[0].box));
  Waiting next{};
  while (stack.pop(next)) {
    if (next.bound > best || next.bound == kAnyDistance) continue;
    const Node& node = nodes_[next.node];
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Triangle& t = triangles_[i];
      const Eigen::Vector3d across = direction.cross(t.ac);
      const double det = t.ab.dot(across);
      if (det == 0) continue;
      const Eigen::Vector3d from = origin - t.a;
      const double u = from.dot(across) / det;
      const Eigen::Vector3d along = from.cross(t.ab);
      const double v = direction.dot(along) / det;
      if (!(u >= -kEdge && v >= -kEdge && u + v <= 1 + kEdge)) continue;
      const double distance = t.ac.dot(along) / det;
      if (!(distance >= 0 && (any ? distance < best : distance <= best))) continue;
      any = true;
      best = distance;
      found = faces_[i];
    }
    if (node.count > 0) continue;
    const double left = entry(nodes_[node.first].box);
    const double right = entry(nodes_[node.first + 1].box);
    const std::uint32_t nearer = left <= right ? 0 : 1;
    stack.push(node.first + 1 - nearer, std::max(left, right));
    stack.push(node.first + nearer, std::min(left, right));
  }
  if (!any) return std::nullopt;
  return Answer{best, found};
}

Eigen::Vector3d MeshDistance::normal(std::uint32_t face) const {
  const Triangle& triangle = triangles_[place_[face]];
  return triangle.ab.cross(triangle.ac).stableNormalized();
}

}  // namespace swiftlet
