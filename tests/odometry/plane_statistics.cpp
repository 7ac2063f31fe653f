// What planes buy, on simulated flights (feature tracks, no images) with the mesh in the loop:
//   plane_statistics [flights [seconds [room|hall|cluttered|twin_rooms|corridor [tracks]]]]
// The same flight without and with landmarks tied to the planes found: error of the trajectory (aligned), and
// distance of the horizon mesh to the true surface, seen from the newest pose. "snapped": the mesh of the run
// without ties, its vertices on the planes found in it. "drawn": of the run with ties, as drawOntoPlanes
// gives it. Planes that are nowhere in the true world are counted. Same seeds, same figures.

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "estimator/geometry/alignment.hpp"
#include "estimator/odometry/smooth_stage.hpp"
#include "mesher/mesh_stage.hpp"
#include "mesher/plane_drawing.hpp"
#include "mesher/plane_finder.hpp"
#include "mesher/plane_folds.hpp"
#include "tests/odometry/odometry_run.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using test::mean;
using test::quantile;
using test::TrackFlight;

namespace {

constexpr double kSampleArea = 0.004;  // m^2 of the mesh for one sample
constexpr int kMeshEvery = 4;          // keyframes
constexpr double kFar = 0.5;           // m: no surface is asked for beyond, and errors are cut

double distanceTo(const Patch& patch, const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = p - patch.origin;
  if (patch.shape == Shape::kSphere) return std::abs(q.norm() - patch.radius);
  if (patch.shape == Shape::kCylinder) {
    const double over = std::max({-q.z(), q.z() - patch.v_length, 0.0});
    return std::hypot(q.head<2>().norm() - patch.radius, over);
  }
  double u = q.dot(patch.u_axis);
  double v = q.dot(patch.v_axis);
  double beside = 0;
  if (patch.shape == Shape::kDisc) {
    beside = std::max(0.0, std::hypot(u - patch.radius, v - patch.radius) - patch.radius);
  } else {
    u = std::max({-u, u - patch.u_length, 0.0});
    v = std::max({-v, v - patch.v_length, 0.0});
    beside = std::hypot(u, v);
  }
  return std::hypot(beside, q.dot(patch.u_axis.cross(patch.v_axis)));
}

double distanceToWorld(const World& world, const Eigen::Vector3d& p) {
  double best = kFar;
  for (std::size_t i = 0; i < world.patches().size(); ++i) {
    const World::Bound& bound = world.bounds()[i];
    if ((p - bound.centre).norm() - bound.radius >= best) continue;
    best = std::min(best, distanceTo(world.patches()[i], p));
  }
  return best;
}

struct SquareMean {
  double squares = 0;
  double count = 0;

  void add(double x) {
    squares += x * x;
    ++count;
  }
  [[nodiscard]] double rms() const { return std::sqrt(squares / count); }
};

/// Distances of a mesh to the true surface.
struct MeshError {
  SquareMean surface;   ///< samples, even over the area
  SquareMean vertices;  ///< of faces

  void add(const LocalMesh& mesh, const SE3& T_truth_world, const World& world) {
    std::vector<bool> used(mesh.vertices.size(), false);
    Random random(mesh.frame_index, 4);
    for (const MeshFace& face : mesh.faces) {
      std::array<Eigen::Vector3d, 3> corner;
      for (std::size_t k = 0; k < 3; ++k) {
        used[face.vertex[k]] = true;
        corner[k] = T_truth_world * Eigen::Vector3d(mesh.vertices[face.vertex[k]].p_world.cast<double>());
      }
      const double area = 0.5 * (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm();
      const int samples = static_cast<int>(area / kSampleArea + random.uniform());
      for (int s = 0; s < samples; ++s) {
        double a = random.uniform();
        double b = random.uniform();
        if (a + b > 1) {
          a = 1 - a;
          b = 1 - b;
        }
        surface.add(
            distanceToWorld(world, corner[0] + a * (corner[1] - corner[0]) + b * (corner[2] - corner[0])));
      }
    }
    for (std::size_t v = 0; v < used.size(); ++v) {
      if (!used[v]) continue;
      vertices.add(
          distanceToWorld(world, T_truth_world * Eigen::Vector3d(mesh.vertices[v].p_world.cast<double>())));
    }
  }
};

struct Outcome {
  double ate = 0;
  MeshError plain;       ///< as the landmarks are
  MeshError snapped;     ///< all the way onto the planes
  MeshError drawn;       ///< by their noise
  MeshError folded;      ///< and folded where planes meet
  MeshError exact;       ///< every vertex where its landmark truly is: what triangulation alone leaves
  SquareMean on_planes;  ///< landmarks that the report names, height over their true surface
  double reported_points = 0;
  double mesh_vertices = 0;
  double ties = 0;
  double planes = 0;
  std::set<std::uint64_t> seen;
  std::set<std::uint64_t> unreal;
  PlaneTieCounters counters;
  double solve_ms = 0;
  double worst_solve_ms = 0;
  double find_ms = 0;
  double worst_find_ms = 0;
  int folds = 0;
  int reports = 0;         ///< planes times keyframes
  int unreal_reports = 0;  ///< of them, of planes that are nowhere
  int wrong_points = 0;    ///< named on a plane that they are not on by more than 5 cm
  int named_points = 0;
};

/// CPU time of this thread: other programs on the machine do not count.
double milliseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// Is there a flat patch with this normal where most of its points truly are?
bool isReal(const ReportedPlane& plane, const PlaneReport& report, const SE3& T_truth_world,
            const TrackFlight& flight) {
  constexpr double kCosine = 0.9945;  // 6 degrees
  constexpr double kOn = 0.05;        // m
  const Eigen::Vector3d normal = T_truth_world.rotation * plane.normal;
  const double distance = plane.distance + normal.dot(T_truth_world.translation);
  int points = 0;
  int best = 0;
  for (const ReportedPoint& p : report.points) points += p.plane == plane.id ? 1 : 0;
  for (const Patch& patch : flight.flight().world().patches()) {
    const bool flat = patch.shape == Shape::kRectangle || patch.shape == Shape::kDisc;
    if (!flat || patch.normalAt(0, 0).dot(normal) < kCosine) continue;
    int on = 0;
    for (const ReportedPoint& p : report.points) {
      if (p.plane != plane.id) continue;
      const Eigen::Vector3d& truth = flight.landmark(p.id);
      const bool near = std::abs(patch.normalAt(0, 0).dot(truth - patch.origin)) < kOn &&
                        std::abs(normal.dot(truth) - distance) < 2 * kOn;
      on += near ? 1 : 0;
    }
    best = std::max(best, on);
  }
  return 2 * best > points;
}

class Flight {
 public:
  Flight(const TrackFlight& flight, bool ties) : flight_(flight) {
    OdometrySettings settings = test::settingsFor(flight);
    settings.regularity_enabled = ties;
    settings_ = settings;
    stage_ = std::make_unique<SmoothStage>(flight.rig(), flight.noise(), settings);
    mesh_stage_ = std::make_unique<MeshStage>(flight.rig(), HorizonLimits{});
  }

  Outcome fly() {
    flight_.play([&](const ImuSample& sample) { stage_->addImu(sample); }, [&](std::size_t k) { frame(k); });
    Alignment alignment;
    out_.ate = alignRigid(estimate_, truth_, alignment).ok() ? alignment.rms : std::nan("");
    out_.counters = stage_->planeTies().counters();
    out_.solve_ms /= static_cast<double>(flight_.frames().size());
    for (double* sum :
         {&out_.reported_points, &out_.mesh_vertices, &out_.ties, &out_.planes, &out_.find_ms}) {
      *sum /= std::max(1, keyframes_);
    }
    return out_;
  }

 private:
  void frame(std::size_t k) {
    const TrackedFrame& tracked = flight_.frames()[k];
    double begin = milliseconds();
    static_cast<void>(stage_->step(tracked, Effort{}, *output_));
    const double step_ms = milliseconds() - begin;
    out_.solve_ms += step_ms;
    out_.worst_solve_ms = std::max(out_.worst_solve_ms, step_ms);
    stage_->trim();
    if (!output_->has_state) return;
    estimate_.push_back(output_->state.T_world_body.translation);
    truth_.push_back(flight_.truth(k).T_world_body.translation);
    stage_->window(*window_);
    if (!mesh_stage_->step({window_.get(), &tracked, {}, {}}).ok() || !tracked.keyframe) return;
    mesh_stage_->horizonMesh(*mesh_);
    begin = milliseconds();
    static_cast<void>(finder_->step(*mesh_, *window_, *report_));
    const double find_ms = milliseconds() - begin;
    out_.find_ms += find_ms;
    out_.worst_find_ms = std::max(out_.worst_find_ms, find_ms);
    stage_->take(*report_);
    ++keyframes_;
    measure(k);
  }

  void measure(std::size_t k) {
    const SE3 T_truth_world = flight_.truth(k).T_world_body * window_->poses.back().T_world_body.inverse();
    out_.reported_points += static_cast<double>(report_->points.size());
    out_.mesh_vertices += static_cast<double>(mesh_->vertices.size());
    out_.ties += static_cast<double>(stage_->planeTies().size());
    out_.planes += static_cast<double>(report_->planes.size());
    for (const ReportedPlane& plane : report_->planes) {
      out_.seen.insert(plane.id);
      ++out_.reports;
      if (isReal(plane, *report_, T_truth_world, flight_)) continue;
      out_.unreal.insert(plane.id);
      ++out_.unreal_reports;
    }
    if (keyframes_ % kMeshEvery != 0) return;
    const World& world = flight_.flight().world();
    for (const WindowLandmark& landmark : window_->landmarks) {
      for (const ReportedPoint& p : report_->points) {
        if (p.id != landmark.id) continue;
        out_.on_planes.add(distanceToWorld(world, T_truth_world * landmark.p_world));
        for (const ReportedPlane& plane : report_->planes) {
          if (plane.id != p.plane) continue;
          const Eigen::Vector3d truth = T_truth_world.inverse() * flight_.landmark(p.id);
          ++out_.named_points;
          out_.wrong_points += std::abs(plane.normal.dot(truth) - plane.distance) > 0.05 ? 1 : 0;
        }
      }
    }
    out_.plain.add(*mesh_, T_truth_world, world);
    *drawn_ = *mesh_;
    for (MeshVertex& vertex : drawn_->vertices) vertex.p_world = flight_.landmark(vertex.id).cast<float>();
    out_.exact.add(*drawn_, SE3(), world);
    *drawn_ = *mesh_;
    drawOntoPlanes(*report_, *window_, 0, *drawn_);
    out_.snapped.add(*drawn_, T_truth_world, world);
    *drawn_ = *mesh_;
    drawOntoPlanes(*report_, *window_, settings_.plane_point_sigma, *drawn_);
    out_.drawn.add(*drawn_, T_truth_world, world);
    out_.folds += foldAtPlanes(*report_, *window_, *drawn_);
    out_.folded.add(*drawn_, T_truth_world, world);
  }

  const TrackFlight& flight_;
  OdometrySettings settings_;
  std::unique_ptr<SmoothStage> stage_;
  std::unique_ptr<MeshStage> mesh_stage_;
  std::unique_ptr<PlaneFinder> finder_ = std::make_unique<PlaneFinder>();
  std::unique_ptr<OdometryOutput> output_ = std::make_unique<OdometryOutput>();
  std::unique_ptr<SmoothedWindow> window_ = std::make_unique<SmoothedWindow>();
  std::unique_ptr<LocalMesh> mesh_ = std::make_unique<LocalMesh>();
  std::unique_ptr<LocalMesh> drawn_ = std::make_unique<LocalMesh>();
  std::unique_ptr<PlaneReport> report_ = std::make_unique<PlaneReport>();
  std::vector<Eigen::Vector3d> estimate_;
  std::vector<Eigen::Vector3d> truth_;
  int keyframes_ = 0;
  Outcome out_;
};

void forEach(int count, const std::function<void(int)>& work) {
  std::atomic<int> next = 0;
  const auto worker = [&] {
    for (int i = next++; i < count; i = next++) work(i);
  };
  std::thread other(worker);
  worker();
  other.join();
}

void printSeed(int seed, const Outcome& a, const Outcome& b) {
  const double allowed = std::max(0.05 * a.ate, 0.001);
  std::printf(
      "  %3d  ATE %.4f -> %.4f m%s | mesh %.4f snapped %.4f -> %.4f snapped %.4f drawn %.4f folded %.4f "
      "exact %.4f m | "
      "vertices "
      "%.4f snapped %.4f -> %.4f drawn %.4f | on planes %.4f -> %.4f\n"
      "       %.0f of %.0f vertices on %.1f planes (%zu in all, %zu unreal, %d of %d times), wrong %.3f | "
      "%.1f ties; tied "
      "%llu "
      "refused %llu untied %llu planes %llu | step %.2f -> %.2f ms (%.1f -> %.1f), find %.2f ms (%.1f)\n",
      seed, a.ate, b.ate, b.ate > a.ate + allowed ? " WORSE" : "", a.plain.surface.rms(),
      a.snapped.surface.rms(), b.plain.surface.rms(), b.snapped.surface.rms(), b.drawn.surface.rms(),
      b.folded.surface.rms(), b.exact.surface.rms(), a.plain.vertices.rms(), a.snapped.vertices.rms(),
      b.plain.vertices.rms(), b.drawn.vertices.rms(), a.on_planes.rms(), b.on_planes.rms(), b.reported_points,
      b.mesh_vertices, b.planes, a.seen.size() + b.seen.size(), a.unreal.size() + b.unreal.size(),
      a.unreal_reports + b.unreal_reports, a.reports + b.reports,
      static_cast<double>(b.wrong_points) / std::max(1, b.named_points), b.ties,
      static_cast<unsigned long long>(b.counters.points_tied),
      static_cast<unsigned long long>(b.counters.points_refused),
      static_cast<unsigned long long>(b.counters.points_untied),
      static_cast<unsigned long long>(b.counters.planes_added), a.solve_ms, b.solve_ms, a.worst_solve_ms,
      b.worst_solve_ms, b.find_ms, b.worst_find_ms);
}

}  // namespace

int main(int argc, char** argv) {
  const int flights = argc > 1 ? std::atoi(argv[1]) : 10;
  const double seconds = argc > 2 ? std::atof(argv[2]) : 30;
  const auto kind = worldNamed(argc > 3 ? argv[3] : "room");
  const int tracks = argc > 4 ? std::atoi(argv[4]) : 150;
  if (flights < 1 || !(seconds > 1) || !kind || tracks < 10) {
    std::fprintf(stderr, "usage: plane_statistics [flights [seconds [world [tracks]]]]\n");
    return 2;
  }
  std::vector<Outcome> without(static_cast<std::size_t>(flights));
  std::vector<Outcome> with(without.size());
  forEach(2 * flights, [&](int i) {
    SimulationSettings settings = test::roomFlight(seconds, 100 + static_cast<std::uint64_t>(i / 2));
    settings.world.kind = *kind;
    settings.tracks.max_tracks = tracks;
    const TrackFlight flight(settings);
    (i % 2 == 0 ? without : with)[static_cast<std::size_t>(i / 2)] = Flight(flight, i % 2 != 0).fly();
  });
  std::printf("%d flights of %.0f s in %s, %d tracks\n", flights, seconds, worldName(*kind), tracks);
  int worse = 0;
  std::size_t unreal = 0;
  std::array<double, 2> ate{};
  std::array<double, 6> mesh{};
  for (std::size_t i = 0; i < without.size(); ++i) {
    const Outcome& a = without[i];
    const Outcome& b = with[i];
    printSeed(100 + static_cast<int>(i), a, b);
    worse += b.ate > a.ate + std::max(0.05 * a.ate, 0.001) ? 1 : 0;
    unreal += a.unreal.size() + b.unreal.size();
    ate[0] += a.ate / flights;
    ate[1] += b.ate / flights;
    const std::array<double, 6> m{a.plain.surface.rms(),   a.snapped.surface.rms(), b.plain.surface.rms(),
                                  b.snapped.surface.rms(), b.drawn.surface.rms(),   b.folded.surface.rms()};
    for (std::size_t k = 0; k < m.size(); ++k) mesh[k] += m[k] / flights;
  }
  std::printf(
      "mean: ATE %.4f -> %.4f m (worse on %d); mesh %.4f, snapped %.4f -> %.4f, snapped %.4f, drawn %.4f, "
      "folded %.4f m "
      "(%.1f %% lower; snapping alone %.1f %%); unreal planes %zu\n",
      ate[0], ate[1], worse, mesh[0], mesh[1], mesh[2], mesh[3], mesh[4], mesh[5],
      100 * (1 - mesh[5] / mesh[0]), 100 * (1 - mesh[1] / mesh[0]), unreal);
  return 0;
}
