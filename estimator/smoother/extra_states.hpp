#pragma once
// Variables beside the body states, in slots of fixed number: landmarks with columns of their own, planes.
//
// Each has three columns (kExtraDim):
//  - explicit landmark: its position, world, m; it adds.
//  - plane n . p = d: two tangent coordinates of the unit normal n (rad), and d (m), world. n moves along the
//    geodesic, d adds.
// The tangent basis is the plane's own, carried along as its normal moves (a rotation whose z axis is n): a
// basis made anew from n would jump somewhere, and what the prior says is written in the basis of the first
// estimate.
// Slots are numbered from kMaxStates on wherever body states are numbered too (prior, involved variables):
// first the landmarks, then the planes. First estimates as for body states (docs/smoother.md).
// Memory: 0.5 kB a slot.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

#include "estimator/core/limits.hpp"

namespace swiftlet {

inline constexpr int kExtraDim = 3;
inline constexpr std::size_t kMaxExtraStates = kMaxExplicitLandmarks + kMaxPlanes;
/// Index of an extra state; this one is none.
inline constexpr std::uint8_t kNoExtra = 255;
static_assert(kMaxStates + kMaxExtraStates < kNoExtra, "slots are bytes");

/// Keeps columns that nothing determines (a plane without points, a landmark that one camera sees once) from
/// being singular; only in the solve, not in what goes into the prior. A kilometre and a thousand radian: ten
/// orders below a sighting.
inline constexpr double kWeakInformation = 1e-6;  // 1/m^2, 1/rad^2

/// Of one smoother: never given twice.
using PlaneId = std::uint64_t;

/// n . p = d. The tangent basis is arbitrary; two planes compare by normal and distance.
class Plane {
 public:
  Plane() = default;
  /// `normal`: any length but zero, world; `distance` [m] in units of the normalized one.
  Plane(const Eigen::Vector3d& normal, double distance);

  [[nodiscard]] Eigen::Vector3d normal() const { return rotation_ * Eigen::Vector3d::UnitZ(); }
  [[nodiscard]] double distance() const { return distance_; }
  /// d normal / d (first two columns): orthonormal, orthogonal to the normal.
  [[nodiscard]] Eigen::Matrix<double, 3, 2> basis() const {
    return rotation_.toRotationMatrix().leftCols<2>();
  }
  /// n . p - d, m.
  [[nodiscard]] double height(const Eigen::Vector3d& p) const { return normal().dot(p) - distance_; }

  /// plane <- plane [+] delta.
  void retract(const Eigen::Vector3d& delta);
  /// this [-] reference, in the basis of `reference`: the delta that takes it here. Normals at most pi apart;
  /// opposite ones have no direction between them, and get one along the first basis vector.
  [[nodiscard]] Eigen::Vector3d minus(const Plane& reference) const;
  /// Follows a translation of the world.
  void translate(const Eigen::Vector3d& shift) { distance_ += normal().dot(shift); }

 private:
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();  // its z axis is the normal
  double distance_ = 0;
};

enum class ExtraKind : std::uint8_t { kNone, kLandmark, kPlane };

/// The member that the slot's kind names.
struct ExtraValue {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< m, world
  Plane plane;
};

struct ExtraState {
  ExtraKind kind = ExtraKind::kNone;
  bool frozen = false;         ///< the prior touches it, or did: Jacobians at `moved_estimate`
  bool leaving = false;        ///< goes with the next marginalization
  bool settled = false;        ///< a plane that its points determine: from then on its factors count
  std::uint32_t landmark = 0;  ///< index of its landmark
  PlaneId id = 0;              ///< of a plane
  ExtraValue x;
  ExtraValue first_estimate;  ///< the prior's reference
  ExtraValue moved_estimate;  ///< first_estimate, moved with the window
  ExtraValue backup;
  int offset = -1;         ///< first column in the normal equations
  int factor_offset = -1;  ///< and in the factor of the last solve

  [[nodiscard]] bool isLandmark() const { return kind == ExtraKind::kLandmark; }
  [[nodiscard]] bool isPlane() const { return kind == ExtraKind::kPlane; }
  /// Where Jacobians are taken.
  [[nodiscard]] const ExtraValue& linearization() const { return frozen ? moved_estimate : x; }

  void retract(const Eigen::Vector3d& delta);
  /// x [-] first_estimate.
  [[nodiscard]] Eigen::Vector3d deviation() const;
  /// From now on x is the first estimate; nothing when there is one already.
  void freeze();
  /// Moves the linearization point, not the prior's reference.
  void translateEstimate(const Eigen::Vector3d& shift);
};

}  // namespace swiftlet
