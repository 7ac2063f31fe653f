// Every triangulation is checked for what defines it: no point inside a circumcircle (exactly, with every
// point), Euler's formula, the area and the vertices of the convex hull, neighbours. On small sets the
// triangles are those of a brute-force search, ties included.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "estimator/core/random.hpp"
#include "mesher/delaunay.hpp"

using namespace swiftlet;  // NOLINT(google-build-using-namespace)

namespace {

using Points = std::vector<Eigen::Vector2f>;
using Triple = std::array<std::uint16_t, 3>;
constexpr auto kNone = DelaunayTriangle::kNoNeighbour;

std::vector<GridPoint> snapped(const Points& points) {
  std::vector<GridPoint> grid(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) snapToGrid(points[i], grid[i]);
  return grid;
}

/// As a key of sets.
using Position = std::pair<double, double>;
Position positionOf(const GridPoint& p) { return {p.x, p.y}; }

/// Indices of the points that are to be vertices: valid, and of equal ones the first.
std::vector<std::uint16_t> distinct(const Points& points) {
  std::set<Position> seen;
  std::vector<std::uint16_t> indices;
  for (std::size_t i = 0; i < points.size(); ++i) {
    GridPoint p;
    if (snapToGrid(points[i], p) && seen.insert(positionOf(p)).second)
      indices.push_back(static_cast<std::uint16_t>(i));
  }
  return indices;
}

/// Andrew's monotone chain, with the points inside the sides; empty if all are on one line.
std::vector<std::uint16_t> hullOracle(const std::vector<GridPoint>& grid,
                                      std::vector<std::uint16_t> indices) {
  std::sort(indices.begin(), indices.end(), [&](auto a, auto b) { return isBefore(grid[a], grid[b]); });
  std::vector<std::uint16_t> lower;
  std::vector<std::uint16_t> upper;
  const auto add = [&](std::vector<std::uint16_t>& chain, std::uint16_t i) {
    while (chain.size() >= 2 && orientation(grid[chain[chain.size() - 2]], grid[chain.back()], grid[i]) < 0) {
      chain.pop_back();
    }
    chain.push_back(i);
  };
  for (auto i = indices.begin(); i != indices.end(); ++i) add(lower, *i);
  for (auto i = indices.rbegin(); i != indices.rend(); ++i) add(upper, *i);
  if (lower.size() == indices.size() && upper.size() == indices.size()) return {};
  lower.insert(lower.end(), upper.begin() + 1, upper.end() - 1);
  return lower;
}

std::set<Triple> tripleSet(Delaunay& delaunay) {
  std::set<Triple> triples;
  for (const DelaunayTriangle& t : delaunay.triangles()) {
    Triple v = t.vertex;
    std::sort(v.begin(), v.end());
    triples.insert(v);
  }
  return triples;
}

/// The first thing that is wrong with the triangles and their neighbours, or nothing.
std::string faultOfTriangles(const std::vector<GridPoint>& grid, const std::vector<std::uint16_t>& vertices,
                             std::span<const DelaunayTriangle> triangles, std::size_t hull_size) {
  std::set<std::uint16_t> used;
  std::size_t open_edges = 0;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const auto& [v, neighbour] = triangles[i];
    for (const std::uint16_t k : v) {
      if (!std::binary_search(vertices.begin(), vertices.end(), k)) return "a vertex that is none";
      used.insert(k);
    }
    if (orientation(grid[v[0]], grid[v[1]], grid[v[2]]) <= 0) return "a flat or clockwise triangle";
    for (const std::uint16_t k : vertices) {
      if (inCircle(grid[v[0]], grid[v[1]], grid[v[2]], grid[k]) > 0) return "a point in a circumcircle";
    }
    for (std::size_t k = 0; k < 3; ++k) {
      if (neighbour[k] == kNone) {
        ++open_edges;
        continue;
      }
      if (neighbour[k] >= triangles.size()) return "a neighbour that is none";
      const DelaunayTriangle& other = triangles[neighbour[k]];
      bool mutual = false;
      for (std::size_t e = 0; e < 3; ++e) {
        mutual = mutual || (other.neighbour[e] == i && other.vertex[e] == v[(k + 1) % 3] &&
                            other.vertex[(e + 1) % 3] == v[k]);
      }
      if (!mutual) return "a neighbour that does not know its neighbour";
    }
  }
  if (used.size() != vertices.size()) return "a point that is in no triangle";
  if (open_edges != hull_size) return "the hull is not what the open edges are";
  if (triangles.size() != 2 * vertices.size() - 2 - hull_size) return "Euler's formula";
  return {};
}

std::string faultOf(const Points& points, Delaunay& delaunay) {
  const std::vector<GridPoint> grid = snapped(points);
  const std::vector<std::uint16_t> vertices = distinct(points);
  const auto triangles = delaunay.triangles();
  const auto hull = delaunay.hull();
  if (vertices.size() + delaunay.skipped().total() != points.size()) return "number of skipped points";
  std::vector<std::uint16_t> expected = hullOracle(grid, vertices);
  if (hull.size() != expected.size()) return "number of the hull's vertices";
  if (expected.empty()) return triangles.empty() ? "" : "triangles of points on one line";
  const auto first = std::find(expected.begin(), expected.end(), hull[0]);
  std::rotate(expected.begin(), first, expected.end());
  if (!std::equal(hull.begin(), hull.end(), expected.begin())) return "the hull";

  const auto area_of = [&](std::size_t a, std::size_t b, std::size_t c) {
    return static_cast<std::int64_t>(orientation(grid[a], grid[b], grid[c]));
  };
  std::int64_t hull_area = 0;
  for (std::size_t i = 1; i + 1 < hull.size(); ++i) hull_area += area_of(hull[0], hull[i], hull[i + 1]);
  std::int64_t area = 0;
  for (const DelaunayTriangle& t : triangles) area += area_of(t.vertex[0], t.vertex[1], t.vertex[2]);
  if (area != hull_area) return "the area is not the hull's";
  return faultOfTriangles(grid, vertices, triangles, hull.size());
}

/// Builds, checks, and returns the triangulation for more.
Delaunay& built(const Points& points) {
  static const auto kDelaunay = std::make_unique<Delaunay>();
  const Status status = kDelaunay->build(points);
  const std::string fault = faultOf(points, *kDelaunay);
  if (!fault.empty()) {
    for (const Eigen::Vector2f& p : points) UNSCOPED_INFO(p.transpose());
    FAIL_CHECK(fault);
  }
  if (status.ok() == kDelaunay->triangles().empty()) FAIL_CHECK("status without triangles: " << status.what);
  return *kDelaunay;
}

float pick(Random& random, double low, double high) { return static_cast<float>(random.uniform(low, high)); }

Points uniform(Random& random, std::size_t count) {
  Points points(count);
  for (auto& p : points) p = {pick(random, 0, 752), pick(random, 0, 480)};
  return points;
}

/// Whole pixels below `side`: many duplicates, collinear and cocircular ones.
Points wholePixels(Random& random, std::size_t count, std::uint32_t side) {
  Points points(count);
  for (auto& p : points) p = {static_cast<float>(random.below(side)), static_cast<float>(random.below(side))};
  return points;
}

void shuffle(Random& random, Points& points) {
  for (std::size_t i = points.size(); i > 1; --i) {
    std::swap(points[i - 1], points[random.below(static_cast<std::uint32_t>(i))]);
  }
}

/// All triangles whose circumcircle is empty when the squared lengths are perturbed as the header says: by
/// amounts of which each outweighs all smaller ones, in the order of the points.
std::set<Triple> bruteForce(const Points& points, std::uint32_t side) {
  using Wide = __int128;
  std::vector<std::uint16_t> order = distinct(points);
  const auto x = [&](std::size_t i) { return static_cast<std::int64_t>(points[order[i]].x()); };
  const auto y = [&](std::size_t i) { return static_cast<std::int64_t>(points[order[i]].y()); };
  std::sort(order.begin(), order.end(), [&](auto a, auto b) {
    return std::pair(points[a].x(), points[a].y()) < std::pair(points[b].x(), points[b].y());
  });
  // Above twice any sum of three minors, each at most 2 side^2.
  const Wide base = Wide{16} * side * side;
  std::vector<Wide> lifted(order.size());
  Wide unit = 1;
  for (auto& l : lifted) l = (unit *= base);
  unit *= base;
  for (std::size_t i = 0; i < order.size(); ++i) lifted[i] += unit * (x(i) * x(i) + y(i) * y(i));

  std::set<Triple> triples;
  const std::size_t n = order.size();
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a + 1; b < n; ++b) {
      for (std::size_t c = b + 1; c < n; ++c) {
        const std::int64_t turn = (x(b) - x(a)) * (y(c) - y(a)) - (y(b) - y(a)) * (x(c) - x(a));
        bool empty = turn != 0;
        for (std::size_t d = 0; d < n && empty; ++d) {
          if (d == a || d == b || d == c) continue;
          // Height of d over the plane through the lifted a, b, c, times the turn.
          const std::int64_t dx = x(d) - x(a);
          const std::int64_t dy = y(d) - y(a);
          const Wide height = (lifted[d] - lifted[a]) * turn -
                              (lifted[b] - lifted[a]) * (dx * (y(c) - y(a)) - dy * (x(c) - x(a))) -
                              (lifted[c] - lifted[a]) * ((x(b) - x(a)) * dy - (y(b) - y(a)) * dx);
          empty = (height > 0) == (turn > 0);
        }
        if (!empty) continue;
        Triple t = {order[a], order[b], order[c]};
        std::sort(t.begin(), t.end());
        triples.insert(t);
      }
    }
  }
  return triples;
}

}  // namespace

TEST_CASE("a square with its centre") {
  const Points points = {{0, 0}, {2, 0}, {2, 2}, {0, 2}, {1, 1}};
  Delaunay& delaunay = built(points);
  CHECK(delaunay.triangles().size() == 4);
  CHECK(delaunay.hull().size() == 4);
  // Without the centre the diagonal avoids the largest x, y: it joins points 1 and 3.
  Delaunay& square = built(Points(points.begin(), points.begin() + 4));
  CHECK(tripleSet(square) == std::set<Triple>{{0, 1, 3}, {1, 2, 3}});
}

TEST_CASE("too few points for a triangle") {
  for (const Points& points :
       {Points{}, Points{{1, 1}}, Points{{1, 1}, {2, 3}}, Points{{1, 1}, {1, 1}, {1, 1}, {2, 2}, {2, 2}},
        Points{{0, 0}, {3, 3}, {1, 1}, {2, 2}, {-5, -5}}, Points{{4, 1}, {4, 3}, {4, 1}, {4, -7}}}) {
    Delaunay& delaunay = built(points);
    CHECK(delaunay.triangles().empty());
    CHECK(delaunay.hull().empty());
    CHECK(delaunay.build(points).code == StatusCode::kDegenerate);
  }
}

TEST_CASE("small sets against brute force, with duplicates and ties") {
  Random random(1);
  for (int seed = 0; seed < 6000; ++seed) {
    const std::uint32_t side = 2 + random.below(6);
    const Points points = wholePixels(random, 3 + random.below(8), side);
    Delaunay& delaunay = built(points);
    const auto expected = bruteForce(points, side);
    if (tripleSet(delaunay) != expected) {
      for (const Eigen::Vector2f& p : points) UNSCOPED_INFO(p.transpose());
      REQUIRE(tripleSet(delaunay) == expected);
    }
  }
}

TEST_CASE("random points") {
  Random random(2);
  for (int seed = 0; seed < 1500; ++seed) built(uniform(random, 3 + random.below(60)));
  for (int seed = 0; seed < 20; ++seed) built(uniform(random, 300));
  built(uniform(random, kMaxDelaunayPoints));
}

TEST_CASE("whole pixels: collinear, cocircular and equal points by chance") {
  Random random(3);
  for (int seed = 0; seed < 1500; ++seed) {
    built(wholePixels(random, 3 + random.below(80), 2 + random.below(12)));
  }
}

TEST_CASE("grids in every order") {
  Random random(4);
  for (int seed = 0; seed < 200; ++seed) {
    const std::uint32_t columns = 2 + random.below(9);
    const std::uint32_t rows = 2 + random.below(9);
    const float pitch = seed % 2 == 0 ? 1.0F : 37.25F;
    Points points;
    for (std::uint32_t r = 0; r < rows; ++r) {
      for (std::uint32_t c = 0; c < columns; ++c) {
        points.emplace_back(pitch * static_cast<float>(c), pitch * static_cast<float>(r));
      }
    }
    shuffle(random, points);
    Delaunay& delaunay = built(points);
    CHECK(delaunay.triangles().size() == 2 * (columns - 1) * (rows - 1));
    CHECK(delaunay.hull().size() == 2 * (columns + rows) - 4);
  }
}

TEST_CASE("points on a circle, exactly and nearly") {
  Random random(5);
  // 5525^2 is a sum of two squares in many ways: 5525 = 5^2 * 13 * 17.
  Points circle;
  for (int x = -5525; x <= 5525; ++x) {
    const int y = static_cast<int>(std::lround(std::sqrt(5525.0 * 5525.0 - static_cast<double>(x) * x)));
    if (x * x + y * y != 5525 * 5525) continue;
    circle.emplace_back(static_cast<float>(x), static_cast<float>(y));
    if (y != 0) circle.emplace_back(static_cast<float>(x), static_cast<float>(-y));
  }
  REQUIRE(circle.size() > 60);
  for (int seed = 0; seed < 50; ++seed) {
    shuffle(random, circle);
    CHECK(built(circle).triangles().size() == circle.size() - 2);
    Points with_centre = circle;
    with_centre.insert(with_centre.begin() + seed, Eigen::Vector2f(0, 0));
    CHECK(built(with_centre).triangles().size() == circle.size());
    Points nearly(5 + random.below(100));
    for (auto& p : nearly) {
      const double angle = random.uniform(0, 2 * std::numbers::pi);
      p = {static_cast<float>(376 + 200 * std::cos(angle)), static_cast<float>(240 + 200 * std::sin(angle))};
    }
    built(nearly);
  }
}

TEST_CASE("lines, and lines with points beside them") {
  Random random(6);
  for (int seed = 0; seed < 600; ++seed) {
    const auto dx = static_cast<float>(random.below(5));
    const auto dy = static_cast<float>(random.below(5)) - 2;
    Points points(3 + random.below(40));
    for (auto& p : points) {
      const auto k = static_cast<float>(random.below(50));
      p = {100 + k * dx, 100 + k * dy};
    }
    CHECK(built(points).triangles().empty());
    // One grid step off the line; then a point far off; at any place of the order.
    const auto at = static_cast<std::ptrdiff_t>(random.below(static_cast<std::uint32_t>(points.size())));
    Points bent = points;
    bent.insert(bent.begin() + at, Eigen::Vector2f(points[0] + Eigen::Vector2f(0, 0x1p-12F)));
    bent.push_back(points[1] + Eigen::Vector2f(0x1p-12F, 0));
    built(bent);
    points.insert(points.begin() + at, Eigen::Vector2f(-700, 90));
    built(points);
  }
}

TEST_CASE("tiny clusters beside far points") {
  Random random(7);
  for (int seed = 0; seed < 600; ++seed) {
    Points points = {{8192, 8192}, {-8192, 8192}, {-8192, -8192}, {8192, -8192}};
    const Eigen::Vector2f centre(pick(random, -800, 800), pick(random, -800, 800));
    for (std::uint32_t i = 0; i < 5 + random.below(40); ++i) {
      const double scale = std::exp2(-static_cast<double>(random.below(16)));
      points.emplace_back(centre + Eigen::Vector2f(pick(random, -scale, scale), pick(random, -scale, scale)));
    }
    for (std::uint32_t i = 0; i < random.below(10); ++i) {
      points.emplace_back(pick(random, -8192, 8192), pick(random, -8192, 8192));
    }
    shuffle(random, points);
    built(points);
  }
}

TEST_CASE("the set of triangles does not depend on the order of the points") {
  Random random(8);
  for (int seed = 0; seed < 600; ++seed) {
    const Points points = seed % 2 == 0 ? uniform(random, 3 + random.below(60))
                                        : wholePixels(random, 3 + random.below(60), 3 + random.below(10));
    const auto positions = [](const Points& of, Delaunay& delaunay) {
      std::set<std::array<Position, 3>> set;
      const std::vector<GridPoint> grid = snapped(of);
      for (const DelaunayTriangle& t : delaunay.triangles()) {
        std::array<Position, 3> p = {positionOf(grid[t.vertex[0]]), positionOf(grid[t.vertex[1]]),
                                     positionOf(grid[t.vertex[2]])};
        std::sort(p.begin(), p.end());
        set.insert(p);
      }
      return set;
    };
    const auto expected = positions(points, built(points));
    Points shuffled = points;
    shuffle(random, shuffled);
    CHECK(positions(shuffled, built(shuffled)) == expected);
  }
}

TEST_CASE("the same input gives the same list") {
  Random random(9);
  const Points points = wholePixels(random, 200, 30);
  const auto first = std::make_unique<Delaunay>();
  REQUIRE(first->build(uniform(random, 77)).ok());
  REQUIRE(first->build(points).ok());
  Delaunay& second = built(points);
  REQUIRE(first->triangles().size() == second.triangles().size());
  for (std::size_t i = 0; i < first->triangles().size(); ++i) {
    CHECK(first->triangles()[i].vertex == second.triangles()[i].vertex);
    CHECK(first->triangles()[i].neighbour == second.triangles()[i].neighbour);
  }
}

TEST_CASE("bad points are skipped and counted") {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Random random(10);
  for (int seed = 0; seed < 300; ++seed) {
    Points points = uniform(random, 3 + random.below(30));
    const std::array<Eigen::Vector2f, 5> bad = {
        Eigen::Vector2f{kNan, 3}, {3, -kInfinity}, {kNan, kNan}, {1e9F, 0}, {0, -8193}};
    std::uint32_t invalid = 0;
    for (std::uint32_t i = 0; i < random.below(20); ++i, ++invalid) points.push_back(bad[random.below(5)]);
    shuffle(random, points);
    CHECK(built(points).skipped().invalid == invalid);
  }
  Delaunay& delaunay = built({{0, 0}, {9, 0}, {9, 0}, {kNan, 0}, {0, 9}, {9, 0}, {0.00001F, 0}});
  CHECK(delaunay.skipped().invalid == 1);
  CHECK(delaunay.skipped().duplicate == 3);
  CHECK(tripleSet(delaunay) == std::set<Triple>{{0, 1, 4}});
}

TEST_CASE("more points than the capacity") {
  Random random(11);
  Points points = uniform(random, kMaxDelaunayPoints + 100);
  const auto delaunay = std::make_unique<Delaunay>();
  CHECK(delaunay->build(points).code == StatusCode::kCapacityReached);
  CHECK(delaunay->skipped().over_capacity == 100);
  points.resize(kMaxDelaunayPoints);
  static_cast<void>(delaunay->build(points));
  CHECK(delaunay->skipped().over_capacity == 0);
  CHECK(faultOf(points, *delaunay).empty());
  // The most triangles that there can be: a hull of three.
  Points most = {{-8000, -8000}, {8000, -8000}, {0, 8000}};
  const Points inside = uniform(random, kMaxDelaunayPoints - 3);
  most.insert(most.end(), inside.begin(), inside.end());
  Delaunay& full = built(most);
  CHECK(full.hull().size() == 3);
  CHECK(full.triangles().size() + 2 * full.skipped().duplicate == kMaxDelaunayTriangles);
}
