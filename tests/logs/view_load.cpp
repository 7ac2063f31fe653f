// What viewers cost a flight: a log at its own pace, with and without them, in pairs. Prints for each pair
// the frames lost and the CPU time from image to pose, and what one viewer got; minutes of work, run by hand:
//
//   cmake --build --preset release --target view_load
//   build/release/tests/logs/view_load euroc_mh01_20s 5 light
//
// Arguments: log (of SWIFTLET_DATA, or a folder), pairs, "slow" (the default: three viewers that take a byte
// a second) or "light" (two that take all that comes).

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/statistics.hpp"
#include "tests/support/view_client.hpp"

namespace swiftlet {
namespace {

using std::chrono::milliseconds;

/// Sockets that ask for the stream. Slow ones are three and take a byte a second of it; light ones are two
/// and take all of it, as browsers do.
class Viewers {
 public:
  Viewers(int port, bool slow) : thread_([this, port, slow] { run(port, slow); }) {}
  ~Viewers() { end(); }
  Viewers(const Viewers&) = delete;
  Viewers& operator=(const Viewers&) = delete;

  void end() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  /// After end(), of one viewer: bytes in the second with the most of them; bytes a second on average;
  /// instants of images.
  [[nodiscard]] double most() const { return most_; }
  [[nodiscard]] double mean() const { return seconds_ > 0 ? bytes_ / seconds_ : 0; }
  [[nodiscard]] int images() const { return images_; }

 private:
  void run(int port, bool slow) {
    std::vector<ViewClient> viewers;
    for (int i = 0; i < (slow ? 3 : 2); ++i) viewers.emplace_back(port, slow);
    for (ViewClient& one : viewers) {
      while (!stop_ && !one.connectAndAsk("/stream")) std::this_thread::sleep_for(milliseconds(10));
    }
    if (slow) {
      for (int tenth = 0; !stop_; ++tenth) {
        std::this_thread::sleep_for(milliseconds(100));
        if (tenth % 10 != 0) continue;
        for (ViewClient& one : viewers) one.readSome(0, 1);
      }
      return;
    }
    take(viewers);
  }

  void take(std::vector<ViewClient>& viewers) {
    std::deque<std::pair<double, double>> lately;  // time, bytes in all
    double begin = 0;
    std::size_t seen = 0;
    bool open = true;
    while (open && !stop_) {
      std::this_thread::sleep_for(milliseconds(10));
      for (ViewClient& one : viewers) {
        std::size_t before = 0;
        do {
          before = one.text().size();
          open = one.readSome(0) && open;
        } while (one.text().size() > before);
      }
      const std::string& text = viewers.front().text();
      if (text.empty()) continue;
      const double now = wallSeconds();
      if (begin == 0) begin = now;
      seconds_ = now - begin;
      bytes_ = static_cast<double>(text.size());
      lately.emplace_back(now, bytes_);
      while (lately.front().first < now - 1) lately.pop_front();
      most_ = std::max(most_, bytes_ - lately.front().second);
      for (std::size_t at = 0; (at = text.find("event: images", seen)) != std::string::npos; seen = at + 1)
        ++images_;
    }
  }

  std::atomic<bool> stop_{false};
  double most_ = 0, bytes_ = 0, seconds_ = 0;
  int images_ = 0;
  std::thread thread_;
};

struct Figures {
  std::uint64_t lost = 0;
  double p50 = 0;  ///< ms
  double p99 = 0;
  double wall_p99 = 0;
  double most_bytes = 0, mean_bytes = 0;  ///< of one viewer in a second
  int images = 0;
  nlohmann::ordered_json view;
};

Figures fly(const std::string& log, bool watched, bool slow) {
  constexpr double kMilli = 1e3;
  const ScratchFolder folder("view_load");
  ReplayRequest request;
  request.log = log;
  request.out = folder.file("run");
  request.real_time = true;
  std::optional<Viewers> viewers;
  if (watched) {
    request.view = ViewAddress{};
    request.view->port = freePort();
    viewers.emplace(request.view->port, slow);
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
  if (!watched) return figures;
  viewers->end();
  figures.view = result.summary["executor"]["view"];
  figures.most_bytes = viewers->most();
  figures.mean_bytes = viewers->mean();
  figures.images = viewers->images();
  return figures;
}

std::string loadOfMachine() {
  std::ifstream file("/proc/loadavg");
  std::string load;
  file >> load;
  return load;
}

int run(const std::string& log, int pairs, bool slow) {
  fmt::print("image to pose, CPU [ms]        without viewers        with {}\n",
             slow ? "three slow viewers" : "two light viewers");
  fmt::print(
      "{:>4} {:>5} | {:>4} {:>6} {:>6} | {:>4} {:>6} {:>6} | {:>5} | {:>13} | {:>7} | {:>6} {:>5} {:>5}\n",
      "pair", "load", "lost", "50 %", "99 %", "lost", "50 %", "99 %", "ratio", "wall 99 %", "dropped",
      "images", "MB/s", "most");
  std::vector<double> ratios;
  std::uint64_t lost = 0;
  for (int pair = 0; pair < pairs; ++pair) {
    // In turn the one and the other first: the machine's own work drifts.
    Figures alone;
    if (pair % 2 == 0) alone = fly(log, false, slow);
    const Figures watched = fly(log, true, slow);
    if (pair % 2 != 0) alone = fly(log, false, slow);
    ratios.push_back(watched.p99 / alone.p99);
    lost += watched.lost;
    fmt::print(
        "{:>4} {:>5} | {:>4} {:>6.2f} {:>6.2f} | {:>4} {:>6.2f} {:>6.2f} | {:>5.3f} | {:>6.2f} {:>6.2f} | "
        "{:>7} | {:>6} {:>5.2f} {:>5.2f}\n",
        pair + 1, loadOfMachine(), alone.lost, alone.p50, alone.p99, watched.lost, watched.p50, watched.p99,
        ratios.back(), alone.wall_p99, watched.wall_p99, watched.view["dropped"].dump(), watched.images,
        watched.mean_bytes / 1e6, watched.most_bytes / 1e6);
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
  const bool slow = argc <= 3 || std::string(argv[3]) != "light";
  return swiftlet::run(swiftlet::findLog(name).value_or(name), argc > 2 ? std::atoi(argv[2]) : 5, slow);
}
