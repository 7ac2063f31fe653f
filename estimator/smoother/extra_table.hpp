#pragma once
// Explicit landmarks and planes of the window: their slots and factors, and how they enter and leave.
//
// Slots 0 to kMaxExplicitLandmarks - 1 are for landmarks, the others for planes. An extra state that leaves
// is marked, goes into the prior with the next marginalization (marginalization.hpp), and is then freed; if
// it is not in the prior, it is freed at once. Memory: 45 kB. Cost of each call: linear in slots and factors.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/smoother/extra_factors.hpp"
#include "estimator/smoother/landmark_table.hpp"

namespace swiftlet {

/// Largest number of factors: each explicit landmark on two planes, each plane with a direction.
inline constexpr std::size_t kMaxExtraFactors = 2 * kMaxExplicitLandmarks + kMaxPlanes;

class ExtraTable {
 public:
  explicit ExtraTable(LandmarkTable& landmarks) : landmarks_(landmarks) {}

  void clear();

  // As in Smoother.
  Status promote(TrackId id);
  [[nodiscard]] bool promoted(TrackId id) const;
  std::optional<PlaneId> addPlane(const Plane& plane);
  Status addPointOnPlane(TrackId id, PlaneId plane, double sigma);
  Status addPlaneDirection(PlaneId plane, PlaneDirection direction, double sigma);
  void removePointOnPlane(TrackId id, PlaneId plane);
  /// True if the plane is in the prior and was marked as leaving; false if it was removed.
  bool removePlane(PlaneId plane);
  [[nodiscard]] const ExtraState* findPlane(PlaneId id) const;
  [[nodiscard]] int pointsOn(const ExtraState& plane) const;
  [[nodiscard]] std::size_t count(ExtraKind kind) const;

  [[nodiscard]] std::array<ExtraState, kMaxExtraStates>& states() { return extras_; }
  [[nodiscard]] const std::array<ExtraState, kMaxExtraStates>& states() const { return extras_; }
  [[nodiscard]] const FixedVector<ExtraFactor, kMaxExtraFactors>& factors() const { return factors_; }
  [[nodiscard]] std::uint8_t indexOf(const ExtraState& extra) const {
    return static_cast<std::uint8_t>(&extra - extras_.data());
  }
  /// Whitened and weighted.
  void linearize(const ExtraFactor& factor, LinearFactor& linear) const;
  /// Whether a factor is used: not before the plane's points determine it.
  [[nodiscard]] bool counts(const ExtraFactor& factor) const { return extras_[factor.plane].settled; }
  /// Fits new planes to their points before their factors are used.
  void settlePlanes();

  /// Assigns columns; returns the first one after them. columns(): their number.
  int assignOffsets(int first);
  [[nodiscard]] int columns() const { return columns_; }
  void retract(const Eigen::Ref<const Eigen::VectorXd>& step);
  void backup();
  void restore();

  /// Removes a landmark that does not fit. Only its part of the prior remains.
  void discard(Landmark& landmark);
  /// Marks explicit landmarks as leaving by the rule of structureless ones: with a keyframe, if no frame from
  /// `oldest_recent` on sees them. Planes leave with their last point.
  void markDepartures(std::uint8_t slot, std::uint64_t oldest_recent);
  [[nodiscard]] bool departs(const ExtraFactor& factor) const;
  void vacate(ExtraState& extra);
  /// Marks landmarks without observation and planes without point, and frees those that are not in the prior.
  /// True if the others need a marginalization.
  bool release();

 private:
  ExtraState* findFree(std::size_t first, std::size_t last);
  ExtraState* findPlaneToChange(PlaneId id) { return const_cast<ExtraState*>(findPlane(id)); }
  void follow(const ExtraState& extra);
  double linearizePlane(const ExtraState& plane, Eigen::Matrix3d& H, Eigen::Vector3d& g) const;
  void dropFactorsOf(std::uint8_t extra);
  void markBarePlanes();

  LandmarkTable& landmarks_;
  std::array<ExtraState, kMaxExtraStates> extras_;
  FixedVector<ExtraFactor, kMaxExtraFactors> factors_;
  int columns_ = 0;
  PlaneId next_plane_ = 1;
};

}  // namespace swiftlet
