#include "firmware_host/realtime/machine_report.hpp"

#include <fmt/format.h>
#include <linux/capability.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string_view>

#include "estimator/core/units.hpp"
#include "firmware_host/realtime/machine_files.hpp"

namespace swiftlet {
namespace {

/// Soft limit in /proc/self/limits: the first word after the limit's name.
std::optional<std::string> limitOf(const Machine& machine, std::string_view name) {
  const auto rest = machine.lineAfter("/proc/self/limits", name);
  if (!rest) return std::nullopt;
  std::istringstream words(*rest);
  std::string soft;
  return words >> soft ? std::optional(soft) : std::nullopt;
}

/// Whether the kernel serves starving threads by a fair server instead of throttling (Linux 6.12 and later).
bool hasFairServer(const Machine& machine) {
  const auto release = machine.text("/proc/sys/kernel/osrelease");
  int major = 0;
  int minor = 0;
  if (!release || std::sscanf(release->c_str(), "%d.%d", &major, &minor) != 2) return false;
  constexpr int kMajor = 6;
  constexpr int kMinor = 12;
  return major > kMajor || (major == kMajor && minor >= kMinor);
}

MachineLine throttling(const Machine& machine) {
  const char* what = "real-time throttling";
  const auto runtime = machine.number("/proc/sys/kernel/sched_rt_runtime_us");
  const auto period = machine.number("/proc/sys/kernel/sched_rt_period_us");
  if (!runtime || !period || *period <= 0) return unknown(what);
  if (*runtime < 0) {
    return {what, "off: a real-time thread that never sleeps would occupy its CPU forever",
            MachineVerdict::kNote, ""};
  }
  const double share = kPercent * static_cast<double>(*runtime) / static_cast<double>(*period);
  std::string found = fmt::format("on: real-time threads get {:.1f} % of {:.3f} s", share,
                                  static_cast<double>(*period) * 1e-6);
  if (hasFairServer(machine)) found += ", the rest only if other threads starve";
  // Flight threads sleep more than half of the time: a smaller share is a wrong setting.
  constexpr double kLeastShare = 90;
  if (share >= kLeastShare) return {what, found, MachineVerdict::kGood, ""};
  return {what, found, MachineVerdict::kPoor, "sysctl kernel.sched_rt_runtime_us=950000"};
}

MachineLine priorityRight(const Machine& machine, int wanted) {
  const char* what = "real-time priority";
  const auto capability = machine.hasCapability("/proc/self/status", CAP_SYS_NICE);
  const auto limit = limitOf(machine, "Max realtime priority");
  if (capability.value_or(false)) {
    return {what, fmt::format("any (CAP_SYS_NICE; RLIMIT_RTPRIO {})", limit.value_or("unknown")),
            MachineVerdict::kGood, ""};
  }
  if (!limit) return unknown(what);
  const auto highest = Machine::toNumber(*limit);
  std::string found = fmt::format("RLIMIT_RTPRIO {}, required {}", *limit, wanted);
  if (*limit == "unlimited" || highest.value_or(0) >= wanted) {
    return {what, std::move(found), MachineVerdict::kGood, ""};
  }
  return {what, std::move(found), MachineVerdict::kPoor,
          "`setcap cap_sys_nice+ep` on the program, LimitRTPRIO=99 in its systemd unit, or `ulimit -r 99`"};
}

MachineLine lockRight(const Machine& machine) {
  const char* what = "locked memory";
  const auto capability = machine.hasCapability("/proc/self/status", CAP_IPC_LOCK);
  const auto limit = limitOf(machine, "Max locked memory");
  if (capability.value_or(false)) {
    return {what, fmt::format("any (CAP_IPC_LOCK; RLIMIT_MEMLOCK {} bytes)", limit.value_or("unknown")),
            MachineVerdict::kGood, ""};
  }
  if (!limit) return unknown(what);
  if (*limit == "unlimited") return {what, "RLIMIT_MEMLOCK unlimited", MachineVerdict::kGood, ""};
  return {what, fmt::format("RLIMIT_MEMLOCK {} bytes", *limit), MachineVerdict::kPoor,
          "`setcap cap_ipc_lock+ep` on the program, LimitMEMLOCK=infinity in its systemd unit, or `ulimit -l "
          "unlimited`"};
}

MachineLine preemption(const Machine& machine) {
  const char* what = "preemption";
  const char* remedy = "run a kernel with PREEMPT_RT, or boot with preempt=full";
  const auto version = machine.text("/proc/sys/kernel/version");
  const auto realtime = machine.number("/sys/kernel/realtime");
  const auto contains = [&version](std::string_view word) {
    return version && version->find(word) != std::string::npos;
  };
  if (realtime == 1 || contains("PREEMPT_RT")) return {what, "PREEMPT_RT", MachineVerdict::kGood, ""};
  if (!version) return unknown(what);
  if (contains("PREEMPT_DYNAMIC")) {
    // "none voluntary (full)": the mode in parentheses is active.
    const auto modes = machine.text("/sys/kernel/debug/sched/preempt");
    const std::string mode = modes.value_or("not readable");
    const bool full = mode.find("(full)") != std::string::npos;
    return {what, fmt::format("PREEMPT_DYNAMIC, mode {}", mode), MachineVerdict::kNote, full ? "" : remedy};
  }
  if (contains("PREEMPT")) return {what, "PREEMPT", MachineVerdict::kNote, ""};
  return {what, "none inside the kernel", MachineVerdict::kPoor, remedy};
}

/// Number of CPUs in a list such as "0-3,6"; empty: not such a list.
std::optional<int> countOf(const std::string& list) {
  std::istringstream parts(list);
  int count = 0;
  for (std::string part; std::getline(parts, part, ',');) {
    int first = 0;
    int last = 0;
    const int fields = std::sscanf(part.c_str(), "%d-%d", &first, &last);
    if (fields < 1) return std::nullopt;
    count += fields == 2 ? last - first + 1 : 1;
  }
  return count;
}

MachineLine cpus(const Machine& machine) {
  const char* what = "CPUs";
  const auto online = machine.text("/sys/devices/system/cpu/online");
  const auto isolated = machine.text("/sys/devices/system/cpu/isolated");
  const auto count = online ? countOf(*online) : std::nullopt;
  if (!count) return unknown(what);
  const std::string apart = isolated && !isolated->empty() ? *isolated : std::string("none");
  std::string found = fmt::format("{} ({}), isolated: {}", *count, *online, isolated ? apart : "unknown");
  // Tracking and smoothing run in parallel.
  if (*count < 2)
    return {what, std::move(found), MachineVerdict::kPoor, "tracking and smoothing need one each"};
  const bool some = isolated && !isolated->empty();
  return {what, std::move(found), some ? MachineVerdict::kGood : MachineVerdict::kNote,
          some ? "" : "isolcpus= in the kernel's command line and realtime.*_cpu keep other work away"};
}

MachineLine governor(const Machine& machine) {
  const char* what = "CPU governor";
  std::vector<std::string> seen;
  constexpr int kMostCpus = 1024;
  for (int cpu = 0; cpu < kMostCpus; ++cpu) {
    const auto name =
        machine.text(fmt::format("/sys/devices/system/cpu/cpu{}/cpufreq/scaling_governor", cpu));
    if (!name) break;
    if (std::find(seen.begin(), seen.end(), *name) == seen.end()) seen.push_back(*name);
  }
  if (seen.empty()) return unknown(what);
  if (seen.size() == 1 && seen.front() == "performance") {
    return {what, "performance", MachineVerdict::kGood, ""};
  }
  return {
      what, fmt::format("{}", fmt::join(seen, ", ")), MachineVerdict::kPoor,
      "`cpupower frequency-set -g performance`: a clock that rises only under load slows the first frames"};
}

/// This process's control group in the hierarchy whose controllers include `controller` ("" is version 2).
std::optional<std::string> groupOf(const Machine& machine, std::string_view controller) {
  const auto groups = machine.text("/proc/self/cgroup");
  if (!groups) return std::nullopt;
  std::istringstream lines(*groups);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string names = "," + line.substr(first + 1, second - first - 1) + ",";
    const std::string wanted = controller.empty() ? ",," : fmt::format(",{},", controller);
    if (names.find(wanted) != std::string::npos) return line.substr(second + 1);
  }
  return std::nullopt;
}

struct Quota {
  double cpus = 0;     ///< number of CPUs granted; 0: no quota
  bool found = false;  ///< at least one file could be read
};

/// The smallest quota of the group and of those above it; `read` is called with each group's folder.
template <typename Read>
Quota tightest(std::string group, Read&& read) {
  Quota quota;
  for (;;) {
    if (const std::optional<double> here = read(group == "/" ? std::string() : group)) {
      quota.found = true;
      if (*here > 0) quota.cpus = quota.cpus > 0 ? std::min(quota.cpus, *here) : *here;
    }
    const std::size_t slash = group.rfind('/');
    if (slash == std::string::npos || group == "/") return quota;
    group = slash == 0 ? "/" : group.substr(0, slash);
  }
}

/// "max 100000" or "50000 100000".
std::optional<double> parseCpuMax(const std::string& text) {
  std::istringstream words(text);
  std::string quota;
  double period = 0;
  if (!(words >> quota >> period) || period <= 0) return std::nullopt;
  const auto runtime = Machine::toNumber(quota);
  return runtime ? static_cast<double>(*runtime) / period : 0;
}

constexpr const char* kFirstVersionFolders[] = {"/sys/fs/cgroup/cpu", "/sys/fs/cgroup/cpu,cpuacct"};

MachineLine quotaLine(const Machine& machine) {
  const char* what = "CPU quota";
  Quota quota;
  if (const auto group = groupOf(machine, "")) {
    for (const char* folder : {"/sys/fs/cgroup", "/sys/fs/cgroup/unified"}) {
      const Quota here = tightest(*group, [&](const std::string& name) -> std::optional<double> {
        const auto text = machine.text(folder + name + "/cpu.max");
        return text ? parseCpuMax(*text) : std::nullopt;
      });
      if (here.found) quota = here;
    }
    // Only groups below the root have the file: if there is none, there is no quota.
    if (!quota.found && machine.text("/sys/fs/cgroup/cgroup.controllers")) quota.found = true;
  }
  if (const auto group = groupOf(machine, "cpu"); group && !quota.found) {
    for (const char* folder : kFirstVersionFolders) {
      const Quota here = tightest(*group, [&](const std::string& name) -> std::optional<double> {
        const auto runtime = machine.number(folder + name + "/cpu.cfs_quota_us");
        const auto period = machine.number(folder + name + "/cpu.cfs_period_us");
        if (!runtime) return std::nullopt;
        return *runtime > 0 && period.value_or(0) > 0
                   ? static_cast<double>(*runtime) / static_cast<double>(*period)
                   : 0.0;
      });
      if (here.found) quota = here;
    }
  }
  if (!quota.found) return unknown(what);
  if (quota.cpus <= 0) return {what, "none", MachineVerdict::kGood, ""};
  return {what, fmt::format("{:.2f} CPUs' worth of time", quota.cpus), MachineVerdict::kPoor,
          "remove the quota of the control group (docker --cpus, systemd CPUQuota=): once it is used up, all "
          "threads stop until the next period"};
}

MachineLine realtimeQuota(const Machine& machine) {
  const char* what = "real-time quota";
  const auto group = groupOf(machine, "cpu");
  if (!group) {
    return machine.text("/proc/self/cgroup")
               ? MachineLine{what, "none (no control groups of version 1)", MachineVerdict::kGood, ""}
               : unknown(what);
  }
  for (const char* folder : kFirstVersionFolders) {
    const std::string name = *group == "/" ? "" : *group;
    const auto runtime = machine.number(folder + name + "/cpu.rt_runtime_us");
    if (!runtime) continue;
    if (*runtime != 0) {
      return {what, *runtime < 0 ? "none" : fmt::format("{} us a period", *runtime), MachineVerdict::kGood,
              ""};
    }
    return {what, "0: SCHED_FIFO is refused in this control group", MachineVerdict::kPoor,
            "write 950000 to cpu.rt_runtime_us of the group (docker --cpu-rt-runtime)"};
  }
  return {what, "none (the kernel has no real-time groups)", MachineVerdict::kGood, ""};
}

MachineLine clockLine(const Machine& machine) {
  const char* what = "clock";
  const auto source = machine.text("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  if (!source) return unknown(what);
  // Clock sources that are read without entering the kernel.
  const bool fast = *source == "tsc" || *source == "kvm-clock" || *source == "arch_sys_counter" ||
                    *source == "hyperv_clocksource_tsc_page";
  return {
      what, *source, fast ? MachineVerdict::kGood : MachineVerdict::kNote,
      fast ? "" : "each clock reading enters the kernel: check clocksource= in the kernel's command line"};
}

}  // namespace

const char* verdictName(MachineVerdict verdict) {
  switch (verdict) {
    case MachineVerdict::kGood:
      return "good";
    case MachineVerdict::kNote:
      return "note";
    case MachineVerdict::kPoor:
      return "poor";
    case MachineVerdict::kUnknown:
      break;
  }
  return "unknown";
}

const MachineLine* MachineReport::find(const std::string& what) const {
  const auto line = std::find_if(lines.begin(), lines.end(),
                                 [&what](const MachineLine& candidate) { return candidate.what == what; });
  return line == lines.end() ? nullptr : &*line;
}

std::string MachineReport::text(const std::string& title) const {
  std::size_t width = 0;
  for (const MachineLine& line : lines) width = std::max(width, line.what.size());
  std::string text = title + "\n";
  for (const MachineLine& line : lines) {
    text += fmt::format("  {:<{}}  {:<7}  {}\n", line.what, width, verdictName(line.verdict), line.found);
    if (!line.remedy.empty()) text += fmt::format("  {:<{}}  {:<7}  -> {}\n", "", width, "", line.remedy);
  }
  return text;
}

nlohmann::ordered_json MachineReport::json() const {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const MachineLine& line : lines) {
    json.push_back({{"what", line.what},
                    {"found", line.found},
                    {"verdict", verdictName(line.verdict)},
                    {"remedy", line.remedy}});
  }
  return json;
}

MachineReport inspectMachine(const std::string& root, int priority) {
  const Machine machine(root);
  return {{throttling(machine), priorityRight(machine, priority), lockRight(machine), preemption(machine),
           cpus(machine), governor(machine), idleStates(machine), interrupts(machine), quotaLine(machine),
           realtimeQuota(machine), clockLine(machine)}};
}

}  // namespace swiftlet
