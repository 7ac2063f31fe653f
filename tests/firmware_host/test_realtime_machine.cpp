// The machine report over made-up machines: each fact read, judged, and "unknown" where there is no file.

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/realtime/machine_report.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::contains;

using Files = std::map<std::string, std::string>;

const std::string kGovernor = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor";
const std::string kGovernor1 = "/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor";
const std::string kRuntime = "/proc/sys/kernel/sched_rt_runtime_us";

const std::string kIdle = "/sys/devices/system/cpu/cpu0/cpuidle/state";
const std::string kInterrupts =
    "           CPU0       CPU1\n  9:        900        100   IO-APIC  acpi\n"
    " 24:       2100        900   PCI-MSI  xhci\nLOC:    9999999    9999999   Local timer interrupts\n";

/// A machine set up for flight.
Files goodMachine() {
  return {{kRuntime, "950000\n"},
          {"/proc/sys/kernel/sched_rt_period_us", "1000000\n"},
          {"/proc/sys/kernel/osrelease", "6.1.0-rt\n"},
          {"/proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian\n"},
          {"/proc/self/limits",
           "Limit                     Soft Limit           Hard Limit           Units     \n"
           "Max locked memory         unlimited            unlimited            bytes     \n"
           "Max realtime priority     99                   99                             \n"},
          {"/proc/self/status", "Name:\tx\nCapEff:\t0000000000000000\n"},
          {"/proc/self/cgroup", "0::/user.slice/session\n"},
          {"/sys/fs/cgroup/cgroup.controllers", "cpu io memory\n"},
          {"/sys/fs/cgroup/user.slice/cpu.max", "max 100000\n"},
          {"/sys/devices/system/cpu/online", "0-3\n"},
          {"/sys/devices/system/cpu/isolated", "2-3\n"},
          {kGovernor, "performance\n"},
          {kGovernor1, "performance\n"},
          {kIdle + "0/latency", "0\n"},
          {kIdle + "0/name", "POLL\n"},
          {kIdle + "1/latency", "2\n"},
          {kIdle + "1/name", "C1\n"},
          {"/proc/interrupts", kInterrupts},
          {"/proc/uptime", "100.5 200.0\n"},
          {"/sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"}};
}

MachineReport reportOf(const Files& files) {
  const ScratchFolder folder("machine");
  for (const auto& [path, text] : files) {
    const std::filesystem::path file = folder.path() + path;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << text;
  }
  return inspectMachine(folder.path());
}

/// The line `what` of the good machine with some files changed.
MachineLine lineWith(const std::string& what, const Files& changes) {
  Files files = goodMachine();
  for (const auto& [path, text] : changes) files[path] = text;
  const MachineReport report = reportOf(files);
  REQUIRE(report.find(what) != nullptr);
  return *report.find(what);
}

TEST_CASE("a machine set up for flight is good in every line") {
  const MachineReport report = reportOf(goodMachine());
  CHECK(report.lines.size() == 11);
  for (const MachineLine& line : report.lines) {
    INFO(line.what << ": " << line.found);
    CHECK(line.verdict == MachineVerdict::kGood);
    CHECK(line.remedy.empty());
  }
  CHECK(contains(report.find("real-time throttling")->found, "95.0 %"));
  CHECK(contains(report.find("CPUs")->found, "4 (0-3), isolated: 2-3"));
}

TEST_CASE("a machine that says nothing is unknown in every line, and no error") {
  const MachineReport report = reportOf({});
  for (const MachineLine& line : report.lines) {
    INFO(line.what);
    CHECK(line.verdict == MachineVerdict::kUnknown);
    CHECK(line.found == "unknown");
  }
  CHECK(report.find("no such line") == nullptr);
  // Nonsense is as good as nothing.
  Files nonsense = goodMachine();
  for (auto& [path, text] : nonsense) text = "?!\n";
  for (const MachineLine& line : reportOf(nonsense).lines) CHECK(!line.found.empty());
}

TEST_CASE("throttling: off, usual, tight, and under kernels with the fair server") {
  const std::string what = "real-time throttling";
  CHECK(lineWith(what, {{kRuntime, "-1"}}).verdict == MachineVerdict::kNote);
  const MachineLine tight = lineWith(what, {{kRuntime, "200000"}});
  CHECK(tight.verdict == MachineVerdict::kPoor);
  CHECK(contains(tight.found, "20.0 %"));
  CHECK(contains(tight.remedy, "sched_rt_runtime_us"));
  CHECK(contains(lineWith(what, {{"/proc/sys/kernel/osrelease", "6.18.2"}}).found, "starve"));
  CHECK(!contains(lineWith(what, {{"/proc/sys/kernel/osrelease", "6.11.9"}}).found, "starve"));
  CHECK(lineWith(what, {{"/proc/sys/kernel/sched_rt_period_us", "0"}}).verdict == MachineVerdict::kUnknown);
}

TEST_CASE("rights: by limit, by capability, missing") {
  const std::string limits = "/proc/self/limits";
  const std::string status = "/proc/self/status";
  const std::string low =
      "Max locked memory         8388608              8388608              bytes\n"
      "Max realtime priority     0                    0\n";
  const MachineLine priority = lineWith("real-time priority", {{limits, low}});
  CHECK(priority.verdict == MachineVerdict::kPoor);
  CHECK(contains(priority.remedy, "ulimit -r"));
  const MachineLine memory = lineWith("locked memory", {{limits, low}});
  CHECK(memory.verdict == MachineVerdict::kPoor);
  CHECK(contains(memory.found, "8388608"));
  CHECK(contains(memory.remedy, "ulimit -l"));
  const std::string nice_only = "CapEff:\t0000000000800000\n";
  CHECK(lineWith("real-time priority", {{limits, low}, {status, nice_only}}).verdict ==
        MachineVerdict::kGood);
  CHECK(lineWith("locked memory", {{limits, low}, {status, nice_only}}).verdict == MachineVerdict::kPoor);
  const std::string lock_only = "CapEff:\t0000000000004000\n";
  CHECK(lineWith("real-time priority", {{limits, low}, {status, lock_only}}).verdict ==
        MachineVerdict::kPoor);
  CHECK(lineWith("locked memory", {{limits, low}, {status, lock_only}}).verdict == MachineVerdict::kGood);
  // A limit below what the threads want.
  const std::string some = "Max realtime priority     20                   20\n";
  CHECK(lineWith("real-time priority", {{limits, some}}).verdict == MachineVerdict::kPoor);
}

TEST_CASE("preemption, CPUs, governor and clock") {
  const std::string version = "/proc/sys/kernel/version";
  CHECK(lineWith("preemption", {{version, "#1 SMP PREEMPT_DYNAMIC Debian"}}).verdict ==
        MachineVerdict::kNote);
  const MachineLine full = lineWith(
      "preemption",
      {{version, "#1 SMP PREEMPT_DYNAMIC"}, {"/sys/kernel/debug/sched/preempt", "none voluntary (full)"}});
  CHECK(full.remedy.empty());
  CHECK(lineWith("preemption", {{version, "#1 SMP"}}).verdict == MachineVerdict::kPoor);
  CHECK(lineWith("preemption", {{version, "#1 SMP"}, {"/sys/kernel/realtime", "1"}}).verdict ==
        MachineVerdict::kGood);
  CHECK(lineWith("CPUs", {{"/sys/devices/system/cpu/online", "0"}}).verdict == MachineVerdict::kPoor);
  const MachineLine together = lineWith("CPUs", {{"/sys/devices/system/cpu/isolated", ""}});
  CHECK(together.verdict == MachineVerdict::kNote);
  CHECK(contains(together.found, "isolated: none"));
  CHECK(contains(lineWith("CPUs", {{"/sys/devices/system/cpu/online", "0-1,4,6-7"}}).found, "5 ("));
  const MachineLine mixed = lineWith("CPU governor", {{kGovernor1, "powersave"}});
  CHECK(mixed.verdict == MachineVerdict::kPoor);
  CHECK(mixed.found == "performance, powersave");
  CHECK(lineWith("clock", {{"/sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet"}})
            .verdict == MachineVerdict::kNote);
}

TEST_CASE("idle states that wake slowly and CPUs full of interrupts are named") {
  const Files deep = {{kIdle + "2/latency", "133\n"}, {kIdle + "2/name", "C6\n"}};
  CHECK(lineWith("idle states", deep).verdict == MachineVerdict::kPoor);
  CHECK(contains(lineWith("idle states", deep).found, "C6, wake-up takes 133 us"));
  Files off = deep;
  off[kIdle + "2/disable"] = "1\n";
  CHECK(lineWith("idle states", off).verdict == MachineVerdict::kGood);
  CHECK(contains(lineWith("interrupts", {}).found,
                 "CPU 0 handles 75 % of the devices', 40 a second since boot"));
  CHECK(lineWith("interrupts", {{"/proc/uptime", "0.1 0.1\n"}}).verdict == MachineVerdict::kNote);
  CHECK(lineWith("interrupts", {{"/proc/interrupts", "nothing\n"}}).verdict == MachineVerdict::kUnknown);
}

TEST_CASE("a CPU quota counts wherever it is set above the group") {
  const std::string group = "/proc/self/cgroup";
  CHECK(lineWith("CPU quota", {}).found == "none");
  const MachineLine above = lineWith("CPU quota", {{"/sys/fs/cgroup/user.slice/cpu.max", "150000 100000"}});
  CHECK(above.verdict == MachineVerdict::kPoor);
  CHECK(contains(above.found, "1.50"));
  const MachineLine both =
      lineWith("CPU quota", {{"/sys/fs/cgroup/user.slice/cpu.max", "150000 100000"},
                             {"/sys/fs/cgroup/user.slice/session/cpu.max", "50000 100000"}});
  CHECK(contains(both.found, "0.50"));
  // Version 1, with its real-time quota.
  const Files first = {{group, "1:cpu,cpuacct:/docker/x\n"},
                       {"/sys/fs/cgroup/cpu/docker/x/cpu.cfs_quota_us", "200000"},
                       {"/sys/fs/cgroup/cpu/docker/x/cpu.cfs_period_us", "100000"},
                       {"/sys/fs/cgroup/cpu/docker/x/cpu.rt_runtime_us", "0"}};
  CHECK(contains(lineWith("CPU quota", first).found, "2.00"));
  const MachineLine refused = lineWith("real-time quota", first);
  CHECK(refused.verdict == MachineVerdict::kPoor);
  CHECK(contains(refused.found, "SCHED_FIFO"));
  Files open = first;
  open["/sys/fs/cgroup/cpu/docker/x/cpu.cfs_quota_us"] = "-1";
  open["/sys/fs/cgroup/cpu/docker/x/cpu.rt_runtime_us"] = "950000";
  CHECK(lineWith("CPU quota", open).verdict == MachineVerdict::kGood);
  CHECK(lineWith("real-time quota", open).verdict == MachineVerdict::kGood);
}

TEST_CASE("this machine's own report has every line, as a table and as JSON") {
  const MachineReport report = inspectMachine();
  CHECK(report.lines.size() == 11);
  const std::string text = report.text();
  const auto json = report.json();
  REQUIRE(json.size() == 11);
  for (std::size_t i = 0; i < json.size(); ++i) {
    CHECK(contains(text, report.lines[i].what));
    CHECK(contains(text, report.lines[i].found));
    CHECK(json[i]["what"] == report.lines[i].what);
    CHECK(json[i]["verdict"] == verdictName(report.lines[i].verdict));
    CHECK(json[i]["found"] == report.lines[i].found);
  }
}

}  // namespace
}  // namespace swiftlet
