#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>

#include "tests/geometry/track_scene.hpp"
#include "tests/support/statistics.hpp"

namespace swiftlet::test {
namespace {

constexpr int kSeeds = 60;
constexpr double kDegrees = 180.0 / std::numbers::pi;

enum class Method { kFivePoint, kTwoPoint };
constexpr std::array kMethods = {Method::kFivePoint, Method::kTwoPoint};

const char* nameOf(Method method) { return method == Method::kFivePoint ? "5-point" : "2-point, R known"; }

RansacSettings settingsFor(const Scene& scene, double pixel_sigma) {
  RansacSettings settings;
  settings.bearing_sigma = pixel_sigma / scene.camera.focal();
  return settings;
}

Status run(Method method, const Scene& scene, const RansacSettings& settings, std::uint64_t seed,
           RansacResult& result) {
  // The gyroscope's rotation is off by about 1 mrad per axis.
  Random random(seed, 7);
  const Eigen::Vector3d error = 1e-3 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  const Eigen::Quaterniond R = scene.T_cur_prev.rotation * expSo3(error);
  auto mono = std::make_unique<MonoRansac>(settings);
  return method == Method::kFivePoint ? mono->fivePoint(scene.prev, scene.cur, seed, result)
                                      : mono->twoPoint(scene.prev, scene.cur, R, seed, result);
}

struct Tally {
  std::size_t good = 0, good_lost = 0, bad = 0, bad_removed = 0, behind = 0, behind_removed = 0;
  int ok = 0;
  long iterations = 0;
  std::vector<double> rotation_error;     // [deg]
  std::vector<double> translation_error;  // [deg]

  void add(const Scene& scene, const RansacResult& result) {
    for (std::size_t i = 0; i < scene.kind.size(); ++i) {
      const bool kept = result.inlier[i];
      if (scene.good(i)) {
        ++good;
        if (!kept) ++good_lost;
      } else {
        ++bad;
        if (!kept) ++bad_removed;
        if (scene.kind[i] == TrackKind::kBehind) {
          ++behind;
          if (!kept) ++behind_removed;
        }
      }
    }
    iterations += result.iterations;
    const SE3 difference = scene.T_cur_prev.inverse() * result.T_cur_prev;
    rotation_error.push_back(kDegrees * logSo3(difference.rotation).norm());
    const Eigen::Vector3d& truth = scene.T_cur_prev.translation;
    const Eigen::Vector3d& t = result.T_cur_prev.translation;
    translation_error.push_back(kDegrees * std::atan2(truth.cross(t).norm(), truth.dot(t)));
  }
  [[nodiscard]] double removed() const { return static_cast<double>(bad_removed) / static_cast<double>(bad); }
  [[nodiscard]] double lost() const { return static_cast<double>(good_lost) / static_cast<double>(good); }
};

void print(const char* lens, Method method, const Tally& tally) {
  std::printf("%-14s %-24s %6.2f %6.2f %6.2f   %7.4f %7.4f   %7.4f %7.4f deg  %5.1f\n", lens, nameOf(method),
              100 * tally.removed(),
              tally.behind > 0
                  ? 100.0 * static_cast<double>(tally.behind_removed) / static_cast<double>(tally.behind)
                  : 100.0,
              100 * tally.lost(), quantile(tally.rotation_error, 0.5), quantile(tally.rotation_error, 0.9),
              quantile(tally.translation_error, 0.5), quantile(tally.translation_error, 0.9),
              static_cast<double>(tally.iterations) / kSeeds);
}

void printHeader(const char* title) {
  std::printf("\n%s (%d seeds)\n%-14s %-24s %6s %6s %6s   %15s   %15s      %s\n", title, kSeeds, "lens",
              "method", "false", "behind", "good", "rotation [deg]", "translation", "samples");
  std::printf("%-14s %-24s %6s %6s %6s   %7s %7s   %7s %7s\n", "", "", "out %", "out %", "lost %", "median",
              "90 %", "median", "90 %");
}

struct Lens {
  const char* name;
  CameraModel camera;
};

std::vector<Lens> lenses() {
  return {{"radtan 79 deg", euroc()}, {"fisheye 180", fisheye(180)}, {"fisheye 200", fisheye(200)}};
}

}  // namespace

TEST_CASE("the RANSACs remove false tracks and keep good ones", "[ransac]") {
  printHeader("30 % displaced by 5 to 100 px, 5 % behind the camera, 15 % without parallax, 0.5 px noise");
  for (const Lens& lens : lenses()) {
    for (const Method method : kMethods) {
      Tally tally;
      for (int seed = 0; seed < kSeeds; ++seed) {
        const Scene scene = makeScene(lens.camera, {}, static_cast<std::uint64_t>(seed));
        RansacResult result;
        const Status status =
            run(method, scene, settingsFor(scene, 0.5), static_cast<std::uint64_t>(seed), result);
        INFO(lens.name << ' ' << nameOf(method) << " seed " << seed << ' ' << status.what);
        CHECK(status.ok());
        if (status.ok()) ++tally.ok;
        tally.add(scene, result);
      }
      print(lens.name, method, tally);
      CHECK(tally.removed() >= 0.95);
      CHECK(tally.lost() <= 0.05);
      CHECK(quantile(tally.rotation_error, 0.9) < 0.3);
      CHECK(quantile(tally.translation_error, 0.9) < 5.0);
    }
  }
}

TEST_CASE("displacement along the epipolar line alone, and noise other than set (printed)", "[ransac]") {
  printHeader("pixel noise 0.3, 0.5, 0.8 px where 0.5 is set");
  for (const double sigma : {0.3, 0.5, 0.8}) {
    for (const Method method : kMethods) {
      Tally tally;
      for (int seed = 0; seed < kSeeds; ++seed) {
        SceneSettings scene_settings;
        scene_settings.pixel_sigma = sigma;
        const Scene scene = makeScene(euroc(), scene_settings, static_cast<std::uint64_t>(seed));
        RansacResult result;
        CHECK(run(method, scene, settingsFor(scene, 0.5), static_cast<std::uint64_t>(seed), result).ok());
        tally.add(scene, result);
      }
      print(sigma < 0.4 ? "0.3 px" : sigma < 0.6 ? "0.5 px" : "0.8 px", method, tally);
      CHECK(tally.removed() >= 0.95);
      if (sigma < 0.6) CHECK(tally.lost() <= 0.05);
    }
  }

  printHeader("all false tracks displaced along their epipolar line, either way");
  for (const Method method : kMethods) {
    Tally tally;
    for (int seed = 0; seed < kSeeds; ++seed) {
      SceneSettings scene_settings;
      scene_settings.behind_share = 0;
      scene_settings.along_epipolar_line = true;
      const Scene scene = makeScene(euroc(), scene_settings, static_cast<std::uint64_t>(seed));
      RansacResult result;
      CHECK(run(method, scene, settingsFor(scene, 0.5), static_cast<std::uint64_t>(seed), result).ok());
      tally.add(scene, result);
    }
    print("radtan 79 deg", method, tally);
    CHECK(tally.lost() <= 0.05);
    // One camera cannot tell a displacement towards the epipole from a nearer point.
    CHECK(tally.removed() >= 0.4);
  }
}

TEST_CASE("without parallax the mask is that of the rotation, and the status says so", "[ransac]") {
  printHeader("pure rotation: 30 % displaced");
  for (const Lens& lens : lenses()) {
    for (const Method method : kMethods) {
      Tally tally;
      for (int seed = 0; seed < kSeeds; ++seed) {
        SceneSettings scene_settings;
        scene_settings.min_translation = scene_settings.max_translation = 0;
        scene_settings.behind_share = 0;
        const Scene scene = makeScene(lens.camera, scene_settings, static_cast<std::uint64_t>(seed));
        RansacResult result;
        const Status status =
            run(method, scene, settingsFor(scene, 0.5), static_cast<std::uint64_t>(seed), result);
        INFO(lens.name << ' ' << nameOf(method) << " seed " << seed << ' ' << status.what);
        CHECK(status.code == StatusCode::kDegenerate);
        CHECK(result.no_parallax);
        CHECK(result.T_cur_prev.translation.isZero(0));
        tally.add(scene, result);
      }
      print(lens.name, method, tally);
      CHECK(tally.removed() >= 0.95);
      CHECK(tally.lost() <= 0.05);
      CHECK(quantile(tally.rotation_error, 0.9) < 0.1);
    }
  }

  printHeader("all true tracks at 1 to 100 km, moving: 30 % displaced");
  for (const Method method : kMethods) {
    Tally tally;
    for (int seed = 0; seed < kSeeds; ++seed) {
      SceneSettings scene_settings;
      scene_settings.behind_share = 0;
      scene_settings.far_share = 1;
      const Scene scene = makeScene(euroc(), scene_settings, static_cast<std::uint64_t>(seed));
      RansacResult result;
      const Status status =
          run(method, scene, settingsFor(scene, 0.5), static_cast<std::uint64_t>(seed), result);
      INFO(nameOf(method) << " seed " << seed << ' ' << status.what);
      CHECK(status.code == StatusCode::kDegenerate);
      CHECK(result.no_parallax);
      tally.add(scene, result);
    }
    print("radtan 79 deg", method, tally);
    CHECK(tally.removed() >= 0.95);
    CHECK(tally.lost() <= 0.05);
    CHECK(quantile(tally.rotation_error, 0.9) < 0.1);
  }
}

TEST_CASE("too few tracks, all false tracks and bad input give no motion", "[ransac]") {
  SceneSettings settings;
  settings.displaced_share = 1;
  for (const Method method : kMethods) {
    INFO(nameOf(method));
    const Scene all_false = makeScene(euroc(), settings, 3);
    RansacResult result;
    RansacSettings strict = settingsFor(all_false, 0.5);
    strict.min_inliers = 60;  // of 200 random tracks, a third agrees with some motion by chance never
    CHECK(run(method, all_false, strict, 1, result).code == StatusCode::kDegenerate);
    CHECK(result.inlier_count == 0);
    CHECK(result.inlier.size() == all_false.kind.size());
    CHECK(std::none_of(result.inlier.begin(), result.inlier.end(), [](bool kept) { return kept; }));

    for (const std::size_t count : {0UL, 1UL, 2UL, 4UL}) {
      Scene few = makeScene(euroc(), {.displaced_share = 0, .behind_share = 0}, 4);
      few.prev.resize(count);
      few.cur.resize(count);
      CHECK(run(method, few, settingsFor(few, 0.5), 1, result).code == StatusCode::kDegenerate);
    }
    Scene broken = makeScene(euroc(), {}, 5);
    broken.cur.pop_back();
    CHECK(run(method, broken, settingsFor(broken, 0.5), 1, result).code == StatusCode::kInvalidInput);
    const Scene fine = makeScene(euroc(), {}, 5);
    CHECK(run(method, fine, settingsFor(fine, 0), 1, result).code == StatusCode::kInvalidInput);
  }
}

TEST_CASE("NaN bearings are outliers, the others are not disturbed", "[ransac]") {
  Scene scene = makeScene(euroc(), {}, 6);
  const std::size_t at = scene.kind.size() - 1;  // a good one
  scene.cur[at].y() = std::numeric_limits<double>::quiet_NaN();
  for (const Method method : kMethods) {
    RansacResult result;
    CHECK(run(method, scene, settingsFor(scene, 0.5), 6, result).ok());
    CHECK_FALSE(result.inlier[at]);
    CHECK(result.T_cur_prev.translation.allFinite());
    CHECK(result.inlier_count > 110);
  }
}

TEST_CASE("tracks of points nearer than the settings allow are outliers", "[ransac]") {
  constexpr std::size_t kEach = 10;
  constexpr std::uint64_t kScenes = 20;
  for (const Method method : kMethods) {
    std::size_t kept_beyond = 0;
    for (std::uint64_t seed = 1; seed <= kScenes; ++seed) {
      Scene scene = makeScene(fisheye(180), {.displaced_share = 0, .behind_share = 0}, seed);
      const std::size_t begin = scene.kind.size();
      const double baseline = scene.T_cur_prev.translation.norm();
      Random random(seed, 5);
      for (std::size_t i = 0; i < 2 * kEach; ++i) {
        // Across the motion: the parallax is far from what noise makes of it.
        const Eigen::Vector3d across =
            (scene.T_cur_prev.rotation.conjugate() * scene.T_cur_prev.translation).cross(randomUnit(random));
        const Eigen::Vector3d point = (i < kEach ? 0.4 : 0.6) * baseline * across.normalized();
        scene.prev.push_back(point.normalized());
        scene.cur.push_back((scene.T_cur_prev * point).normalized());
      }
      RansacSettings settings = settingsFor(scene, 0.5);
      settings.min_depth_over_baseline = 0.5;
      RansacResult result;
      REQUIRE(run(method, scene, settings, seed, result).ok());
      const auto kept = [&](std::size_t from) {
        const auto* first = result.inlier.begin() + static_cast<std::ptrdiff_t>(from);
        return std::count(first, first + kEach, true);
      };
      CAPTURE(nameOf(method), seed);
      CHECK(kept(begin) == 0);
      kept_beyond += static_cast<std::size_t>(kept(begin + kEach));
    }
    // So near a point shows how far off the winning sample's direction is: of some scenes they are outliers.
    CAPTURE(nameOf(method), kept_beyond);
    CHECK(kept_beyond > kEach * kScenes * 8 / 10);
  }
}

TEST_CASE("equal seeds give equal bytes", "[ransac]") {
  const Scene scene = makeScene(euroc(), {}, 7);
  for (const Method method : kMethods) {
    RansacResult a, b;
    CHECK(run(method, scene, settingsFor(scene, 0.5), 9, a).ok());
    CHECK(run(method, scene, settingsFor(scene, 0.5), 9, b).ok());
    CHECK(a.T_cur_prev.rotation.coeffs() == b.T_cur_prev.rotation.coeffs());
    CHECK(a.T_cur_prev.translation == b.T_cur_prev.translation);
    CHECK(std::equal(a.inlier.begin(), a.inlier.end(), b.inlier.begin(), b.inlier.end()));
    CHECK(a.iterations == b.iterations);
  }
}

}  // namespace swiftlet::test
