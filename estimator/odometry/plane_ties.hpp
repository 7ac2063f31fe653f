#pragma once
// Ties landmarks to the planes that the mesher found: keeps the smoother's planes in step with its reports.
//
// A report is applied before the next step. Planes are added with their direction, and some of their points
// are promoted and tied: points that the next frame sees, that several states observed, and that pass a
// chi-squared test against the smoother's plane. The most accurate points come first, apart from each other
// and distributed over the planes. After each solve, ties that disagree are removed. A tied point is pulled
// onto its plane, so the test compares its remaining distance with what its own observations allow
// (disagrees() in plane_ties.cpp). A refused point is not tried again on the same plane for some time. Work
// is bounded by kMaxPlanes and kMaxLandmarks; no allocation; reports of another epoch are ignored. Memory:
// 0.15 MiB inside the object. Cost: that of the additional columns; with 40 ties a step takes 2.0 ms instead
// of 1.3 ms (tests/odometry/plane_statistics.cpp). Source: Rosinol, Sattler, Pollefeys, Carlone, "Incremental
// Visual-Inertial 3D Mesh Generation with Structural Regularities", ICRA 2019; the tests are this project's
// own.

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
  std::uint64_t reports = 0;          ///< applied
  std::uint64_t reports_ignored = 0;  ///< of another epoch, or not newer than the last
  std::uint64_t planes_added = 0;
  std::uint64_t points_tied = 0;
  std::uint64_t points_refused = 0;  ///< by the test before tying
  std::uint64_t points_untied = 0;   ///< by the test after a solve, or because the mesher dropped them
};

class PlaneTies {
 public:
  /// `point_sigma`: m, standard deviation of a point's distance from its plane.
  explicit PlaneTies(double point_sigma) : point_sigma_(point_sigma) {}

  /// Stores a report for apply(); replaces one that was not applied yet.
  void take(const PlaneReport& report);
  /// Applies the stored report. Call before the smoother's step with the frame `coming`.
  void apply(Smoother& smoother, const TrackedFrame& coming, std::uint32_t epoch);
  /// Call after the smoother's trim: removes ties that disagree with the solve and those that left the
  /// window.
  void review(Smoother& smoother);
  /// Call when the smoother was reset.
  void reset();

  /// Planes after the last review().
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
    std::uint64_t plane = 0;  // id in the report
    double normal_sigma = 0;  // m, of the point along the normal, when it was tied
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    int unnamed = 0;  // consecutive reports without it
  };
  struct Refusal {
    TrackId id = 0;
    std::uint64_t plane = 0;
    int reports = 0;  // reports until it may be tried again
  };
  /// A landmark of the window that is in a report.
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
