// Five-point RANSAC beside OpenGV's, on the same seeded scenes in one process:
// 65 % true tracks, 200 tracks, 0.5 px noise, EuRoC's lens. Printed, never asserted.

#include <benchmark/benchmark.h>

#include <cstdio>
#include <ctime>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "estimator/geometry/minimal_solvers.hpp"
#include "tests/benchmark/ransac_opengv.hpp"
#include "tests/geometry/track_scene.hpp"

namespace swiftlet::test {
namespace {

constexpr std::uint64_t kScenes = 16;
constexpr double kPixelSigma = 0.5;
constexpr double kConfidence = 0.99;  // OpenGV's default, for both
constexpr int kMaxIterations = 1000;

// CPU time of the process [us]: other programs of the machine do not count.
double cpuMicroseconds() { return 1e6 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Figures {
  double microseconds = 0;
  double rotation_error = 0;
  double translation_error = 0;  // [deg]
  double removed = 0;
  double lost = 0;
};

RansacSettings settings(const Scene& scene) {
  RansacSettings result;
  result.bearing_sigma = kPixelSigma / scene.camera.focal();
  result.confidence = kConfidence;
  result.max_iterations = kMaxIterations;
  return result;
}

using Mask = std::vector<bool>;

void account(const Scene& scene, const SE3& T_cur_prev, const Mask& kept, Figures& figures) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  const Eigen::Vector3d& truth = scene.T_cur_prev.translation;
  const Eigen::Vector3d& t = T_cur_prev.translation;
  figures.rotation_error +=
      kDegrees / kScenes * logSo3((scene.T_cur_prev.inverse() * T_cur_prev).rotation).norm();
  figures.translation_error += kDegrees / kScenes * std::atan2(truth.cross(t).norm(), truth.dot(t));
  double bad = 0, removed = 0, good = 0, lost = 0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    (scene.good(i) ? good : bad) += 1;
    if (!kept[i]) (scene.good(i) ? lost : removed) += 1;
  }
  figures.removed += 100 * removed / bad / kScenes;
  figures.lost += 100 * lost / good / kScenes;
}

std::pair<SE3, Mask> ours(const Scene& scene, MonoRansac& ransac) {
  RansacResult result;
  (void)ransac.fivePoint(scene.prev, scene.cur, 1, result);
  return {result.T_cur_prev, Mask(result.inlier.begin(), result.inlier.end())};
}

Mask maskOf(const std::vector<int>& inliers, const std::vector<std::size_t>& index, std::size_t count) {
  Mask mask(count, false);
  for (const int i : inliers) mask[index[static_cast<std::size_t>(i)]] = true;
  return mask;
}

std::vector<Bearing> plain(std::span<const Eigen::Vector3d> vectors) {
  std::vector<Bearing> result;
  for (const Eigen::Vector3d& v : vectors) result.push_back({v.x(), v.y(), v.z()});
  return result;
}

std::pair<SE3, Mask> fromPlain(const OpengvResult& result, const std::vector<std::size_t>& index,
                               std::size_t count) {
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R(r, c) = result.motion[static_cast<std::size_t>(4 * r + c)];
    t[r] = result.motion[static_cast<std::size_t>(4 * r + 3)];
  }
  return {SE3(R, t), maskOf(result.inliers, index, count)};
}

std::pair<SE3, Mask> opengvFivePoint(const Scene& scene) {
  std::vector<std::size_t> all(scene.prev.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  // Its error is 1 - cos of the reprojection angle, summed over both frames.
  const double threshold = 2.0 * (1.0 - std::cos(3.0 * settings(scene).bearing_sigma));
  const OpengvResult result =
      opengvFivePointRansac(plain(scene.prev), plain(scene.cur), threshold, kConfidence, kMaxIterations);
  return fromPlain(result, all, all.size());
}

template <typename Method>
Figures measure(const std::vector<Scene>& scenes, const Method& method) {
  Figures figures;
  constexpr int kRepeats = 10;
  for (const Scene& scene : scenes) {
    const double begin = cpuMicroseconds();
    for (int i = 0; i < kRepeats; ++i) benchmark::DoNotOptimize(method(scene));
    figures.microseconds += (cpuMicroseconds() - begin) / kRepeats / kScenes;
    const auto [T_cur_prev, kept] = method(scene);
    account(scene, T_cur_prev, kept, figures);
  }
  return figures;
}

void print(const char* name, const Figures& f) {
  std::printf(
      "%-22s %9.1f us   rotation %7.4f deg   translation %8.4f deg   false out %6.2f %%   good lost %5.2f "
      "%%\n",
      name, f.microseconds, f.rotation_error, f.translation_error, f.removed, f.lost);
}

void compareSolvers(const Scene& scene) {
  constexpr int kRepeats = 5000;
  std::array<Eigen::Vector3d, 5> from, to;
  for (std::size_t i = 0; i < 5; ++i) {
    from[i] = scene.prev[scene.prev.size() - 1 - i];
    to[i] = scene.cur[scene.cur.size() - 1 - i];
  }
  const double begin = cpuMicroseconds();
  for (int i = 0; i < kRepeats; ++i) benchmark::DoNotOptimize(essentialFromFivePoints(from, to));
  const double own = (cpuMicroseconds() - begin) / kRepeats;
  const double theirs = opengvFivePointMicroseconds(plain(from), plain(to), kRepeats);
  std::printf("%-22s own %.2f us, OpenGV %.2f us, ratio %.1f\n", "5-point solver alone", own, theirs,
              theirs / own);
}

int compare() {
  std::vector<Scene> scenes;
  for (std::uint64_t seed = 0; seed < kScenes; ++seed) scenes.push_back(makeScene(euroc(), {}, seed));
  const auto mono = std::make_unique<MonoRansac>(settings(scenes[0]));
  compareSolvers(scenes[0]);
  const Figures own = measure(scenes, [&](const Scene& scene) { return ours(scene, *mono); });
  const Figures theirs = measure(scenes, [](const Scene& scene) { return opengvFivePoint(scene); });
  print("5-point RANSAC", own);
  print("  OpenGV", theirs);
  std::printf("%-22s OpenGV / own: %.1f\n", "", theirs.microseconds / own.microseconds);
  return 0;
}

}  // namespace
}  // namespace swiftlet::test

int main() { return swiftlet::test::compare(); }
