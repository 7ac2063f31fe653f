#pragma once
// Variables besides the body states, in a fixed number of slots: explicit landmarks (with their own columns)
// and planes.
//
// Each has three columns (kExtraDim):
//  - explicit landmark: its position, world, m; the step is added.
//  - plane n . p = d: two tangent coordinates of the unit normal n (rad), and d (m), world. n moves along the
//    geodesic; the step of d is added.
// The tangent basis belongs to the plane and moves with its normal (a rotation whose z axis is n). A basis
// computed from n would be discontinuous somewhere, and the prior is expressed in the basis of its reference.
// Where body states are numbered too (prior, involved variables), slots are numbered from kMaxStates: first
// the landmarks, then the planes. Memory: 0.4 kB per slot.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

#include "estimator/core/limits.hpp"

namespace swiftlet {

inline constexpr int kExtraDim = 3;
inline constexpr std::size_t kMaxExtraStates = kMaxExplicitLandmarks + kMaxPlanes;
/// No extra state, as an index.
inline constexpr std::uint8_t kNoExtra = 255;
static_assert(kMaxStates + kMaxExtraStates < kNoExtra, "slots are bytes");

/// Keeps undetermined columns (a plane without points, a landmark with one observation) from being singular.
/// Used only in the solve, not in the prior. It corresponds to sigmas of a kilometre and a thousand radian,
/// ten orders of magnitude below an observation.
inline constexpr double kWeakInformation = 1e-6;  // 1/m^2, 1/rad^2

/// Unique within one smoother.
using PlaneId = std::uint64_t;

/// n . p = d. The tangent basis is arbitrary, so planes are compared by normal and distance.
class Plane {
 public:
  Plane() = default;
  /// `normal`: any length but zero, world. `distance` [m]: for the normalized normal.
  Plane(const Eigen::Vector3d& normal, double distance);

  [[nodiscard]] Eigen::Vector3d normal() const { return rotation_ * Eigen::Vector3d::UnitZ(); }
  [[nodiscard]] double distance() const { return distance_; }
  /// d normal / d (first two columns): orthonormal columns, orthogonal to the normal.
  [[nodiscard]] Eigen::Matrix<double, 3, 2> basis() const {
    return rotation_.toRotationMatrix().leftCols<2>();
  }
  /// n . p - d, m.
  [[nodiscard]] double height(const Eigen::Vector3d& p) const { return normal().dot(p) - distance_; }

  /// plane <- plane [+] delta.
  void retract(const Eigen::Vector3d& delta);
  /// this [-] reference, in the basis of `reference`: the delta from `reference` to this. Normals are at most
  /// pi apart; between opposite ones the direction is that of the first basis vector.
  [[nodiscard]] Eigen::Vector3d minus(const Plane& reference) const;

 private:
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();  // its z axis is the normal
  double distance_ = 0;
};

enum class ExtraKind : std::uint8_t { kNone, kLandmark, kPlane };

/// The value of a slot; its kind tells which member is used.
struct ExtraValue {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< m, world
  Plane plane;
};

struct ExtraState {
  ExtraKind kind = ExtraKind::kNone;
  bool in_prior = false;       ///< is or was part of the prior
  bool leaving = false;        ///< leaves with the next marginalization
  bool settled = false;        ///< for a plane: its points determine it, so its factors are used
  std::uint32_t landmark = 0;  ///< index of its landmark
  PlaneId id = 0;              ///< of a plane
  ExtraValue x;
  ExtraValue reference;  ///< the prior's
  ExtraValue backup;
  int offset = -1;         ///< first column in the normal equations
  int factor_offset = -1;  ///< first column in the factor of the last solve

  [[nodiscard]] bool isLandmark() const { return kind == ExtraKind::kLandmark; }
  [[nodiscard]] bool isPlane() const { return kind == ExtraKind::kPlane; }

  void retract(const Eigen::Vector3d& delta);
  /// x [-] reference.
  [[nodiscard]] Eigen::Vector3d deviation() const;
  /// Makes x the reference of the prior, of which it is a part from now on.
  void enterPrior();
};

}  // namespace swiftlet
