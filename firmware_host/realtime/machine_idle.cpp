// Causes that keep a CPU from a thread that has just become ready: idle states with slow wake-up, and
// interrupts.

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "firmware_host/realtime/machine_files.hpp"

namespace swiftlet {

MachineLine idleStates(const Machine& machine) {
  const char* what = "idle states";
  const std::string folder = "/sys/devices/system/cpu/cpu0/cpuidle/state";
  // us; propagation of a sample has a budget of 50 us at the 99th percentile.
  constexpr std::int64_t kQuick = 50;
  constexpr int kMostStates = 16;
  std::int64_t slowest = -1;
  std::string name;
  for (int state = 0; state < kMostStates; ++state) {
    const std::string path = folder + std::to_string(state);
    const auto latency = machine.number(path + "/latency");
    if (!latency) break;
    if (machine.number(path + "/disable").value_or(0) != 0 || *latency <= slowest) continue;
    slowest = *latency;
    name = machine.text(path + "/name").value_or("unnamed");
  }
  if (slowest < 0) return unknown(what);
  std::string found = fmt::format("deepest {}, wake-up takes {} us", name, slowest);
  if (slowest <= kQuick) return {what, std::move(found), MachineVerdict::kGood, ""};
  return {what, std::move(found), MachineVerdict::kPoor,
          fmt::format("`cpupower idle-set -D {}`, or processor.max_cstate=1 in the kernel's command line",
                      kQuick)};
}

MachineLine interrupts(const Machine& machine) {
  const char* what = "interrupts";
  const auto table = machine.text("/proc/interrupts");
  const double uptime = std::strtod(machine.text("/proc/uptime").value_or("").c_str(), nullptr);
  if (!table) return unknown(what);
  std::istringstream lines(*table);
  std::string line;
  std::getline(lines, line);
  std::istringstream names(line);
  std::vector<std::int64_t> counts;
  for (std::string name; names >> name;) counts.push_back(0);
  if (counts.empty() || line.find("CPU") == std::string::npos) return unknown(what);
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::string label;
    fields >> label;
    // Devices' rows are numbered; the others are the kernel's own timers and calls.
    if (label.empty() || std::isdigit(static_cast<unsigned char>(label.front())) == 0) continue;
    for (std::int64_t& count : counts) {
      std::int64_t here = 0;
      if (fields >> here) count += here;
    }
  }
  const std::int64_t all = std::accumulate(counts.begin(), counts.end(), std::int64_t{0});
  const auto busiest = std::ranges::max_element(counts);
  constexpr std::int64_t kPercent = 100;
  std::string found = fmt::format("CPU {} handles {} % of the devices'", busiest - counts.begin(),
                                  all > 0 ? *busiest * kPercent / all : 0);
  // A camera and an IMU together cause some hundred a second.
  constexpr double kMany = 5000;  // a second
  const double rate = uptime > 0 ? static_cast<double>(all) / uptime : kMany;
  if (uptime > 0) found += fmt::format(", {:.0f} a second since boot", rate);
  if (rate < kMany) return {what, std::move(found), MachineVerdict::kGood, ""};
  return {
      what, std::move(found), MachineVerdict::kNote,
      "keep realtime.*_cpu off that CPU, or move the interrupts with /proc/irq/<number>/smp_affinity_list"};
}

}  // namespace swiftlet
