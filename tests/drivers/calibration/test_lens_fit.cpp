// Lenses of other tools as the estimator's two: random cameras of each model, with realistic parameters,
// converted and compared with OpenCV's own projections or with the models' closed inverses, on random pixels
// of the covered region.

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/ccalib/omnidir.hpp>
#include <string>
#include <vector>

#include "drivers/calibration/lens_fit.hpp"
#include "estimator/core/random.hpp"
#include "tests/support/long_run.hpp"

namespace swiftlet {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kRadians = std::numbers::pi / 180;
constexpr int kPixels = 200;  // of each camera

/// OpenCV's pixels of rays.
std::vector<Vector2d> oraclePixels(const SourceLens& lens, const std::vector<Vector3d>& rays) {
  std::vector<cv::Point3d> points;
  points.reserve(rays.size());
  for (const Vector3d& ray : rays) points.emplace_back(ray.x(), ray.y(), ray.z());
  const Eigen::Vector4d& k = lens.intrinsics;
  const cv::Matx33d K(k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1);
  const cv::Vec3d zero(0, 0, 0);
  std::vector<cv::Point2d> pixels;
  const std::vector<double> all(lens.distortion.begin(), lens.distortion.end());
  const cv::Vec4d four(all[0], all[1], all[2], all[3]);
  if (lens.family == LensFamily::kBrown) {
    cv::projectPoints(points, zero, zero, K, all, pixels);
  } else if (lens.family == LensFamily::kEquidistant) {
    cv::fisheye::projectPoints(points, pixels, zero, zero, K, four);
  } else {
    cv::omnidir::projectPoints(points, pixels, zero, zero, K, lens.shape[0], four);
  }
  std::vector<Vector2d> out;
  out.reserve(pixels.size());
  for (const cv::Point2d& p : pixels) out.emplace_back(p.x, p.y);
  return out;
}

/// Pixel to ray by the closed inverse of models that have one (Usenko et al., 3DV 2018; Khomutenko et al.,
/// 2016; Devernay and Faugeras, 2001). False outside.
bool closedInverse(const SourceLens& lens, const Vector2d& pixel, Vector3d& ray) {
  const Vector2d m = (pixel - lens.intrinsics.tail<2>()).cwiseQuotient(lens.intrinsics.head<2>());
  const double r2 = m.squaredNorm();
  const auto [a, b] = lens.shape;
  if (lens.family == LensFamily::kDoubleSphere) {
    const double xi = a;
    const double alpha = b;
    if (alpha > 0.5 && r2 > 1 / (2 * alpha - 1)) return false;
    const double mz = (1 - alpha * alpha * r2) / (alpha * std::sqrt(1 - (2 * alpha - 1) * r2) + 1 - alpha);
    const double inside = mz * mz + (1 - xi * xi) * r2;
    if (inside < 0) return false;
    const double scale = (mz * xi + std::sqrt(inside)) / (mz * mz + r2);
    ray = {scale * m.x(), scale * m.y(), scale * mz - xi};
  } else if (lens.family == LensFamily::kExtendedUnified) {
    if (a > 0.5 && r2 > 1 / (b * (2 * a - 1))) return false;
    const double mz = (1 - b * a * a * r2) / (a * std::sqrt(1 - (2 * a - 1) * b * r2) + 1 - a);
    ray = {m.x(), m.y(), mz};
  } else {
    const double bent = std::sqrt(r2) * a;
    if (bent >= 0.5 * std::numbers::pi) return false;
    const double r = std::tan(bent) / (2 * std::tan(0.5 * a));
    ray = {m.x() * r / std::sqrt(r2), m.y() * r / std::sqrt(r2), 1};
  }
  ray.normalize();
  return true;
}

// The covered region ends where radius over angle grows by less than 0.1 of what it does at the axis.
constexpr double kLeastGrowth = 0.101;
constexpr double kSmall = 1e-4;

double radiusOf(const SourceLens& lens, const Vector2d& pixel) {
  return (pixel - lens.intrinsics.tail<2>()).cwiseQuotient(lens.intrinsics.head<2>()).norm();
}

/// Whether the oracle's image of the way from the axis to the ray moves outward well all along.
bool covered(const SourceLens& lens, const Vector3d& ray) {
  const double theta = std::atan2(ray.head<2>().norm(), ray.z());
  const Vector2d out = ray.head<2>().normalized();
  std::vector<Vector3d> rays;
  constexpr int kSteps = 40;
  for (int i = 0; i <= kSteps; ++i) {
    for (const double t : {theta * i / kSteps, theta * i / kSteps + kSmall}) {
      rays.emplace_back(std::sin(t) * out.x(), std::sin(t) * out.y(), std::cos(t));
    }
  }
  const std::vector<Vector2d> pixels = oraclePixels(lens, rays);
  const double at_axis = radiusOf(lens, pixels[1]);
  double last = -1;
  for (std::size_t i = 0; i < pixels.size(); i += 2) {
    const double radius = radiusOf(lens, pixels[i]);
    if (!(radius > last) || !(radiusOf(lens, pixels[i + 1]) - radius > kLeastGrowth * at_axis)) return false;
    last = radius;
  }
  return true;
}

/// The same of a pixel, for models with a closed inverse, which all bend evenly.
bool coveredPixel(const SourceLens& lens, const Vector2d& pixel) {
  const Vector2d centre = lens.intrinsics.tail<2>();
  const Vector2d out = (pixel - centre).normalized();
  std::array<Vector3d, 3> rays;
  if (!closedInverse(lens, centre + out, rays[0]) || !closedInverse(lens, pixel, rays[1]) ||
      !closedInverse(lens, pixel + out, rays[2])) {
    return false;
  }
  const double at_axis = std::atan2(rays[0].head<2>().norm(), rays[0].z());
  const double here = std::acos(std::min(1.0, rays[1].dot(rays[2])));
  return here * kLeastGrowth < at_axis;
}

/// A ray of the covered region with the oracle's pixel of it, from a random pixel; false where there is none.
bool randomSight(Random& random, const SourceLens& lens, const LensFit& fit, Vector3d& ray, Vector2d& pixel) {
  pixel = {random.uniform(0, lens.width - 1), random.uniform(0, lens.height - 1)};
  if (lens.family != LensFamily::kBrown && lens.family != LensFamily::kEquidistant &&
      lens.family != LensFamily::kOmni) {
    return coveredPixel(lens, pixel) && closedInverse(lens, pixel, ray);
  }
  if (!fit.model.unproject(pixel, ray)) return false;
  // OpenCV's fisheye divides by z.
  if (lens.family == LensFamily::kEquidistant && !(ray.z() > 0)) return false;
  if (!covered(lens, ray)) return false;
  pixel = oraclePixels(lens, {ray})[0];
  return fit.model.inImage(pixel);
}

/// A camera of common size whose image is `view` wide at the axis' scale.
SourceLens blank(Random& random, const char* name, LensFamily family, double view) {
  constexpr std::array<std::array<int, 2>, 6> kSizes = {
      {{640, 480}, {752, 480}, {848, 800}, {1280, 720}, {1280, 800}, {1920, 1080}}};
  SourceLens lens;
  lens.name = name;
  lens.family = family;
  const auto [width, height] = kSizes[random.below(kSizes.size())];
  lens.width = width;
  lens.height = height;
  const double f = width / view;
  lens.intrinsics = {f, f * random.uniform(0.995, 1.005), width * random.uniform(0.47, 0.53),
                     height * random.uniform(0.47, 0.53)};
  return lens;
}

/// Between an ideal pinhole (0) and a lens whose angle is its radius (1), as Brown's series has it.
void bend(Random& random, SourceLens& lens) {
  const double share = random.uniform(-0.2, 0.9);
  auto& k = lens.distortion;
  k[0] = -share / 3 + 0.01 * random.normal();
  k[1] = 0.2 * share * std::abs(share) + 0.01 * random.normal();
  k[4] = -0.05 * share * share * share + 0.003 * random.normal();
  k[2] = 3e-4 * random.normal();
  k[3] = 3e-4 * random.normal();
}

SourceLens plumbBob(Random& random) {
  const double half = random.uniform(25, 45) * kRadians;
  SourceLens lens = blank(random, "plumb_bob", LensFamily::kBrown, 2 * std::tan(half));
  bend(random, lens);
  return lens;
}

/// Numerator and denominator nearly cancel, as those of calibrations do.
SourceLens rational(Random& random) {
  SourceLens lens = plumbBob(random);
  lens.name = "rational_polynomial";
  auto& k = lens.distortion;
  const double k4 = random.uniform(-0.3, 0.5);
  const double k5 = random.uniform(-0.1, 0.1);
  const double k6 = 0.02 * random.normal();
  const double k1 = k[0];
  const double k2 = k[1];
  k[4] += k1 * k5 + k2 * k4 + k6;
  k[1] += k1 * k4 + k5;
  k[0] += k4;
  k[5] = k4;
  k[6] = k5;
  k[7] = k6;
  return lens;
}

SourceLens fourteen(Random& random) {
  SourceLens lens = rational(random);
  lens.name = "OpenCV 14";
  for (std::size_t i = 8; i < 12; ++i) lens.distortion[i] = 3e-4 * random.normal();
  for (std::size_t i = 12; i < 14; ++i) lens.distortion[i] = 3e-3 * random.normal();
  return lens;
}

SourceLens equidistant(Random& random) {
  SourceLens lens =
      blank(random, "equidistant", LensFamily::kEquidistant, random.uniform(90, 170) * kRadians);
  double sigma = 0.02;
  for (std::size_t i = 0; i < 4; ++i, sigma *= 0.25) lens.distortion[i] = sigma * random.normal();
  return lens;
}

SourceLens omni(Random& random) {
  const double xi = random.uniform(0.6, 2);
  SourceLens lens = blank(random, "omni-radtan", LensFamily::kOmni, 1);
  lens.shape[0] = xi;
  const double half = random.uniform(45, 80) * kRadians;
  const double f = 0.5 * lens.width * (std::cos(half) + xi) / std::sin(half);
  lens.intrinsics.head<2>() *= f / lens.intrinsics[0];
  lens.distortion = {0.1 * random.normal(), 0.1 * random.normal(), 3e-4 * random.normal(),
                     3e-4 * random.normal()};
  return lens;
}

SourceLens doubleSphere(Random& random) {
  SourceLens lens = blank(random, "ds", LensFamily::kDoubleSphere, random.uniform(1.8, 3.2));
  lens.shape = {random.uniform(-0.3, 0.2), random.uniform(0.5, 0.65)};
  lens.intrinsics.head<2>() *= 1 + lens.shape[0];
  return lens;
}

SourceLens extendedUnified(Random& random) {
  SourceLens lens = blank(random, "eucm", LensFamily::kExtendedUnified, random.uniform(1.6, 2.7));
  lens.shape = {random.uniform(0.5, 0.66), random.uniform(0.9, 1.3)};
  return lens;
}

SourceLens fieldOfView(Random& random) {
  SourceLens lens = blank(random, "fov", LensFamily::kFieldOfView, random.uniform(1, 2));
  lens.shape[0] = random.uniform(0.5, 1.2);
  return lens;
}

struct ModelCase {
  const char* name;
  SourceLens (*make)(Random&);
  double least_accepted;  ///< share of a thousand random cameras
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// The stated residual against the oracle's on random pixels.
void checkAgainstOracle(Random& random, const SourceLens& lens, const LensFit& fit) {
  double sum = 0;
  double max = 0;
  int seen = 0;
  for (int i = 0; i < kPixels; ++i) {
    Vector3d ray;
    Vector2d truth;
    if (!randomSight(random, lens, fit, ray, truth)) continue;
    Vector2d pixel;
    REQUIRE(fit.model.project(ray, pixel));
    max = std::max(max, (pixel - truth).norm());
    sum += (pixel - truth).squaredNorm();
    ++seen;
  }
  INFO(lens.name << " " << lens.width << "x" << lens.height << ", f " << lens.intrinsics[0] << ", "
                 << fit.words);
  REQUIRE(seen > kPixels / 2);
  // Between the rays of the fit the residual rises by some hundredths of itself; OpenCV's omni rounds to
  // 1e-8.
  constexpr double kBetweenRays = 1.1;
  constexpr double kRounding = 1e-5;
  CHECK(max <= kBetweenRays * fit.max + kRounding);
  // The pixels are few: one of them may be the worst corner.
  constexpr double kSampling = 1.5;
  CHECK(std::sqrt(sum / seen) <= std::hypot(kSampling * fit.rms, fit.max / std::sqrt(seen)) + kRounding);
}

TEST_CASE("random cameras of every model: the residual is as stated", "[lens_fit][long]") {
  const ModelCase model =
      GENERATE(ModelCase{"plumb_bob", &plumbBob, 0.92}, ModelCase{"rational_polynomial", &rational, 0.91},
               ModelCase{"OpenCV 14", &fourteen, 0.72}, ModelCase{"equidistant", &equidistant, 0.99},
               ModelCase{"omni-radtan", &omni, 0.93}, ModelCase{"ds", &doubleSphere, 0.99},
               ModelCase{"eucm", &extendedUnified, 0.99}, ModelCase{"fov", &fieldOfView, 0.99});
  Random random(35);
  std::vector<double> rms;
  std::vector<double> max;
  int partly = 0;
  int refused = 0;
  const int cameras = longOr(1000, 12);
  for (int i = 0; i < cameras; ++i) {
    const SourceLens lens = model.make(random);
    LensFit fit;
    Warnings warnings;
    try {
      fit = convertLens(lens, {"lens", 1, "intrinsics"}, warnings);
    } catch (const InputError&) {
      ++refused;
      continue;
    }
    if (!warnings.empty()) ++partly;
    rms.push_back(fit.rms);
    max.push_back(fit.max);
    checkAgainstOracle(random, lens, fit);
  }
  const double accepted = 1 - static_cast<double>(refused) / cameras;
  const auto below = std::count_if(max.begin(), max.end(), [](double m) { return m <= kMaxLensRms; });
  std::printf(
      "%-20s %4d cameras, %5.1f %% accepted (%5.1f %% also by their maximum), %d in part of the image; px "
      "RMS %.4f "
      "median %.4f 95 %% %.4f most; px maximum %.4f median %.4f 95 %% %.4f most\n",
      model.name, cameras, 100 * accepted, 100 * static_cast<double>(below) / cameras, partly,
      quantile(rms, 0.5), quantile(rms, 0.95), quantile(rms, 1), quantile(max, 0.5), quantile(max, 0.95),
      quantile(max, 1));
  constexpr double kFew = 0.5;  // of a dozen
  CHECK(accepted >= longOr(model.least_accepted, kFew));
}

}  // namespace
}  // namespace swiftlet
