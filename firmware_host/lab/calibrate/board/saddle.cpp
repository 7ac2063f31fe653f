#include "firmware_host/lab/calibrate/board/saddle.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace swiftlet {
namespace {

constexpr int kParameters = 11;  // c, angles, log blur, a, g, b, curvatures [1/px]
using Parameters = Eigen::Matrix<double, kParameters, 1>;
using Normals = Eigen::Matrix<double, kParameters, kParameters>;

constexpr int kMaxSteps = 25;
constexpr double kConverged = 2e-3;    ///< px; a fraction of the noise
constexpr double kFirstBlur = 0.7;     ///< px, for a sharp image: pixel and lens
constexpr double kLeastBlur = 0.3;     ///< px; below it the pixel's own width dominates
constexpr double kMostBlur = 0.7;      ///< of the radius; beyond it the window has no plain area
constexpr double kMostTurn = 0.6;      ///< rad, between an edge and its guess
constexpr double kLeastContrast = 4;   ///< grey values, half of black to white
constexpr double kMostResidual = 0.3;  ///< of the contrast
/// px between fit and window. More than half a pixel, so that a corner between two pixels does not move the
/// window forever.
constexpr double kMostOffCentre = 0.8;
constexpr double kMostSigma = 0.25;  ///< px

/// erf(x / sqrt 2) and its slope from a table: the fit evaluates it 200 times per step.
class ErrorFunction {
 public:
  ErrorFunction() {
    for (std::size_t i = 0; i < table_.size(); ++i) {
      const double x = static_cast<double>(i) / kPerUnit;
      table_[i] = {std::erf(x / std::numbers::sqrt2),
                   std::sqrt(2 / std::numbers::pi) * std::exp(-0.5 * x * x)};
    }
  }
  void operator()(double x, double& value, double& slope) const {
    const double scaled = std::min(std::abs(x), kEnd) * kPerUnit;
    const auto index = static_cast<std::size_t>(scaled);
    const double part = scaled - static_cast<double>(index);
    const std::array<double, 2>& low = table_[index];
    const std::array<double, 2>& high = table_[index + 1];
    value = std::copysign(low[0] + part * (high[0] - low[0]), x);
    slope = low[1] + part * (high[1] - low[1]);
  }

 private:
  static constexpr double kEnd = 5;
  static constexpr double kPerUnit = 256;
  std::array<std::array<double, 2>, static_cast<std::size_t>(kEnd* kPerUnit) + 2> table_{};
};

struct Window {
  int left = 0;
  int top = 0;
  int size = 0;

  [[nodiscard]] Eigen::Vector2d centre() const { return {left + 0.5 * (size - 1), top + 0.5 * (size - 1)}; }
};

bool place(const ImageView& image, const Eigen::Vector2d& centre, double radius, Window& window) {
  const int half = static_cast<int>(std::lround(radius));
  window.size = 2 * half + 1;
  if (!(centre.array().abs() < 1e6).all()) return false;
  window.left = static_cast<int>(std::lround(centre.x())) - half;
  window.top = static_cast<int>(std::lround(centre.y())) - half;
  return window.left >= 0 && window.top >= 0 && window.left + window.size <= image.width &&
         window.top + window.size <= image.height;
}

/// Sum of squared residuals; also the normal equations if requested.
double evaluate(const ImageView& image, const Window& window, const Parameters& p, Normals* H,
                Parameters* g) {
  static const ErrorFunction error_function;
  const double blur = std::exp(p[4]);
  const double c1 = std::cos(p[2]);
  const double s1 = std::sin(p[2]);
  const double c2 = std::cos(p[3]);
  const double s2 = std::sin(p[3]);
  double cost = 0;
  if (H != nullptr) {
    H->setZero();
    g->setZero();
  }
  for (int row = 0; row < window.size; ++row) {
    const std::uint8_t* grey = image.row(window.top + row) + window.left;
    const double y = window.top + row - p[1];
    for (int column = 0; column < window.size; ++column) {
      const double x = window.left + column - p[0];
      const double along1 = c1 * x + s1 * y;
      const double along2 = c2 * x + s2 * y;
      const double bend1 = 0.5 * (along1 * along1 + blur * blur);
      const double bend2 = 0.5 * (along2 * along2 + blur * blur);
      const double t1 = (-s1 * x + c1 * y - p[9] * bend1) / blur;
      const double t2 = (-s2 * x + c2 * y - p[10] * bend2) / blur;
      double e1 = 0;
      double d1 = 0;
      double e2 = 0;
      double d2 = 0;
      error_function(t1, e1, d1);
      error_function(t2, e2, d2);
      const double light = 1 + p[6] * x + p[7] * y;
      const double flat = p[5] + p[8] * e1 * e2;
      const double residual = grey[column] - light * flat;
      cost += residual * residual;
      if (H == nullptr) continue;
      const double k1 = light * p[8] * d1 * e2;
      const double k2 = light * p[8] * e1 * d2;
      Parameters J;
      // The curvature's contribution to the first four is a hundredth and is neglected.
      J[0] = (k1 * s1 + k2 * s2) / blur - p[6] * flat;
      J[1] = (-k1 * c1 - k2 * c2) / blur - p[7] * flat;
      J[2] = -k1 * along1 / blur;
      J[3] = -k2 * along2 / blur;
      J[4] = -k1 * t1 - k2 * t2;
      J[5] = light;
      J[6] = x * flat;
      J[7] = y * flat;
      J[8] = light * e1 * e2;
      J[9] = -k1 * bend1 / blur;
      J[10] = -k2 * bend2 / blur;
      H->noalias() += J * J.transpose();
      *g += residual * J;
    }
  }
  return cost;
}

/// Initial shading and contrast from the means of the four areas; edges as guessed.
Parameters begin(const ImageView& image, const Window& window, const SaddleGuess& guess, double angle1,
                 double angle2) {
  std::array<double, 2> sum{};
  std::array<int, 2> count{};
  for (int row = 0; row < window.size; ++row) {
    const std::uint8_t* grey = image.row(window.top + row) + window.left;
    for (int column = 0; column < window.size; ++column) {
      const double x = window.left + column - guess.pixel.x();
      const double y = window.top + row - guess.pixel.y();
      const double side1 = -std::sin(angle1) * x + std::cos(angle1) * y;
      const double side2 = -std::sin(angle2) * x + std::cos(angle2) * y;
      const std::size_t area = side1 * side2 > 0 ? 1 : 0;
      sum[area] += grey[column];
      ++count[area];
    }
  }
  const double low = sum[0] / std::max(1, count[0]);
  const double high = sum[1] / std::max(1, count[1]);
  Parameters p;
  p << guess.pixel, angle1, angle2, std::log(kFirstBlur), 0.5 * (low + high), 0, 0, 0.5 * (high - low), 0, 0;
  return p;
}

}  // namespace

bool refineSaddle(const ImageView& image, const SaddleGuess& guess, Saddle& saddle) {
  const double angle1 = std::atan2(guess.edge1.y(), guess.edge1.x());
  const double angle2 = std::atan2(guess.edge2.y(), guess.edge2.x());
  Window window;
  if (!place(image, guess.pixel, guess.radius, window)) return false;
  Parameters p = begin(image, window, guess, angle1, angle2);
  Normals H;
  Parameters g;
  double damping = 1e-3;
  double cost = evaluate(image, window, p, &H, &g);
  bool done = false;
  for (int step = 0; step < kMaxSteps && !done; ++step) {
    Normals damped = H;
    damped.diagonal() += damping * H.diagonal() + Parameters::Constant(1e-9);
    const Parameters change = damped.ldlt().solve(g);
    Parameters next = p + change;
    next[4] = std::clamp(next[4], std::log(kLeastBlur), std::log(kMostBlur * guess.radius));
    if (!next.allFinite() || (next.head<2>() - guess.pixel).norm() > guess.radius) return false;
    if ((next.head<2>() - window.centre()).cwiseAbs().maxCoeff() > kMostOffCentre) {
      // Another window has another sum: start there, with the shading relative to the new centre.
      if (!place(image, next.head<2>(), guess.radius, window)) return false;
      const double light = 1 + p[6] * change[0] + p[7] * change[1];
      next[5] *= light;
      next[8] *= light;
      p = next;
      cost = evaluate(image, window, p, &H, &g);
      continue;
    }
    const double next_cost = evaluate(image, window, next, nullptr, nullptr);
    if (next_cost > cost) {
      damping = std::max(10 * damping, 1e-3);
      // Noise or the minimum blur prevents the sum from decreasing: the position is found.
      done = damping > 1e4 || change.head<2>().norm() < kConverged;
      continue;
    }
    damping *= 0.1;
    p = next;
    done = change.head<2>().norm() < kConverged;
    cost = evaluate(image, window, p, &H, &g);
  }
  if (!done) return false;

  const auto turned = [](double angle, double from) {
    return std::abs(std::remainder(angle - from, 2 * std::numbers::pi));
  };
  if (turned(p[2], angle1) > kMostTurn || turned(p[3], angle2) > kMostTurn) return false;
  // Between the edges, n1 and n2 point to opposite sides.
  const bool dark = p[8] > 0;
  if (dark != guess.dark_between || std::abs(p[8]) < kLeastContrast) return false;
  const double variance = cost / std::max(1, window.size * window.size - kParameters);
  if (std::sqrt(variance) > kMostResidual * std::abs(p[8])) return false;
  const Eigen::Matrix2d covariance =
      H.ldlt().solve(Eigen::Matrix<double, kParameters, 2>::Identity()).topRows<2>() * variance;
  saddle.pixel = p.head<2>();
  saddle.sigma = std::sqrt(std::max(0.0, 0.5 * covariance.trace()));
  return saddle.sigma < kMostSigma;
}

}  // namespace swiftlet
