#include "drivers/calibration/lens_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/NonLinearOptimization>
#include <unsupported/Eigen/NumericalDiff>
#include <vector>

namespace swiftlet {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
constexpr int kParameters = 8;
using Parameters = Eigen::VectorXd;  // fx fy cx cy and four coefficients

// Number of directions, and rays in each. The residual is smooth, with about five extrema from the centre to
// a corner, and rises by less than a tenth of its maximum between two rays.
constexpr int kBorderPoints = 120;
constexpr int kRays = 48;
constexpr double kThetaStep = 2e-3;  // rad; a fold affects the whole lens, so no ray needs a finer step
// Smallest derivative of the radius by the angle, as a share of that at the axis. Below it the lens is about
// to fold back, which only polynomials do, and one pixel of noise means ten times the usual angle.
constexpr double kLeastGrowth = 0.1;
constexpr double kBorder = 0.5;  // px; the image ends at the edge of its outermost pixels
constexpr int kBisections = 40;
constexpr double kLeastCovered = 0.5;
constexpr double kToldCovered = 0.995;
// Largest difference between a ray's pixel and the reprojection of that pixel's ray where the lens is
// invertible [px].
constexpr double kInverseTolerance = 1e-3;
constexpr int kMaxEvaluations = 200;
// Residual of a ray that the target model does not see, so that the optimizer turns back [px].
constexpr double kUnseen = 1e3;

struct Ray {
  Vector3d direction;  ///< unit
  Vector2d pixel;
  double weight = 0;  ///< [px^2] image area
};

struct Region {
  std::vector<Ray> rays;
  double covered = 0;
};

/// One direction outward from the optical axis.
class Meridian {
 public:
  Meridian(const SourceLens& lens, const Vector2d& border_pixel) : lens_(lens) {
    const Vector2d out =
        (border_pixel - lens.intrinsics.tail<2>()).cwiseQuotient(lens.intrinsics.head<2>()).normalized();
    along_ = {out.x(), out.y(), 0};
  }
  [[nodiscard]] Vector3d direction(double theta) const {
    return std::sin(theta) * along_ + Vector3d(0, 0, std::cos(theta));
  }
  /// Pixel at an angle, and its distance from the principal point in focal lengths; false if the lens has
  /// none.
  bool at(double theta, Vector2d& pixel, double& radius) const {
    if (!lens_.project(direction(theta), pixel)) return false;
    radius = (pixel - lens_.intrinsics.tail<2>()).cwiseQuotient(lens_.intrinsics.head<2>()).norm();
    return true;
  }
  [[nodiscard]] bool inImage(const Vector2d& pixel) const {
    return pixel.x() >= -kBorder && pixel.y() >= -kBorder && pixel.x() <= lens_.width - 1 + kBorder &&
           pixel.y() <= lens_.height - 1 + kBorder;
  }
  /// Largest angle within the image up to which the radius still grows fast enough.
  [[nodiscard]] double end(bool& folds) const {
    double theta = 0;
    double radius = 0;
    Vector2d pixel;
    double next_radius = 0;
    const double least_step = at(kThetaStep, pixel, next_radius) ? kLeastGrowth * next_radius : 0;
    for (folds = true; theta + kThetaStep < std::numbers::pi; theta += kThetaStep) {
      if (!at(theta + kThetaStep, pixel, next_radius) || next_radius - radius <= least_step) return theta;
      if (!inImage(pixel)) {
        folds = false;
        break;
      }
      radius = next_radius;
    }
    double low = theta;
    double high = theta + kThetaStep;
    for (int i = 0; i < kBisections; ++i) {
      const double middle = 0.5 * (low + high);
      const bool inside = at(middle, pixel, next_radius) && inImage(pixel);
      (inside ? low : high) = middle;
    }
    return low;
  }

 private:
  const SourceLens& lens_;
  Vector3d along_;
};

/// Points around the image's border, including the four corners.
std::vector<Vector2d> borderPoints(int width, int height) {
  const double right = width - 1 + kBorder;
  const double bottom = height - 1 + kBorder;
  std::vector<Vector2d> points;
  constexpr int kSide = kBorderPoints / 4;
  for (int i = 0; i < kSide; ++i) {
    const double share = static_cast<double>(i) / kSide;
    const double x = -kBorder + share * (right + kBorder);
    const double y = -kBorder + share * (bottom + kBorder);
    points.insert(
        points.end(),
        {{x, -kBorder}, {right, y}, {right - kBorder - x, bottom}, {-kBorder, bottom - kBorder - y}});
  }
  return points;
}

Region regionOf(const SourceLens& lens) {
  Region region;
  double reached = 0;
  double wanted = 0;
  for (const Vector2d& border : borderPoints(lens.width, lens.height)) {
    const Meridian meridian(lens, border);
    bool folds = false;
    const double end = meridian.end(folds);
    const double border_radius = (border - lens.intrinsics.tail<2>()).norm();
    double last = 0;
    for (int i = 1; i <= kRays; ++i) {
      Ray ray;
      double radius = 0;
      const double theta = end * i / kRays;
      if (!meridian.at(theta, ray.pixel, radius)) break;
      ray.direction = meridian.direction(theta);
      const double distance = (ray.pixel - lens.intrinsics.tail<2>()).norm();
      ray.weight = distance * (distance - last);
      last = distance;
      region.rays.push_back(ray);
    }
    wanted += border_radius * border_radius;
    reached +=
        folds ? std::min(last, border_radius) * std::min(last, border_radius) : border_radius * border_radius;
  }
  region.covered = reached / wanted;
  return region;
}

CameraModel modelOf(CameraKind kind, const SourceLens& source, const Parameters& p) {
  return {kind, source.width, source.height, p.head<4>(), p.tail<4>()};
}

/// Cost function for the optimizer: two residuals per ray.
struct Residuals {
  using Scalar = double;
  using InputType = Parameters;
  using ValueType = Eigen::VectorXd;
  using JacobianType = Eigen::MatrixXd;
  // NOLINTNEXTLINE(readability-identifier-naming): Eigen looks for these names
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };

  CameraKind kind = CameraKind::kEquidistant;
  const SourceLens& source;
  const Region& region;

  [[nodiscard]] int inputs() const { return kParameters; }
  [[nodiscard]] int values() const { return 2 * static_cast<int>(region.rays.size()); }
  int operator()(const InputType& parameters, ValueType& residuals) const {
    const CameraModel model = modelOf(kind, source, parameters);
    for (std::size_t i = 0; i < region.rays.size(); ++i) {
      const Ray& ray = region.rays[i];
      Vector2d pixel;
      const bool seen = model.project(ray.direction, pixel);
      const Vector2d residual = seen ? Vector2d(pixel - ray.pixel) : Vector2d::Constant(kUnseen);
      residuals.segment<2>(2 * static_cast<Eigen::Index>(i)) = std::sqrt(ray.weight) * residual;
    }
    return 0;
  }
};

/// RMS and maximum over the region; infinite if the model cannot project and unproject every ray.
void measure(const Region& region, LensFit& fit) {
  fit.rms = fit.max = std::numeric_limits<double>::infinity();
  double max = 0;
  double sum = 0;
  double weights = 0;
  for (const Ray& ray : region.rays) {
    Vector2d pixel;
    Vector3d back;
    if (!fit.model.project(ray.direction, pixel) || !fit.model.unproject(pixel, back) ||
        (back - ray.direction).norm() * fit.model.focal() > kInverseTolerance) {
      return;
    }
    const double error = (pixel - ray.pixel).norm();
    max = std::max(max, error);
    sum += ray.weight * error * error;
    weights += ray.weight;
  }
  fit.max = max;
  fit.rms = std::sqrt(sum / weights);
}

/// Pixels per radian at the axis.
Vector2d focalAtAxis(const SourceLens& source) {
  constexpr double kSmall = 1e-4;
  Vector2d centre;
  Vector2d x;
  Vector2d y;
  if (!source.project({0, 0, 1}, centre) || !source.project({kSmall, 0, 1}, x) ||
      !source.project({0, kSmall, 1}, y)) {
    return source.intrinsics.head<2>();
  }
  return {(x - centre).x() / kSmall, (y - centre).y() / kSmall};
}

LensFit fitKind(CameraKind kind, const SourceLens& source, const Region& region) {
  Parameters parameters = Parameters::Zero(kParameters);
  parameters.head<2>() = focalAtAxis(source);
  parameters.segment<2>(2) = source.intrinsics.tail<2>();
  const Residuals residuals{kind, source, region};
  Eigen::NumericalDiff<Residuals, Eigen::Central> differentiated(residuals);
  Eigen::LevenbergMarquardt<decltype(differentiated)> optimizer(differentiated);
  optimizer.parameters.maxfev = kMaxEvaluations;
  optimizer.minimize(parameters);
  LensFit fit;
  fit.covered = region.covered;
  fit.rms = fit.max = std::numeric_limits<double>::infinity();
  if (!parameters.allFinite() || parameters[0] <= 0 || parameters[1] <= 0) return fit;
  fit.model = modelOf(kind, source, parameters);
  measure(region, fit);
  return fit;
}

/// Whether one of the estimator's models contains the source; if so, `fit` is that model.
bool exactly(const SourceLens& source, LensFit& fit) {
  const bool brown = source.family == LensFamily::kBrown;
  if (!brown && source.family != LensFamily::kEquidistant) return false;
  const auto& k = source.distortion;
  if (std::any_of(k.begin() + 4, k.end(), [](double v) { return v != 0; })) return false;
  fit.exact = true;
  fit.model = {brown ? CameraKind::kPinholeRadtan : CameraKind::kEquidistant, source.width, source.height,
               source.intrinsics, Eigen::Vector4d(k.data())};
  return true;
}

const char* nameOf(CameraKind kind) {
  return kind == CameraKind::kEquidistant ? "equidistant" : "pinhole radial-tangential";
}

std::string wordsOf(const LensFit& fit, const SourceLens& source) {
  if (!std::isfinite(fit.rms)) {
    return fmt::format("neither equidistant nor pinhole radial-tangential comes near the {} lens",
                       source.name);
  }
  return fmt::format("{} as {}: {:.3f} px RMS, maximum {:.3f} px", source.name, nameOf(fit.model.kind()),
                     fit.rms, fit.max);
}

}  // namespace

LensFit fitLens(const SourceLens& source, const InputPlace& place) {
  LensFit fit;
  if (exactly(source, fit)) return fit;
  const Region region = regionOf(source);
  if (!(region.covered >= kLeastCovered)) {
    throw place.error(fmt::format("the {} lens has no inverse in {:.0f} % of the image", source.name,
                                  100 * (1 - region.covered)),
                      "The coefficients are for another order, image size or model: compare with the file "
                      "written by the calibration tool");
  }
  const LensFit wide = fitKind(CameraKind::kEquidistant, source, region);
  const LensFit narrow = fitKind(CameraKind::kPinholeRadtan, source, region);
  fit = narrow.rms < wide.rms ? narrow : wide;
  fit.words = wordsOf(fit, source);
  return fit;
}

LensFit convertLens(const SourceLens& source, const InputPlace& place, Warnings& warnings) {
  LensFit fit = fitLens(source, place);
  if (!(fit.rms <= kMaxLensRms)) {
    throw place.error(
        fmt::format("{}; above {} px RMS it is rejected", fit.words, kMaxLensRms),
        "Calibrate again as pinhole-radtan, or as pinhole-equi for a wide lens, over the whole image");
  }
  if (fit.covered < kToldCovered) {
    warnings.push_back(
        place.where() +
        fmt::format(": the {} lens folds back in {:.1f} % of the image; points there are not usable",
                    source.name, 100 * (1 - fit.covered)));
  }
  return fit;
}

}  // namespace swiftlet
