#include "estimator/geometry/real_roots.hpp"

#include <cmath>

namespace swiftlet {
namespace {

constexpr int kMaxSteps = 60;             // bisection alone reaches 2^-60 of the bracket
constexpr double kRootTolerance = 1e-14;  // of a bracket within [-1, 1]

struct Brackets {
  std::array<double, kMaxDegree + 2> at{};
  std::size_t count = 0;
};

double evaluate(const Polynomial& c, std::size_t degree, double x) {
  double value = c[degree];
  for (std::size_t i = degree; i-- > 0;) value = value * x + c[i];
  return value;
}

// The root between `low` and `high`, where the polynomial has opposite signs: Newton's method, kept inside
// the bracket by bisection.
double rootBetween(const Polynomial& c, std::size_t degree, double low, double high, double value_low) {
  double x = 0.5 * (low + high);
  for (int step = 0; step < kMaxSteps && high - low > kRootTolerance; ++step) {
    double value = c[degree];
    double slope = 0;
    for (std::size_t i = degree; i-- > 0;) {
      slope = slope * x + value;
      value = value * x + c[i];
    }
    if (value == 0) return x;
    ((value > 0) == (value_low > 0) ? low : high) = x;
    const double newton = x - value / slope;
    const bool inside = newton > low && newton < high;  // false for NaN
    const double next = inside ? newton : 0.5 * (low + high);
    if (std::abs(next - x) < kRootTolerance) return next;
    x = next;
  }
  return x;
}

// Roots of the polynomial in [-1, 1]. On entry `brackets` holds the ends and the extrema between them, on
// return the ends and the roots.
void descend(const Polynomial& c, std::size_t degree, Brackets& brackets) {
  Brackets roots;
  roots.at[roots.count++] = -1.0;
  double low = brackets.at[0];
  double value_low = evaluate(c, degree, low);
  for (std::size_t i = 1; i < brackets.count; ++i) {
    const double high = brackets.at[i];
    const double value_high = evaluate(c, degree, high);
    if ((value_low > 0) != (value_high > 0) && roots.count <= kMaxDegree) {
      roots.at[roots.count++] = rootBetween(c, degree, low, high, value_low);
    }
    low = high;
    value_low = value_high;
  }
  roots.at[roots.count++] = 1.0;
  brackets = roots;
}

void rootsWithinUnit(const Polynomial& c, std::size_t degree, bool invert,
                     FixedVector<double, kMaxDegree>& roots) {
  // derivative[d] has degree d and is the (degree - d)-th derivative, scaled.
  std::array<Polynomial, kMaxDegree + 1> derivative{};
  derivative[degree] = c;
  for (std::size_t d = degree; d > 1; --d) {
    for (std::size_t i = 1; i <= d; ++i) {
      derivative[d - 1][i - 1] = derivative[d][i] * static_cast<double>(i) / static_cast<double>(d);
    }
  }
  Brackets brackets;
  brackets.at[0] = -1.0;
  brackets.at[1] = 1.0;
  brackets.count = 2;
  for (std::size_t d = 1; d <= degree; ++d) descend(derivative[d], d, brackets);
  for (std::size_t i = 1; i + 1 < brackets.count; ++i) {
    const double root = brackets.at[i];
    // The reversed polynomial has a root at zero if the leading coefficient vanishes.
    if (invert && (root == 0 || std::abs(root) == 1.0)) continue;
    if (!roots.tryPushBack(invert ? 1.0 / root : root)) return;
  }
}

}  // namespace

FixedVector<double, kMaxDegree> realRoots(const Polynomial& coefficients, std::size_t degree) {
  FixedVector<double, kMaxDegree> roots;
  if (degree == 0 || degree > kMaxDegree) return roots;
  rootsWithinUnit(coefficients, degree, false, roots);
  Polynomial reversed{};
  for (std::size_t i = 0; i <= degree; ++i) reversed[i] = coefficients[degree - i];
  rootsWithinUnit(reversed, degree, true, roots);
  return roots;
}

}  // namespace swiftlet
