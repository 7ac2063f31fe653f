// What three slow viewers cost a flight: a log at its own pace, with and without them, in pairs. Prints for
// each pair the frames lost and the CPU time from image to pose; minutes of work, run by hand:
//
//   cmake --build --preset release --target view_load
//   build/release/tests/logs/view_load euroc_mh01_20s 5
//
// Arguments: log (of SWIFTLET_DATA, or a folder), pairs.

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/statistics.hpp"
#include "tests/support/view_client.hpp"

namespace swiftlet {
namespace {

using std::chrono::milliseconds;

/// Sockets that ask for the stream and take one byte a second of it.
class SlowViewers {
 public:
  explicit SlowViewers(int port) : thread_([this, port] { run(port); }) {}
  ~SlowViewers() {
    stop_ = true;
    thread_.join();
  }
  SlowViewers(const SlowViewers&) = delete;
  SlowViewers& operator=(const SlowViewers&) = delete;

 private:
  void run(int port) {
    constexpr int kViewers = 3;
    std::vector<ViewClient> viewers;
    for (int i = 0; i < kViewers; ++i) viewers.emplace_back(port, true);
    for (ViewClient& one : viewers) {
      while (!stop_ && !one.connectAndAsk("/stream")) std::this_thread::sleep_for(milliseconds(10));
    }
    for (int tenth = 0; !stop_; ++tenth) {
      std::this_thread::sleep_for(milliseconds(100));
      if (tenth % 10 != 0) continue;
      for (ViewClient& one : viewers) one.readSome(0, 1);
    }
  }

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

struct Figures {
  std::uint64_t lost = 0;
  double p50 = 0;  ///< ms
  double p99 = 0;
  double wall_p99 = 0;
  nlohmann::ordered_json view;
};

Figures fly(const std::string& log, bool watched) {
  constexpr double kMilli = 1e3;
  const ScratchFolder folder("view_load");
  ReplayRequest request;
  request.log = log;
  request.out = folder.file("run");
  request.real_time = true;
  std::optional<SlowViewers> viewers;
  if (watched) {
    request.view = ViewAddress{};
    request.view->port = freePort();
    viewers.emplace(request.view->port);
  }
  const ReplayResult result = runReplay(request, Settings{});
  const StageTimes& times = result.statistics.times[static_cast<std::size_t>(StageId::kImageToPose)];
  LatencyHistogram cpu = times.cpu_frames;
  cpu.add(times.cpu_keyframes);
  LatencyHistogram wall = times.wall_frames;
  wall.add(times.wall_keyframes);
  Figures figures;
  const auto& counters = result.summary["counters"];
  figures.lost =
      counters["log"]["images"][0].get<std::uint64_t>() - counters["odometry"]["frames"].get<std::uint64_t>();
  figures.p50 = cpu.percentile(0.5) * kMilli;
  figures.p99 = cpu.percentile(0.99) * kMilli;
  figures.wall_p99 = wall.percentile(0.99) * kMilli;
  if (watched) figures.view = result.summary["executor"]["view"];
  return figures;
}

std::string loadOfMachine() {
  std::ifstream file("/proc/loadavg");
  std::string load;
  file >> load;
  return load;
}

int run(const std::string& log, int pairs) {
  fmt::print("image to pose, CPU [ms]        without viewers        three slow viewers\n");
  fmt::print("{:>4} {:>5} | {:>4} {:>6} {:>6} | {:>4} {:>6} {:>6} | {:>5} | {:>13} | {:>7}\n", "pair", "load",
             "lost", "50 %", "99 %", "lost", "50 %", "99 %", "ratio", "wall 99 %", "dropped");
  std::vector<double> ratios;
  std::uint64_t lost = 0;
  for (int pair = 0; pair < pairs; ++pair) {
    // In turn the one and the other first: the machine's own work drifts.
    Figures alone;
    if (pair % 2 == 0) alone = fly(log, false);
    const Figures watched = fly(log, true);
    if (pair % 2 != 0) alone = fly(log, false);
    ratios.push_back(watched.p99 / alone.p99);
    lost += watched.lost;
    fmt::print(
        "{:>4} {:>5} | {:>4} {:>6.2f} {:>6.2f} | {:>4} {:>6.2f} {:>6.2f} | {:>5.3f} | {:>6.2f} {:>6.2f} | "
        "{:>7}\n",
        pair + 1, loadOfMachine(), alone.lost, alone.p50, alone.p99, watched.lost, watched.p50, watched.p99,
        ratios.back(), alone.wall_p99, watched.wall_p99, watched.view["dropped"].dump());
    std::fflush(stdout);
  }
  fmt::print(
      "99 % with viewers over without: median {:.3f}, {:.3f} to {:.3f}; frames lost with viewers: {}\n",
      test::quantile(ratios, 0.5), test::quantile(ratios, 0), test::quantile(ratios, 1), lost);
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace swiftlet

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "euroc_mh01_20s";
  return swiftlet::run(swiftlet::findLog(name).value_or(name), argc > 2 ? std::atoi(argv[2]) : 5);
}
