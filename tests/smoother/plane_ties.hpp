#pragma once
// What a mesher would hand to the smoother between two steps, made from the truth: landmarks to promote, the
// room's floor, ceiling and walls, and which landmark is on which.

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "estimator/core/random.hpp"
#include "tests/smoother/smoother_run.hpp"

namespace swiftlet::test {

struct TieSettings {
  std::size_t max_promoted = 40;
  bool planes = false;
  bool directions = false;
  double point_sigma = 0.01;      ///< m
  double direction_sigma = 0.02;  ///< rad
  double wrong_share = 0;         ///< of the points, tied to a plane that they are not on
  std::uint64_t seed = 5;
};

class PlaneTies {
 public:
  PlaneTies(const TrackFlight& flight, const TieSettings& settings)
      : flight_(flight),
        settings_(settings),
        random_(settings.seed, 91),
        window_(std::make_unique<SmoothedWindow>()) {
    for (const Patch& patch : flight.flight().world().patches()) {
      if (patch.shape != Shape::kRectangle) continue;
      if (patch.label == Label::kFloor || patch.label == Label::kCeiling || patch.label == Label::kWall) {
        const Eigen::Vector3d normal = patch.normalAt(0, 0);
        surfaces_.push_back({Plane(normal, normal.dot(patch.origin)), {}});
      }
    }
  }

  /// Between two steps.
  void update(Smoother& smoother) {
    smoother.window(*window_);
    for (Surface& surface : surfaces_) {
      if (surface.id && !smoother.plane(*surface.id)) surface.id.reset();
    }
    for (const WindowLandmark& landmark : window_->landmarks) {
      const std::size_t on = surfaceOf(landmark.id);
      if (settings_.planes && on == surfaces_.size()) continue;
      if (!smoother.promoted(landmark.id)) {
        if (smoother.explicitLandmarks() >= settings_.max_promoted || !smoother.promote(landmark.id).ok())
          continue;
        ++promotions_;
        if (settings_.planes) tie(smoother, landmark.id, on);
      }
    }
    most_planes_ = std::max(most_planes_, smoother.planes());
  }

  [[nodiscard]] int promotions() const { return promotions_; }
  [[nodiscard]] int ties() const { return ties_; }
  [[nodiscard]] int wrongTies() const { return wrong_; }
  [[nodiscard]] int planesMade() const { return planes_made_; }
  [[nodiscard]] std::size_t mostPlanes() const { return most_planes_; }

  struct Surface {
    Plane truth;
    std::optional<PlaneId> id;
  };
  [[nodiscard]] const std::vector<Surface>& surfaces() const { return surfaces_; }

 private:
  static constexpr double kOnSurface = 1e-6;  // m

  [[nodiscard]] std::size_t surfaceOf(TrackId id) const {
    const Eigen::Vector3d& p = flight_.landmark(id);
    std::size_t k = 0;
    while (k < surfaces_.size() && std::abs(surfaces_[k].truth.height(p)) > kOnSurface) ++k;
    return k;
  }

  void tie(Smoother& smoother, TrackId id, std::size_t on) {
    if (random_.uniform() < settings_.wrong_share) {
      on = (on + 1 + static_cast<std::size_t>(random_.uniform(0, 2.999))) % surfaces_.size();
      ++wrong_;
    }
    Surface& surface = surfaces_[on];
    if (!surface.id) {
      // As found in a mesh: a degree and some centimetres off.
      Plane found = surface.truth;
      found.retract(
          Eigen::Vector3d(0.02 * random_.normal(), 0.02 * random_.normal(), 0.03 * random_.normal()));
      surface.id = smoother.addPlane(found);
      if (!surface.id) return;
      ++planes_made_;
      if (settings_.directions) {
        const bool level = std::abs(surface.truth.normal().z()) > 0.5;
        static_cast<void>(smoother.addPlaneDirection(
            *surface.id, level ? PlaneDirection::kHorizontal : PlaneDirection::kVertical,
            settings_.direction_sigma));
      }
    }
    if (smoother.addPointOnPlane(id, *surface.id, settings_.point_sigma).ok()) ++ties_;
  }

  const TrackFlight& flight_;
  TieSettings settings_;
  Random random_;
  std::unique_ptr<SmoothedWindow> window_;
  std::vector<Surface> surfaces_;
  int promotions_ = 0;
  int ties_ = 0;
  int wrong_ = 0;
  int planes_made_ = 0;
  std::size_t most_planes_ = 0;
};

/// How a flight went.
struct FlightRecord {
  std::vector<BodyState> x;
  std::vector<Matrix15d> covariance;
  double error = 0;  ///< m, RMS of the position in the start's frame
  double nees = 0;   ///< of the pose, mean over every 20th frame after the first 60
  std::size_t most_explicit = 0;
  double seconds = 0;  ///< in step()
};

/// Flies with `ties` between the steps; none: structureless.
inline FlightRecord fly(const TrackFlight& flight, PlaneTies* ties) {
  SmootherRun run(flight);
  FlightRecord record;
  int samples = 0;
  flight.play([&](const ImuSample& s) { run.addImu(s); },
              [&](std::size_t k) {
                const auto begin = std::chrono::steady_clock::now();
                REQUIRE(run.step(k).ok());
                record.seconds +=
                    std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
                if (ties != nullptr) ties->update(run.smoother());
                const BodyState& x = run.smoother().newest().x;
                const Matrix15d& P = run.smoother().covariance();
                record.x.push_back(x);
                record.covariance.push_back(P);
                record.most_explicit = std::max(record.most_explicit, run.smoother().explicitLandmarks());
                const Vector15d error = flight.truth(k).minus(x);
                record.error += error.segment<3>(3).squaredNorm();
                if (k < 60 || k % 20 != 0) return;
                record.nees += error.head<6>().dot(P.topLeftCorner<6, 6>().llt().solve(error.head<6>()));
                ++samples;
              });
  record.error = std::sqrt(record.error / static_cast<double>(record.x.size()));
  record.nees /= std::max(samples, 1);
  return record;
}

}  // namespace swiftlet::test
