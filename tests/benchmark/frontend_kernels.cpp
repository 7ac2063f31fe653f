// Lucas-Kanade and corner detection beside OpenCV in one process: same images, points, window, one
// thread. Prints CPU times, their ratio, and the end-point error against known flow:
//  - synthetic: real and rendered images warped by a known smooth map, with noise;
//  - rendered pairs (vil_*): true depth and poses of consecutive frames.
// Times are the least of several interleaved repetitions, in CPU time of this thread.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <string>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/frontend/affine_alignment.hpp"
#include "estimator/frontend/corners.hpp"
#include "estimator/frontend/lucas_kanade.hpp"
#include "tests/frontend/log_reader.hpp"
#include "tests/frontend/true_depth.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

constexpr int kRepetitions = 7;
constexpr int kLevels = 4;
constexpr int kFeatures = 200;

template <typename F>
void timed(double& least, F&& f) {
  least = std::min(least, test::timed(f));
}

cv::Mat asMat(const ImageView& v) { return {v.height, v.width, CV_8U, const_cast<std::uint8_t*>(v.data)}; }

struct Flow {
  std::vector<Eigen::Vector2f> to;
  std::vector<bool> found;
};

struct Pair {
  GreyImage first, second;
  std::vector<Eigen::Vector2f> from, truth;
};

struct Totals {
  double ours = 0, cv = 0, ours_pyramid = 0, cv_pyramid = 0, refining = 0;
  std::vector<double> ours_error, refined_error, cv_error;  // of points that both found
  std::size_t points = 0, ours_found = 0, cv_found = 0;
};

std::vector<Eigen::Vector2f> cornersOf(const GreyImage& image, double* milliseconds = nullptr) {
  Pyramid pyramid(image.width, image.height, 1);
  pyramid.build(image.view());
  CornerDetector detector(image.width, image.height);
  auto corners = std::make_unique<FixedVector<Corner, kMaxFeatures>>();
  double least = 1e9;
  for (int i = 0; i < (milliseconds != nullptr ? kRepetitions : 1); ++i) {
    timed(least, [&] { detector.detect(pyramid.level(0), {}, kFeatures, kFeatures, {}, *corners); });
  }
  if (milliseconds != nullptr) *milliseconds += least;
  std::vector<Eigen::Vector2f> pixels;
  for (const Corner& c : *corners) pixels.push_back(c.pixel);
  return pixels;
}

void run(const Pair& pair, Totals& totals) {
  const std::size_t n = pair.from.size();
  Pyramid a(pair.first.width, pair.first.height, kLevels);
  Pyramid b(pair.first.width, pair.first.height, kLevels);
  Flow ours{std::vector<Eigen::Vector2f>(n), std::vector<bool>(n)};
  LucasKanadeSettings settings;
  settings.levels = kLevels;
  settings.back_check = 0;
  std::vector<cv::Point2f> from;
  for (const Eigen::Vector2f& p : pair.from) from.emplace_back(p.x(), p.y());
  std::vector<cv::Point2f> to;
  std::vector<std::uint8_t> status;
  std::vector<float> error;
  const cv::Size window(kPatchSize, kPatchSize);
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 30, 0.01);
  std::vector<cv::Mat> cv_a;
  std::vector<cv::Mat> cv_b;
  double t_ours = 1e9, t_cv = 1e9, t_ours_pyramid = 1e9, t_cv_pyramid = 1e9;
  a.build(pair.first.view());
  cv::buildOpticalFlowPyramid(asMat(pair.first.view()), cv_a, window, kLevels - 1, true);
  for (int repetition = 0; repetition < kRepetitions; ++repetition) {
    timed(t_ours_pyramid, [&] { b.build(pair.second.view()); });
    timed(t_ours, [&] {
      for (std::size_t i = 0; i < n; ++i) {
        Eigen::Vector2f p = pair.from[i];
        ours.found[i] = trackPoint(a, pair.from[i], b, settings, p);
        ours.to[i] = p;
      }
    });
    timed(t_cv_pyramid,
          [&] { cv::buildOpticalFlowPyramid(asMat(pair.second.view()), cv_b, window, kLevels - 1, true); });
    timed(t_cv,
          [&] { cv::calcOpticalFlowPyrLK(cv_a, cv_b, from, to, status, error, window, kLevels - 1, stop); });
  }
  totals.ours += t_ours;
  totals.cv += t_cv;
  totals.ours_pyramid += t_ours_pyramid;
  totals.cv_pyramid += t_cv_pyramid;
  // The affine alignment that follows in the front-end; a track's template is prepared once in its life.
  std::vector<AffineTemplate> pattern(n);
  std::vector<bool> prepared(n);
  std::vector<Eigen::Vector2f> refined = ours.to;
  const ImageView& base = a.level(0);
  for (std::size_t i = 0; i < n; ++i) {
    prepared[i] =
        pattern[i].build(base, static_cast<int>(pair.from[i].x()), static_cast<int>(pair.from[i].y()));
  }
  double t_refining = 1e9;
  for (int repetition = 0; repetition < kRepetitions; ++repetition) {
    timed(t_refining, [&] {
      for (std::size_t i = 0; i < n; ++i) {
        if (!ours.found[i] || !prepared[i]) continue;
        AffineTemplate::Estimate estimate{ours.to[i], Eigen::Matrix2f::Identity(), 0};
        const bool good = pattern[i].align(base, static_cast<int>(pair.from[i].x()),
                                           static_cast<int>(pair.from[i].y()), b.level(0), 3, estimate);
        refined[i] = good && (estimate.position - ours.to[i]).norm() < 1 ? estimate.position : ours.to[i];
      }
    });
  }
  totals.refining += t_refining;
  for (std::size_t i = 0; i < n; ++i) {
    ++totals.points;
    totals.ours_found += ours.found[i] ? 1 : 0;
    totals.cv_found += status[i] != 0 ? 1 : 0;
    if (!ours.found[i] || status[i] == 0 || pair.truth.empty()) continue;
    totals.refined_error.push_back((refined[i] - pair.truth[i]).norm());
    totals.ours_error.push_back((ours.to[i] - pair.truth[i]).norm());
    totals.cv_error.push_back((Eigen::Vector2f(to[i].x, to[i].y) - pair.truth[i]).norm());
  }
}

void printErrors(const char* name, std::vector<double> e) {
  if (e.empty()) return;
  std::sort(e.begin(), e.end());
  double below = 0;
  std::size_t good = 0;
  for (const double x : e) {
    if (x < 1) below += x * x, ++good;
  }
  std::printf(
      "    %-7s end-point error: median %.4f px, rms below 1 px %.4f, 90 %% %.3f, above 1 px %.2f %%\n", name,
      e[e.size() / 2], std::sqrt(below / static_cast<double>(std::max<std::size_t>(good, 1))),
      e[e.size() * 9 / 10], 100.0 * static_cast<double>(e.size() - good) / static_cast<double>(e.size()));
}

void print(const char* name, const Totals& t, std::size_t pairs) {
  if (pairs == 0) return;
  const auto n = static_cast<double>(pairs);
  std::printf("%s: %zu pairs, %.0f points a pair, window %d, %d levels\n", name, pairs,
              static_cast<double>(t.points) / n, kPatchSize, kLevels);
  std::printf("    tracking        swiftlet %.3f ms, OpenCV %.3f ms, ratio %.2f\n", t.ours / n, t.cv / n,
              t.cv / t.ours);
  std::printf("    with a pyramid  swiftlet %.3f ms, OpenCV %.3f ms, ratio %.2f\n",
              (t.ours + t.ours_pyramid) / n, (t.cv + t.cv_pyramid) / n,
              (t.cv + t.cv_pyramid) / (t.ours + t.ours_pyramid));
  std::printf("    with refinement swiftlet %.3f ms, OpenCV %.3f ms, ratio %.2f\n", (t.ours + t.refining) / n,
              t.cv / n, t.cv / (t.ours + t.refining));
  std::printf("    found           swiftlet %.1f %%, OpenCV %.1f %%\n",
              100.0 * static_cast<double>(t.ours_found) / static_cast<double>(t.points),
              100.0 * static_cast<double>(t.cv_found) / static_cast<double>(t.points));
  printErrors("swiftlet", t.ours_error);
  printErrors("refined", t.refined_error);
  printErrors("OpenCV", t.cv_error);
}

// A smooth known map: rotation, scale, shift and a gentle wave, as a camera's motion makes.
struct Warp {
  double angle, scale, dx, dy, wave;
  [[nodiscard]] Eigen::Vector2d operator()(double x, double y, double cx, double cy) const {
    const double u = x - cx;
    const double v = y - cy;
    return {cx + scale * (std::cos(angle) * u - std::sin(angle) * v) + dx + wave * std::sin(v / 60),
            cy + scale * (std::sin(angle) * u + std::cos(angle) * v) + dy + wave * std::cos(u / 60)};
  }
};

// second(W(x)) = first(x): the second image is sampled through the inverse, found by iteration, from
// a slightly smoothed source, so that cubic sampling is far from aliasing. Both get their own noise.
Pair synthesize(const GreyImage& source, const Warp& warp, std::uint64_t seed) {
  Random random(seed);
  cv::Mat smooth;
  cv::GaussianBlur(asMat(source.view()), smooth, {}, 0.7);
  const double cx = 0.5 * source.width;
  const double cy = 0.5 * source.height;
  cv::Mat map(source.height, source.width, CV_32FC2);
  for (int y = 0; y < source.height; ++y) {
    for (int x = 0; x < source.width; ++x) {
      Eigen::Vector2d p(x, y);
      for (int i = 0; i < 6; ++i) p -= warp(p.x(), p.y(), cx, cy) - Eigen::Vector2d(x, y);
      map.at<cv::Vec2f>(y, x) = {static_cast<float>(p.x()), static_cast<float>(p.y())};
    }
  }
  // OpenCV's remap rounds its coordinates to 1/32 px; sampling by hand is exact.
  Pair pair;
  for (GreyImage* image : {&pair.first, &pair.second}) {
    image->width = source.width;
    image->height = source.height;
    image->pixels.resize(source.pixels.size());
  }
  const auto cubic = [](double t, int k) {
    const double a = -0.5;
    const double d = std::abs(t - k);
    if (d < 1) return (a + 2) * d * d * d - (a + 3) * d * d + 1;
    if (d < 2) return a * d * d * d - 5 * a * d * d + 8 * a * d - 4 * a;
    return 0.0;
  };
  for (int y = 0; y < source.height; ++y) {
    for (int x = 0; x < source.width; ++x) {
      const cv::Vec2f m = map.at<cv::Vec2f>(y, x);
      const int bx = static_cast<int>(std::floor(m[0]));
      const int by = static_cast<int>(std::floor(m[1]));
      double sum = 0;
      for (int j = -1; j <= 2; ++j) {
        for (int i = -1; i <= 2; ++i) {
          const int px = std::clamp(bx + i, 0, source.width - 1);
          const int py = std::clamp(by + j, 0, source.height - 1);
          sum += cubic(static_cast<double>(m[0]) - bx, i) * cubic(static_cast<double>(m[1]) - by, j) *
                 smooth.at<std::uint8_t>(py, px);
        }
      }
      const auto at = static_cast<std::size_t>(y * source.width + x);
      const auto noisy = [&](double v) {
        return static_cast<std::uint8_t>(std::clamp(v + 2.0 * random.normal() + 0.5, 0.0, 255.0));
      };
      pair.first.pixels[at] = noisy(smooth.at<std::uint8_t>(y, x));
      pair.second.pixels[at] = noisy(sum);
    }
  }
  for (const Eigen::Vector2f& p : cornersOf(pair.first)) {
    const Eigen::Vector2d q = warp(p.x(), p.y(), cx, cy);
    if (q.x() < 20 || q.y() < 20 || q.x() > source.width - 21 || q.y() > source.height - 21) continue;
    pair.from.push_back(p);
    pair.truth.push_back(q.cast<float>());
  }
  return pair;
}

void synthetic(const std::string& name, bool deform) {
  const EurocLog log = EurocLog::open(dataFolder() + "/" + name);
  Totals totals;
  std::size_t pairs = 0;
  for (std::size_t k = 0; k + 40 < log.stamps.size() && pairs < 8; k += 40) {
    Random random(k);
    Warp warp{random.uniform(-0.03, 0.03), random.uniform(0.98, 1.02), random.uniform(-6, 6),
              random.uniform(-6, 6), random.uniform(0, 1)};
    if (!deform) warp = {0, 1, warp.dx, warp.dy, 0};
    run(synthesize(log.image(0, log.stamps[k]), warp, k), totals);
    ++pairs;
  }
  print((std::string(deform ? "synthetic warps of " : "synthetic shifts of ") + name).c_str(), totals, pairs);
}

void rendered(const std::string& name) {
  const EurocLog log = EurocLog::open(dataFolder() + "/" + name);
  Totals totals;
  std::size_t pairs = 0;
  for (std::size_t k = 0; k + 1 < log.stamps.size() && pairs < 40; k += 15) {
    const DepthImage depth = log.depth(log.stamps[k]);
    SE3 T_world_a;
    SE3 T_world_b;
    if (depth.width == 0 || !log.pose(log.stamps[k], T_world_a) || !log.pose(log.stamps[k + 1], T_world_b))
      continue;
    const SE3& T_body_cam = log.rig.T_body_cam[0];
    const SE3 T_b_a = (T_world_b * T_body_cam).inverse() * (T_world_a * T_body_cam);
    Pair pair;
    pair.first = log.image(0, log.stamps[k]);
    pair.second = log.image(0, log.stamps[k + 1]);
    for (const Eigen::Vector2f& p : cornersOf(pair.first)) {
      Eigen::Vector3d bearing;
      double z = 0;
      Eigen::Vector2d q;
      if (!log.rig.camera[0].unproject(p.cast<double>(), bearing) || !depthAt(depth, bearing, z) ||
          !log.rig.camera[0].project(T_b_a * (bearing * (z / bearing.z())), q) ||
          !log.rig.camera[0].inImage(q, 20)) {
        continue;
      }
      pair.from.push_back(p);
      pair.truth.push_back(q.cast<float>());
    }
    run(pair, totals);
    ++pairs;
  }
  print(("rendered pairs of " + name).c_str(), totals, pairs);
}

void real(const std::string& name) {
  const EurocLog log = EurocLog::open(dataFolder() + "/" + name);
  Totals totals;
  std::size_t pairs = 0;
  double corners_ours = 0;
  double corners_cv = 0;
  for (std::size_t k = 0; k + 1 < log.stamps.size() && pairs < 20; k += 20) {
    Pair pair;
    pair.first = log.image(0, log.stamps[k]);
    pair.second = log.image(0, log.stamps[k + 1]);
    pair.from = cornersOf(pair.first, &corners_ours);
    double least = 1e9;
    for (int i = 0; i < kRepetitions; ++i) {
      std::vector<cv::Point2f> corners;
      timed(least,
            [&] { cv::goodFeaturesToTrack(asMat(pair.first.view()), corners, kFeatures, 0.003, 14, {}, 7); });
    }
    corners_cv += least;
    run(pair, totals);
    ++pairs;
  }
  if (pairs == 0) return;
  print(("real pairs of " + name + " (no known flow)").c_str(), totals, pairs);
  const auto n = static_cast<double>(pairs);
  std::printf("    corners, whole image, %d wanted: swiftlet %.3f ms, OpenCV %.3f ms, ratio %.2f\n",
              kFeatures, corners_ours / n, corners_cv / n, corners_cv / corners_ours);
}

}  // namespace

int main() {
  cv::setNumThreads(1);
  if (EurocLog::open(dataFolder() + "/vil_v102").stamps.empty()) {
    std::printf("no logs in %s: set SWIFTLET_DATA\n", dataFolder().c_str());
    return 0;
  }
  for (const bool deform : {false, true}) {
    synthetic("euroc_mh01_20s", deform);
    synthetic("vil_v102", deform);
  }
  rendered("vil_v102");
  rendered("vil_mh05");
  real("euroc_mh01_20s");
  return 0;
}
