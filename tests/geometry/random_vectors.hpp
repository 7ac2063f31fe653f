#pragma once
// Vectors drawn for the tests of this room.

#include <Eigen/Core>

#include "estimator/core/random.hpp"

namespace swiftlet::test {

/// Components of standard deviation 1.
inline Eigen::Vector3d normalVector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

/// Directions of equal probability.
inline Eigen::Vector3d unitVector(Random& random) {
  return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
}

}  // namespace swiftlet::test
