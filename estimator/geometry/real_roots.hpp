#pragma once
// Real roots of a polynomial, for the minimal solvers.

#include <array>
#include <cstddef>

#include "estimator/core/fixed_vector.hpp"

namespace swiftlet {

inline constexpr std::size_t kMaxDegree = 10;

/// Coefficients in ascending order of powers.
using Polynomial = std::array<double, kMaxDegree + 1>;

/// All real roots of sum c[i] x^i, i <= degree <= kMaxDegree, in no particular order; roots of even
/// multiplicity may be missed. A polynomial has at most one root between two neighbouring extrema, so the
/// roots of each derivative bracket those of the polynomial one degree higher, starting from the linear one.
/// Roots beyond +-1 are found as inverse roots of the reversed polynomial, so that every bracket is within
/// [-1, 1]. About 3 us for degree 10. Bounded: at most 2 * 55 brackets of 60 steps.
FixedVector<double, kMaxDegree> realRoots(const Polynomial& coefficients, std::size_t degree);

}  // namespace swiftlet
