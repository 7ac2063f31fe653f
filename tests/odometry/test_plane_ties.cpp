// Reports of planes worked into the smoother, on simulated flights: reports made from the truth, with what a
// mesher may get wrong put in on purpose.

#include "estimator/odometry/plane_ties.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "estimator/odometry/smooth_stage.hpp"
#include "tests/odometry/odometry_run.hpp"

using namespace swiftlet;
using test::TrackFlight;

namespace {

constexpr double kOnSurface = 1e-6;  // m

/// Floor, ceiling and walls of the true world.
struct TruePlane {
  std::uint64_t id = 0;
  Eigen::Vector3d normal;
  double distance = 0;
};

std::vector<TruePlane> truePlanes(const TrackFlight& flight) {
  std::vector<TruePlane> planes;
  for (const Patch& patch : flight.flight().world().patches()) {
    if (patch.shape != Shape::kRectangle) continue;
    if (patch.label != Label::kFloor && patch.label != Label::kCeiling && patch.label != Label::kWall)
      continue;
    const Eigen::Vector3d normal = patch.normalAt(0, 0);
    const double distance = normal.dot(patch.origin);
    if (std::none_of(planes.begin(), planes.end(), [&](const TruePlane& p) {
          return (p.normal - normal).norm() < kOnSurface && std::abs(p.distance - distance) < kOnSurface;
        })) {
      planes.push_back({planes.size() + 1, normal, distance});
    }
  }
  return planes;
}

std::uint64_t surfaceOf(const std::vector<TruePlane>& planes, const Eigen::Vector3d& p) {
  for (const TruePlane& plane : planes) {
    if (std::abs(plane.normal.dot(p) - plane.distance) < kOnSurface) return plane.id;
  }
  return 0;
}

/// The stage with a report after every keyframe.
class TiedFlight {
 public:
  explicit TiedFlight(const TrackFlight& flight, bool enabled = true)
      : flight_(flight), planes_(truePlanes(flight)) {
    OdometrySettings settings = test::settingsFor(flight);
    settings.regularity_enabled = enabled;
    stage = std::make_unique<SmoothStage>(flight.rig(), flight.noise(), settings);
  }

  /// Changes a report before it is handed in; a frame before it is tracked; looks after every frame.
  std::function<void(std::size_t, PlaneReport&)> spoil_report;
  std::function<void(std::size_t, TrackedFrame&)> spoil_frame;
  std::function<void(std::size_t)> look;

  void fly() {
    flight_.play([&](const ImuSample& sample) { stage->addImu(sample); }, [&](std::size_t k) { frame(k); });
  }

  [[nodiscard]] SE3 worldFromTruth(std::size_t k) const {
    return window->poses.back().T_world_body * flight_.truth(k).T_world_body.inverse();
  }
  [[nodiscard]] const std::vector<TruePlane>& planes() const { return planes_; }

  std::unique_ptr<SmoothStage> stage;
  std::unique_ptr<SmoothedWindow> window = std::make_unique<SmoothedWindow>();
  std::vector<TrackId> named;  ///< in any report

 private:
  void frame(std::size_t k) {
    *tracked_ = flight_.frames()[k];
    if (spoil_frame) spoil_frame(k, *tracked_);
    REQUIRE(stage->step(*tracked_, Effort{}, *output_).ok());
    stage->trim();
    if (!output_->has_state) return;
    stage->window(*window);
    if (tracked_->keyframe) {
      makeReport(k);
      if (spoil_report) spoil_report(k, *report_);
      for (const ReportedPoint& point : report_->points) named.push_back(point.id);
      stage->take(*report_);
    }
    if (look) look(k);
  }

  void makeReport(std::size_t k) {
    const SE3 T_world_truth = worldFromTruth(k);
    report_->epoch = window->epoch;
    report_->frame_index = tracked_->index;
    report_->planes.clear();
    report_->points.clear();
    for (const TruePlane& plane : planes_) {
      ReportedPlane reported;
      reported.id = plane.id;
      reported.normal = T_world_truth.rotation * plane.normal;
      reported.distance = plane.distance + reported.normal.dot(T_world_truth.translation);
      reported.direction =
          std::abs(plane.normal.z()) > 0.5 ? PlaneDirection::kHorizontal : PlaneDirection::kVertical;
      static_cast<void>(report_->planes.tryPushBack(reported));
    }
    for (const WindowLandmark& landmark : window->landmarks) {
      const std::uint64_t plane = surfaceOf(planes_, flight_.landmark(landmark.id));
      if (plane != 0) static_cast<void>(report_->points.tryPushBack({landmark.id, plane, true}));
    }
  }

  const TrackFlight& flight_;
  std::vector<TruePlane> planes_;
  std::unique_ptr<TrackedFrame> tracked_ = std::make_unique<TrackedFrame>();
  std::unique_ptr<OdometryOutput> output_ = std::make_unique<OdometryOutput>();
  std::unique_ptr<PlaneReport> report_ = std::make_unique<PlaneReport>();
};

}  // namespace

TEST_CASE("Reported landmarks are tied, within the limits, and the window tells the planes",
          "[odometry][ties]") {
  const TrackFlight flight(test::roomFlight(14, 3));
  TiedFlight tied(flight);
  std::size_t most = 0;
  std::size_t most_planes = 0;
  double worst_angle = 0;
  double worst_height = 0;
  tied.look = [&](std::size_t k) {
    const PlaneTies& ties = tied.stage->planeTies();
    most = std::max(most, ties.size());
    most_planes = std::max(most_planes, tied.window->planes.size());
    CHECK(ties.size() <= kMaxExplicitLandmarks);
    if (k < 60) return;
    const SE3 T_world_truth = tied.worldFromTruth(k);
    for (const WindowPlane& plane : tied.window->planes) {
      const TruePlane& truth = tied.planes()[plane.id - 1];
      const Eigen::Vector3d normal = T_world_truth.rotation * truth.normal;
      CHECK(plane.points > 0);
      if (plane.points < 5) continue;
      worst_angle = std::max(worst_angle, std::acos(std::min(1.0, normal.dot(plane.normal))));
      // Where its points are: at the foot of the viewer's perpendicular.
      const Eigen::Vector3d viewer = tied.window->poses.back().T_world_body.translation;
      const double depth = normal.dot(viewer) - truth.distance - normal.dot(T_world_truth.translation);
      worst_height = std::max(worst_height, std::abs(plane.normal.dot(viewer) - plane.distance - depth));
    }
    // Nothing is tied to what it is not on.
    for (const WindowLandmark& landmark : tied.window->landmarks) {
      const std::uint64_t plane = ties.planeOf(landmark.id);
      if (plane != 0) CHECK(plane == surfaceOf(tied.planes(), flight.landmark(landmark.id)));
    }
  };
  tied.fly();
  CHECK(most > 30);
  CHECK(most_planes >= 3);
  CHECK(tied.stage->planeTies().counters().points_tied > 200);
  CHECK(worst_angle < 0.06);
  CHECK(worst_height < 0.12);
}

TEST_CASE("Nothing is tied unless it is switched on", "[odometry][ties]") {
  const TrackFlight flight(test::roomFlight(4, 3));
  TiedFlight tied(flight, false);
  tied.look = [&](std::size_t) { CHECK(tied.window->planes.empty()); };
  tied.fly();
  CHECK(tied.stage->planeTies().counters().reports == 0);
  CHECK(tied.stage->planeTies().size() == 0);
}

TEST_CASE("A report is worked in at the next step, once, and only in its epoch", "[odometry][ties]") {
  const TrackFlight flight(test::roomFlight(5, 3));
  TiedFlight tied(flight);
  SECTION("another epoch's") {
    tied.spoil_report = [](std::size_t, PlaneReport& report) { report.epoch = 7; };
    tied.fly();
    CHECK(tied.stage->planeTies().counters().reports == 0);
    CHECK(tied.stage->planeTies().counters().reports_ignored > 10);
    CHECK(tied.stage->planeTies().size() == 0);
  }
  SECTION("one of the past") {
    tied.spoil_report = [](std::size_t k, PlaneReport& report) {
      if (k > 50) report.frame_index = 10;
    };
    std::uint64_t before = 0;
    tied.look = [&](std::size_t k) {
      if (k <= 50) before = tied.stage->planeTies().counters().reports;
    };
    tied.fly();
    CHECK(before > 5);
    CHECK(tied.stage->planeTies().counters().reports <= before + 1);
  }
  SECTION("after a reset") {
    tied.look = [&](std::size_t k) {
      if (k == 60) CHECK(tied.stage->planeTies().size() > 10);
      if (k != 60) return;
      tied.stage->reset();
      CHECK(tied.stage->planeTies().size() == 0);
      CHECK(tied.stage->planeTies().planes().empty());
    };
    tied.fly();
    CHECK(tied.stage->planeTies().size() > 0);  // the new epoch's own
  }
}

TEST_CASE("Landmarks on the wrong plane are refused", "[odometry][ties]") {
  const TrackFlight flight(test::roomFlight(10, 4));
  TiedFlight tied(flight);
  std::map<TrackId, std::uint64_t> wrong;
  tied.spoil_report = [&](std::size_t, PlaneReport& report) {
    for (ReportedPoint& point : report.points) {
      if (point.id % 5 != 0) continue;
      point.plane = point.plane % tied.planes().size() + 1;
      wrong[point.id] = point.plane;
    }
  };
  int tied_wrong = 0;
  int tied_right = 0;
  tied.look = [&](std::size_t) {
    for (const auto& [id, plane] : wrong) tied_wrong += tied.stage->planeTies().planeOf(id) == plane ? 1 : 0;
    tied_right += static_cast<int>(tied.stage->planeTies().size());
  };
  tied.fly();
  REQUIRE(wrong.size() > 30);
  CHECK(tied_right > 1000);
  // Where two walls meet a point is on both, nearly.
  CHECK(tied_wrong < tied_right / 100);
  CHECK(tied.stage->planeTies().counters().points_refused > 10);
}

TEST_CASE("Ties that the sightings contradict end", "[odometry][ties]") {
  // One landmark in eight is truly 5 cm in front of what the report says it is on.
  constexpr double kInFront = 0.05;  // m
  const TrackFlight flight(test::roomFlight(12, 5));
  TiedFlight tied(flight);
  const auto displaced = [](TrackId id) { return id % 8 == 0; };
  tied.spoil_frame = [&](std::size_t k, TrackedFrame& frame) {
    const SE3 T_world_body = flight.truth(k).T_world_body;
    for (TrackedFeature& feature : frame.features) {
      const Eigen::Vector3d& p = flight.landmark(feature.id);
      const std::uint64_t plane = surfaceOf(tied.planes(), p);
      if (!displaced(feature.id) || plane == 0) continue;
      const Eigen::Vector3d moved = p + kInFront * tied.planes()[plane - 1].normal;
      for (std::size_t c = 0; c < flight.rig().camera_count; ++c) {
        const SE3 T_cam_world = (T_world_body * flight.rig().T_body_cam[c]).inverse();
        Eigen::Vector2d before;
        Eigen::Vector2d after;
        if (!feature.seen[c] || !flight.rig().camera[c].project(T_cam_world * p, before) ||
            !flight.rig().camera[c].project(T_cam_world * moved, after)) {
          continue;
        }
        feature.pixel[c] += (after - before).cast<float>();
      }
    }
  };
  int wrong = 0;
  int right = 0;
  int age_wrong = 0;
  tied.look = [&](std::size_t k) {
    if (k < 100) return;
    for (const WindowLandmark& landmark : tied.window->landmarks) {
      if (tied.stage->planeTies().planeOf(landmark.id) == 0) continue;
      (displaced(landmark.id) ? wrong : right) += 1;
      age_wrong += displaced(landmark.id) && landmark.sightings >= 12 ? 1 : 0;
    }
  };
  tied.fly();
  REQUIRE(right > 1000);
  INFO(wrong << " wrong, " << right << " right, " << age_wrong << " wrong although long seen");
  CHECK(wrong < right / 14);  // one in seven where nothing is tested
  CHECK(age_wrong < right / 50);
  CHECK(tied.stage->planeTies().counters().points_untied > 0);
}

TEST_CASE("Points that the mesher no longer names are released", "[odometry][ties]") {
  const TrackFlight flight(test::roomFlight(8, 6));
  TiedFlight tied(flight);
  std::size_t before = 0;
  bool moved = false;
  SECTION("they are named no more") {
    tied.spoil_report = [&](std::size_t k, PlaneReport& report) {
      if (k > 80) report.points.clear();
    };
  }
  SECTION("they are named too weakly to count") {
    tied.spoil_report = [&](std::size_t k, PlaneReport& report) {
      for (ReportedPoint& point : report.points) point.firm = k <= 80;
    };
  }
  SECTION("they are named on another plane") {
    moved = true;
    tied.spoil_report = [&](std::size_t k, PlaneReport& report) {
      for (ReportedPoint& point : report.points) {
        if (k > 80) point.plane = point.plane % tied.planes().size() + 1;
      }
    };
  }
  tied.look = [&](std::size_t k) {
    if (k == 80) before = tied.stage->planeTies().size();
    // At once when the plane is another's; otherwise after four reports, keyframes at most 5 frames apart.
    if (k == (moved ? 87 : 105)) CHECK(tied.stage->planeTies().size() < before / 10);
  };
  tied.fly();
  CHECK(before > 20);
  CHECK(tied.stage->planeTies().counters().points_untied >= before / 2);
}

TEST_CASE("Reports that make no sense do no harm", "[odometry][ties]") {
  const TrackFlight flight(test::roomFlight(6, 7));
  TiedFlight tied(flight);
  tied.spoil_report = [&](std::size_t, PlaneReport& report) {
    report.planes[0].normal.x() = std::nan("");
    report.planes[1].distance = std::nan("");
    for (std::size_t i = 0; i < 40 && i < report.points.size(); ++i) {
      static_cast<void>(report.points.tryPushBack(report.points[i]));  // twice
    }
    static_cast<void>(report.points.tryPushBack({999999, 3, true}));
    static_cast<void>(report.points.tryPushBack({report.points[0].id, 777, true}));
  };
  tied.look = [&](std::size_t) {
    for (const WindowPlane& plane : tied.window->planes) {
      CHECK(plane.id != tied.planes()[0].id);
      CHECK(plane.id != tied.planes()[1].id);
      CHECK(plane.normal.allFinite());
      CHECK(plane.covariance.allFinite());
    }
  };
  tied.fly();
  CHECK(tied.stage->planeTies().size() > 5);
}
