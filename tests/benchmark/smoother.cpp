// One update of the fixed-lag smoother beside Ceres on the same window and the same cost, in one
// process, one thread, the same number of Gauss-Newton steps; medians of interleaved repetitions in CPU
// time. What each side does is said in smoother_window.hpp and smoother_ceres.hpp. Ceres' time is that of
// Solve() alone, with the fastest of its Schur solvers; building its problem is printed beside it.
// Smoother::step is timed too, on the same flight: all that a frame costs, its marginalizations included.
// Exits with 1 when the two solvers do not find the same solution.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/benchmark/smoother_ceres.hpp"
#include "tests/benchmark/smoother_window.hpp"
#include "tests/smoother/smoother_run.hpp"
#include "tests/support/cpu_time.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

constexpr int kRepetitions = 41;
constexpr int kIterations = 3;        // an update that has converged
constexpr int kToConvergence = 25;    // steps: reweighting converges linearly
constexpr double kSameState = 1e-6;   // m, rad, m/s: largest difference of the two solutions
constexpr double kSameCost = 1e-9;    // relative
constexpr std::size_t kNewest = 160;  // frame of the flight: 8 s, the window is long full
constexpr double kSeconds = 12;
constexpr std::uint64_t kSeed = 3;

// Of the process: helper threads of a linear algebra library would count.
template <typename F>
double processTimed(const F& f) {
  return timed(f, CLOCK_PROCESS_CPUTIME_ID);
}

double median(const std::vector<double>& values) { return quantile(values, 0.5); }

void printTime(const char* name, const std::vector<double>& t) {
  std::printf("    %-36s %8.3f ms  (quartiles %.3f, %.3f)\n", name, median(t), quantile(t, 0.25),
              quantile(t, 0.75));
}

double largestDifference(const WindowValues& a, const WindowValues& b) {
  double worst = 0;
  for (std::size_t k = 0; k < a.states.size(); ++k) {
    worst = std::max(worst, a.states[k].minus(b.states[k]).cwiseAbs().maxCoeff());
  }
  return worst;
}

bool sameSolution(BenchmarkWindow& window, CeresWindow& ceres, const CeresSolver& solver) {
  const WindowValues start = window.values();
  const double cost_start = window.cost();
  bool same = true;
  for (const int iterations : {kIterations, kToConvergence}) {
    window.setValues(start);
    if (!window.update(iterations)) return false;
    const WindowValues ours = window.values();
    const double ours_cost = window.cost();
    ceres.reset();
    const ceres::Solver::Summary summary = ceres.solve(solver, iterations);
    const WindowValues theirs = ceres.values();
    window.setValues(theirs);
    const double ceres_cost = window.cost();
    const double difference = largestDifference(ours, theirs);
    std::printf(
        "    %2d steps: cost %.3f -> swiftlet %.9f, Ceres %.9f (its own figure %.9f, %d steps taken); "
        "states differ by at most %.1e m, rad, m/s\n",
        iterations, cost_start, ours_cost, ceres_cost, summary.final_cost, summary.num_successful_steps - 1,
        difference);
    if (iterations == kToConvergence) {
      same = difference < kSameState && std::abs(ours_cost - ceres_cost) < kSameCost * ceres_cost;
    }
  }
  window.setValues(start);
  ceres.reset();
  return same;
}

// All of Smoother::step on the frames around the window.
void timeSteps(const TrackFlight& flight, std::vector<double>& milliseconds, double& landmarks) {
  SmootherRun run(flight);
  landmarks = 0;
  flight.play([&](const ImuSample& sample) { run.addImu(sample); },
              [&](std::size_t k) {
                const double t = processTimed([&] { static_cast<void>(run.step(k, kIterations)); });
                if (k + 60 < kNewest) return;
                milliseconds.push_back(t);
                landmarks += run.smoother().statistics().landmarks;
              });
  landmarks /= static_cast<double>(milliseconds.size());
}

bool compare(int tracks) {
  SimulationSettings settings = roomFlight(kSeconds, kSeed);
  settings.tracks.max_tracks = tracks;
  const TrackFlight flight(settings);
  BenchmarkWindow window(flight, kNewest);
  int sightings = 0;
  std::size_t views = 0;
  for (const Landmark& landmark : window.landmarks) {
    sightings += static_cast<int>(landmark.sightings.size());
    views += static_cast<std::size_t>(landmark.viewCount());
  }
  const double count = static_cast<double>(window.landmarks.size());
  std::printf("%d tracks a frame: %zu states, %zu landmarks, seen from %.1f states and in %.1f images each\n",
              tracks, window.order.size(), window.landmarks.size(), sightings / count,
              static_cast<double>(views) / count);

  CeresWindow ceres(window);
  const std::vector<CeresSolver> solvers{
      {"Ceres DENSE_SCHUR, Eigen", ceres::DENSE_SCHUR, ceres::EIGEN, ceres::SUITE_SPARSE},
      {"Ceres DENSE_SCHUR, LAPACK", ceres::DENSE_SCHUR, ceres::LAPACK, ceres::SUITE_SPARSE},
      {"Ceres SPARSE_SCHUR, SuiteSparse", ceres::SPARSE_SCHUR, ceres::EIGEN, ceres::SUITE_SPARSE},
      {"Ceres SPARSE_SCHUR, Eigen", ceres::SPARSE_SCHUR, ceres::EIGEN, ceres::EIGEN_SPARSE}};
  if (!sameSolution(window, ceres, solvers[0])) {
    std::printf("    the solutions differ\n");
    return false;
  }

  const WindowValues start = window.values();
  std::vector<double> ours;
  std::vector<double> build;
  std::vector<std::vector<double>> theirs(solvers.size());
  for (int repetition = 0; repetition < kRepetitions; ++repetition) {
    window.setValues(start);
    ours.push_back(processTimed([&] { static_cast<void>(window.update(kIterations)); }));
    window.setValues(start);
    for (std::size_t s = 0; s < solvers.size(); ++s) {
      ceres.reset();
      theirs[s].push_back(processTimed([&] { ceres.solve(solvers[s], kIterations); }));
    }
    build.push_back(processTimed([&] { const CeresWindow rebuilt(window); }));
  }
  std::vector<double> step;
  double landmarks = 0;
  timeSteps(flight, step, landmarks);

  std::printf("  %d Gauss-Newton steps, medians of %d:\n", kIterations, kRepetitions);
  printTime("swiftlet", ours);
  double best = median(theirs[0]);
  for (std::size_t s = 0; s < solvers.size(); ++s) {
    printTime(solvers[s].name.c_str(), theirs[s]);
    best = std::min(best, median(theirs[s]));
  }
  printTime("building and freeing Ceres' problem", build);
  printTime("Smoother::step, a whole frame", step);
  std::printf(
      "    ratio, fastest Ceres over swiftlet: %.1f (with building %.1f); over all of Smoother::step "
      "(%.0f landmarks): %.1f\n",
      best / median(ours), (best + median(build)) / median(ours), landmarks, best / median(step));
  return true;
}

}  // namespace

int main() {
  bool same = true;
  for (const int tracks : {100, 200}) same = compare(tracks) && same;
  return same ? 0 : 1;
}
