// Delaunay triangulation beside OpenCV's Subdiv2D in one process: the same points, from points to the list of
// triangles. CPU time of this thread; medians over repetitions in which both take turns.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>
#include <vector>

#include "estimator/core/random.hpp"
#include "mesher/delaunay.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;  // NOLINT(google-build-using-namespace)

namespace {

constexpr int kWidth = 752;
constexpr int kHeight = 480;
/// Every call has points that were not the last call's: a set given again and again is learnt by the
/// processor's prediction of branches, and both look a third faster than in flight.
constexpr int kSets = 40;
constexpr int kRepetitions = 100;

using Points = std::vector<Eigen::Vector2f>;

Points randomPoints(Random& random, int count) {
  Points points(static_cast<std::size_t>(count));
  for (auto& p : points) {
    p = {static_cast<float>(random.uniform(0, kWidth - 1)),
         static_cast<float>(random.uniform(0, kHeight - 1))};
  }
  return points;
}

/// Whole pixels, one in each cell of a grid, as a detector with a mask spreads its corners.
Points spreadPixels(Random& random, int count) {
  const int rows = static_cast<int>(std::lround(std::sqrt(count * static_cast<double>(kHeight) / kWidth)));
  const int columns = (count + rows - 1) / rows;
  Points points;
  for (int i = 0; i < count; ++i) {
    const double u = (i % columns + random.uniform(0.1, 0.9)) * kWidth / columns;
    const int row = i / columns;
    const double v = (row + random.uniform(0.1, 0.9)) * kHeight / rows;
    points.emplace_back(std::floor(static_cast<float>(u)), std::floor(static_cast<float>(v)));
  }
  for (std::size_t i = points.size(); i > 1; --i) {
    std::swap(points[i - 1], points[random.below(static_cast<std::uint32_t>(i))]);
  }
  return points;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

using Corners = std::array<std::pair<float, float>, 3>;

std::set<Corners> cornersOf(const Points& points, Delaunay& ours) {
  std::set<Corners> set;
  for (const DelaunayTriangle& t : ours.triangles()) {
    Corners c;
    for (std::size_t k = 0; k < 3; ++k) c[k] = {points[t.vertex[k]].x(), points[t.vertex[k]].y()};
    std::sort(c.begin(), c.end());
    set.insert(c);
  }
  return set;
}

template <typename Draw>
void compare(const char* name, int count, const Draw& draw) {
  Random random(1);
  const auto ours = std::make_unique<Delaunay>();
  cv::Subdiv2D theirs;
  std::vector<cv::Vec6f> list;
  std::vector<Points> sets(kSets);
  std::vector<std::vector<cv::Point2f>> cv_sets(kSets);
  for (std::size_t i = 0; i < kSets; ++i) {
    sets[i] = draw(random, count);
    for (const Eigen::Vector2f& p : sets[i]) cv_sets[i].emplace_back(p.x(), p.y());
  }
  std::size_t triangles = 0;
  std::vector<double> ours_us;
  std::vector<double> theirs_us;
  for (int repetition = 0; repetition < kRepetitions; ++repetition) {
    ours_us.push_back(1e3 / kSets * test::timed([&] {
                        for (const Points& points : sets) {
                          static_cast<void>(ours->build(points));
                          triangles += ours->triangles().size();
                        }
                      }));
    theirs_us.push_back(1e3 / kSets * test::timed([&] {
                          for (const std::vector<cv::Point2f>& points : cv_sets) {
                            theirs.initDelaunay({0, 0, kWidth, kHeight});
                            theirs.insert(points);
                            theirs.getTriangleList(list);
                          }
                        }));
  }
  std::size_t theirs_triangles = 0;
  std::size_t common = 0;
  for (std::size_t i = 0; i < kSets; ++i) {
    static_cast<void>(ours->build(sets[i]));
    const std::set<Corners> corners = cornersOf(sets[i], *ours);
    theirs.initDelaunay({0, 0, kWidth, kHeight});
    theirs.insert(cv_sets[i]);
    theirs.getTriangleList(list);
    theirs_triangles += list.size();
    for (const cv::Vec6f& t : list) {
      Corners c = {std::pair{t[0], t[1]}, std::pair{t[2], t[3]}, std::pair{t[4], t[5]}};
      std::sort(c.begin(), c.end());
      common += corners.contains(c) ? 1 : 0;
    }
  }
  const double a = median(ours_us);
  const double b = median(theirs_us);
  const auto each = [](std::size_t sum, int of) { return static_cast<double>(sum) / of; };
  std::printf("%-14s %4d points: swiftlet %7.2f us, OpenCV %8.2f us, ratio %5.1f", name, count, a, b, b / a);
  std::printf("; triangles %.1f and %.1f, in common %.1f\n", each(triangles, kSets * kRepetitions),
              each(theirs_triangles, kSets), each(common, kSets));
}

}  // namespace

int main() {
  for (const int count : {100, 300, 1000}) {
    compare("random", count, randomPoints);
    compare("spread pixels", count, spreadPixels);
  }
  return 0;
}
