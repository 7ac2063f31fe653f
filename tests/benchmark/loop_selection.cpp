// Time per new loop against the number of loops held, beside one search over all of them at once:
//   benchmark_loop_selection > growth.csv
// Where both are exact they must select as many: it says so and returns 1 otherwise. Half of the loops are
// false, a third of these in groups that agree with each other.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "mapping/pose_graph/loop_selection.hpp"
#include "tests/mapping/simulated_chain.hpp"

namespace {

using swiftlet::SE3;

constexpr std::uint32_t kPoses = 4000;
constexpr std::uint32_t kLoops = 2000;
constexpr std::uint32_t kNodes = 200;
constexpr std::uint32_t kGroup = 8;

double secondsOf(const auto& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<swiftlet::RelativePose<SE3>> mixedLoops(const swiftlet::SimulatedChain<SE3>& chain,
                                                    const swiftlet::PoseMatrix<SE3>& noise,
                                                    swiftlet::Random& random) {
  std::vector<swiftlet::RelativePose<SE3>> loops;
  while (loops.size() < kLoops) {
    const std::uint32_t from = random.below(kPoses - 200);
    const std::uint32_t to = from + 100 + random.below(kPoses - from - 100 - kGroup);
    const std::uint32_t kind = random.below(6);  // 0..2 true, 3 and 4 false, 5 a group
    const Eigen::Vector3d off(random.normal(), random.normal(), random.normal());
    const std::uint32_t row = kind == 5 && random.below(kGroup) == 0 ? kGroup : 1;
    for (std::uint32_t k = 0; k < row && loops.size() < kLoops; ++k) {
      loops.push_back(chain.loop(from + k, to + k, noise, random));
      if (kind >= 3) {
        loops.back().T_from_to.translation += 5 * off;
      }
    }
  }
  return loops;
}

}  // namespace

int main() {
  swiftlet::Random random(1);
  const auto step = swiftlet::testCovariance<SE3>(1e-3, 1e-2);
  const auto noise = swiftlet::testCovariance<SE3>(3e-3, 2e-2);
  const swiftlet::SimulatedChain<SE3> chain(kPoses, step, random);
  const auto loops = mixedLoops(chain, noise, random);
  const swiftlet::LoopSelectionLimits limits{kPoses, kLoops};
  swiftlet::LoopSelection<SE3> grown(limits, swiftlet::loopSelectionSettings<SE3>());
  swiftlet::LoopSelection<SE3> anew(limits, swiftlet::loopSelectionSettings<SE3>());
  grown.odometry() = chain.odometry;
  anew.odometry() = chain.odometry;
  std::printf("loops_held,us_per_new_loop,us_worst,ms_one_search,selected,exact,as_many\n");
  double sum = 0;
  double worst = 0;
  std::uint32_t since = 0;
  bool all_equal = true;
  for (std::uint32_t k = 0; k < kLoops; ++k) {
    std::uint32_t id = 0;
    const double now = secondsOf([&] { (void)grown.addLoop(loops[k], kNodes, id); });
    (void)anew.holdLoop(loops[k], id);
    sum += now;
    worst = std::max(worst, now);
    ++since;
    const std::uint32_t held = k + 1;
    if (held == 10 || held == 20 || held == 50 || held == 100 || held == 200 || held == 500 || held == 1000 ||
        held == 1500 || held == kLoops) {
      const double search = secondsOf([&] { anew.search(kNodes); });
      const bool exact = grown.exact() && anew.exact();
      const std::size_t selected = grown.selected().size();
      const bool equal = selected == anew.selected().size();
      all_equal = all_equal && (equal || !exact);
      std::printf("%u,%.1f,%.1f,%.3f,%zu,%d,%d\n", held, 1e6 * sum / since, 1e6 * worst, 1e3 * search,
                  selected, exact ? 1 : 0, equal ? 1 : 0);
      sum = worst = 0;
      since = 0;
    }
  }
  return all_equal ? 0 : 1;
}
