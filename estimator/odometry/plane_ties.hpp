#pragma once
// Landmarks tied to the planes that the mesher found: keeps the smoother's planes in step with its reports.
//
// A report is remembered and worked in before the next step: planes are added with their direction, and of
// the points on them some are promoted and tied: those that the coming frame sees, that several states saw,
// that pass a chi-squared test against the plane as the smoother knows it, best known first, apart from each
// other and spread over the planes. After each solve ties that disagree are taken away: a tied point is
// pulled onto its plane, so what tells is how far it is held off it against how far its own sightings let it
// go (disagrees() in plane_ties.cpp). A point that was refused is not tried again on the same plane for some
// time. Work is bounded by kMaxPlanes and kMaxLandmarks; nothing is allocated; reports of another epoch are
// ignored. Memory: 0.15 MiB inside the object. Cost: that of the columns; with 40 ties a step takes 2.0 ms in
// place of 1.3 ms (tests/odometry/plane_statistics.cpp). Source:
// Rosinol, Sattler, Pollefeys, Carlone, "Incremental Visual-Inertial 3D Mesh Generation with Structural
// Regularities", ICRA 2019; the tests are this project's own.

#include <cstddef>
#include <cstdint>
#include <optional>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "estimator/smoother/smoother.hpp"

namespace swiftlet {

struct PlaneTieCounters {
  std::uint64_t reports = 0;          ///< worked in
  std::uint64_t reports_ignored = 0;  ///< of another epoch, or not newer than the last
  std::uint64_t planes_added = 0;
  std::uint64_t planes_refused = 0;  ///< for want of room
  std::uint64_t points_tied = 0;
  std::uint64_t points_refused = 0;  ///< by the test before
  std::uint64_t points_untied = 0;   ///< by the test after, or on the mesher's word
};

class PlaneTies {
 public:
  /// m, 1 sigma by which a point of a wall is off its plane.
  explicit PlaneTies(double point_sigma) : point_sigma_(point_sigma) {}

  /// The newest report replaces one that waits.
  void take(const PlaneReport& report);
  /// Before the smoother's next step, with the frame that it will get: works in the report that waits.
  void apply(Smoother& smoother, const TrackedFrame& coming, std::uint32_t epoch);
  /// After the smoother's trim: what disagrees with the solve, and what has left with it.
  void review(Smoother& smoother);
  /// The smoother has been reset.
  void reset();

  /// As of the last review.
  [[nodiscard]] const FixedVector<WindowPlane, kMaxPlanes>& planes() const { return estimates_; }
  [[nodiscard]] std::size_t size() const { return ties_.size(); }
  /// The reported plane that a landmark is tied to; 0: none.
  [[nodiscard]] std::uint64_t planeOf(TrackId id) const;
  [[nodiscard]] const PlaneTieCounters& counters() const { return counters_; }

 private:
  /// A plane in the smoother.
  struct HeldPlane {
    std::uint64_t report_id = 0;
    PlaneId id = 0;
    WindowPlane estimate;
    bool solved = false;  // the estimate has a covariance
    int ties = 0;
  };
  struct Tie {
    TrackId id = 0;
    std::uint64_t plane = 0;  // the report's
    double normal_sigma = 0;  // m, of the point along the normal, when it was tied
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    int unnamed = 0;  // reports in a row that did not name it
  };
  struct Refusal {
    TrackId id = 0;
    std::uint64_t plane = 0;
    int reports = 0;  // to go
  };
  /// A window's landmark of a report.
  struct Candidate {
    TrackId id = 0;
    std::uint64_t plane = 0;
    double normal_sigma = 0;
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
  };
  static constexpr std::size_t kMaxRefusals = 256;

  void readWindow(const Smoother& smoother);
  void releaseUnnamed(Smoother& smoother);
  void collectCandidates(const TrackedFrame& coming);
  void addPlanes(Smoother& smoother);
  void tieCandidates(Smoother& smoother, std::size_t most_per_plane, double apart);
  [[nodiscard]] bool fits(const Candidate& candidate, const HeldPlane& plane) const;
  [[nodiscard]] bool isApart(const Candidate& candidate, double distance) const;
  [[nodiscard]] const WindowLandmark* landmark(TrackId id) const;
  [[nodiscard]] HeldPlane* held(std::uint64_t report_id);
  void untie(Smoother& smoother, std::size_t tie);
  void refuse(TrackId id, std::uint64_t plane);
  [[nodiscard]] bool refused(TrackId id, std::uint64_t plane) const;
  void dropPlane(std::size_t plane);

  double point_sigma_ = 0.01;  // m
  bool waiting_ = false;
  PlaneReport report_;
  bool any_applied_ = false;
  std::uint64_t applied_frame_ = 0;
  FixedVector<HeldPlane, kMaxPlanes> held_;
  FixedVector<Tie, kMaxExplicitLandmarks> ties_;
  FixedVector<Refusal, kMaxRefusals> refusals_;
  FixedVector<WindowPlane, kMaxPlanes> estimates_;
  // Scratch.
  SmoothedWindow window_;
  FixedVector<std::uint16_t, kMaxLandmarks> by_id_;
  FixedVector<Candidate, kMaxLandmarks> candidates_;
  PlaneTieCounters counters_;
};

}  // namespace swiftlet
