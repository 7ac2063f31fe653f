#include "firmware_host/realtime/flight_thread.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <utility>

namespace swiftlet {
namespace {

constexpr std::size_t kKernelNameLength = 15;
constexpr const char* kPriorityRemedy =
    "grant the permission: `setcap cap_sys_nice+ep` on the program, `LimitRTPRIO=99` in its systemd unit, or "
    "`ulimit -r 99` (rtprio in /etc/security/limits.conf); in a version 1 control group also "
    "cpu.rt_runtime_us above 0";

ThreadPolicy policyOf(int kernel_policy) {
  return kernel_policy == SCHED_FIFO ? ThreadPolicy::kFifo : ThreadPolicy::kOther;
}

/// The CPUs that the calling thread may run on.
std::vector<int> allowedCpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  std::vector<int> cpus;
  if (pthread_getaffinity_np(pthread_self(), sizeof set, &set) != 0) return cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set)) cpus.push_back(cpu);
  }
  return cpus;
}

std::string joined(const std::vector<int>& numbers) {
  return numbers.empty() ? std::string("unknown") : fmt::format("{}", fmt::join(numbers, ","));
}

std::string errorText(int error) { return std::generic_category().message(error); }

PageFaults ownFaults() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return {static_cast<std::uint64_t>(usage.ru_minflt), static_cast<std::uint64_t>(usage.ru_majflt)};
}

/// Page faults of another thread of this process; empty: no such thread.
std::optional<PageFaults> faultsOf(pid_t thread) {
  std::ifstream file(fmt::format("/proc/self/task/{}/stat", thread));
  std::string text;
  if (!std::getline(file, text)) return std::nullopt;
  // After the name in parentheses: state, 6 numbers, minor faults, those of children, major faults (proc(5)).
  std::istringstream fields(text.substr(text.rfind(')') + 1));
  constexpr int kBefore = 7;
  std::string skipped;
  for (int i = 0; i < kBefore; ++i) fields >> skipped;
  PageFaults faults;
  if (fields >> faults.minor >> skipped >> faults.major) return faults;
  return std::nullopt;
}

PageFaults operator-(const PageFaults& a, const PageFaults& b) {
  return {a.minor - b.minor, a.major - b.major};
}

std::atomic<void (*)(const char*, bool)> watch_of_all{nullptr};

}  // namespace

const char* policyName(ThreadPolicy policy) {
  return policy == ThreadPolicy::kFifo ? "SCHED_FIFO" : "SCHED_OTHER";
}

nlohmann::ordered_json toJson(const ThreadReport& report) {
  return {{"name", report.name},
          {"started", report.started},
          {"wanted_policy", policyName(report.wanted_policy)},
          {"policy", policyName(report.actual_policy)},
          {"wanted_priority", report.wanted_priority},
          {"priority", report.actual_priority},
          {"wanted_cpu",
           report.wanted_cpu < 0 ? nlohmann::ordered_json("any") : nlohmann::ordered_json(report.wanted_cpu)},
          {"cpus", report.actual_cpus},
          {"stack_bytes", report.stack_bytes},
          {"page_faults", {{"minor", report.faults.minor}, {"major", report.faults.major}}},
          {"message", report.message}};
}

std::string describe(const ThreadReport& report) {
  std::string line = report.started
                         ? fmt::format("{}: {} {} on CPU {}", report.name, policyName(report.actual_policy),
                                       report.actual_priority, joined(report.actual_cpus))
                         : fmt::format("{}: not started", report.name);
  if (!report.message.empty()) line += "; " + report.message;
  return line;
}

bool FlightThread::Stack::reserve(std::size_t bytes) {
  release();
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const std::size_t least = std::max(bytes, static_cast<std::size_t>(sysconf(_SC_THREAD_STACK_MIN)));
  bytes_ = (least + page - 1) / page * page;
  guard_ = page;
  void* mapping =
      mmap(nullptr, bytes_ + guard_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_STACK, -1, 0);
  if (mapping == MAP_FAILED) return false;
  mapping_ = mapping;
  low_ = static_cast<char*>(mapping) + guard_;
  if (mprotect(mapping_, guard_, PROT_NONE) != 0) return false;
  std::memset(low_, 0, bytes_);  // touches every page
  return true;
}

void FlightThread::Stack::release() {
  if (mapping_ != nullptr) munmap(mapping_, bytes_ + guard_);
  mapping_ = nullptr;
  low_ = nullptr;
}

FlightThread::~FlightThread() { join(); }

int FlightThread::create(const ThreadSettings& settings, bool fifo, bool pinned) {
  pthread_attr_t attributes;
  if (const int error = pthread_attr_init(&attributes); error != 0) return error;
  const sched_param priority{.sched_priority = fifo ? settings.priority : 0};
  int error = pthread_attr_setstack(&attributes, core_->stack.low(), core_->stack.bytes());
  // Explicit: a thread made by a real-time one would inherit its priority.
  if (error == 0) error = pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
  if (error == 0) error = pthread_attr_setschedpolicy(&attributes, fifo ? SCHED_FIFO : SCHED_OTHER);
  if (error == 0) error = pthread_attr_setschedparam(&attributes, &priority);
  if (error == 0 && pinned) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<std::size_t>(settings.cpu), &set);
    error = pthread_attr_setaffinity_np(&attributes, sizeof set, &set);
  }
  if (error == 0) error = pthread_create(&thread_, &attributes, &FlightThread::run, core_.get());
  pthread_attr_destroy(&attributes);
  return error;
}

ThreadReport FlightThread::start(const ThreadSettings& settings, std::function<void()> entry) {
  ThreadReport report;
  report.name = settings.name.substr(0, kKernelNameLength);
  bool fifo = settings.priority > 0;
  report.wanted_policy = fifo ? ThreadPolicy::kFifo : ThreadPolicy::kOther;
  report.wanted_priority = settings.priority;
  report.wanted_cpu = settings.cpu;
  const auto say = [&report](const std::string& sentence) {
    report.message += (report.message.empty() ? "" : "; ") + sentence;
  };
  if (joinable_) {
    say("this thread is already running: join it first");
    return report;
  }
  if (settings.priority < 0 || settings.priority > sched_get_priority_max(SCHED_FIFO)) {
    say(fmt::format("priority {} is invalid: 1 to {}, or 0 for SCHED_OTHER", settings.priority,
                    sched_get_priority_max(SCHED_FIFO)));
    return report;
  }
  bool pinned = settings.cpu >= 0 && settings.cpu < CPU_SETSIZE;
  if (settings.cpu >= CPU_SETSIZE)
    say(fmt::format("CPU {} does not exist: the thread may run on any", settings.cpu));
  core_ = std::make_unique<Core>();
  if (!core_->stack.reserve(settings.stack_bytes)) {
    say(fmt::format("no memory for a stack of {} bytes ({}): lower it or raise RLIMIT_MEMLOCK (`ulimit -l`)",
                    settings.stack_bytes, errorText(errno)));
    return report;
  }
  core_->entry = std::move(entry);
  core_->name = report.name;
  fault_.clear();

  int error = create(settings, fifo, pinned);
  // Requests that the kernel refuses are dropped one by one, in any order.
  while ((error == EINVAL && pinned) || (error == EPERM && fifo)) {
    if (error == EINVAL) {
      say(fmt::format("CPU {} does not exist or is not allowed for this process: the thread may run on any",
                      settings.cpu));
      pinned = false;
    } else {
      say(fmt::format("no permission for SCHED_FIFO {}, runs under SCHED_OTHER: {}", settings.priority,
                      kPriorityRemedy));
      fifo = false;
    }
    error = create(settings, fifo, pinned);
  }
  if (error != 0) {
    say(fmt::format("cannot create the thread ({})", errorText(error)));
    core_.reset();
    return report;
  }
  joinable_ = true;
  core_->begun.wait(false, std::memory_order_acquire);
  report.started = true;
  report.actual_policy = core_->seen.actual_policy;
  report.actual_priority = core_->seen.actual_priority;
  report.actual_cpus = core_->seen.actual_cpus;
  report.stack_bytes = core_->stack.bytes();
  return report;
}

void* FlightThread::run(void* core) {
  begin(*static_cast<Core*>(core));
  return nullptr;
}

void FlightThread::begin(Core& core) {
  pthread_setname_np(pthread_self(), core.name.c_str());
  constexpr unsigned long kExactSleeps = 1;  // ns
  prctl(PR_SET_TIMERSLACK, kExactSleeps, 0, 0, 0);
  int policy = 0;
  sched_param priority{};
  pthread_getschedparam(pthread_self(), &policy, &priority);
  core.seen.actual_policy = policyOf(policy);
  core.seen.actual_priority = priority.sched_priority;
  core.seen.actual_cpus = allowedCpus();
  core.kernel_id = gettid();
  const auto watch = watch_of_all.load(std::memory_order_relaxed);
  core.faults_before = ownFaults();
  core.begun.store(true, std::memory_order_release);
  core.begun.notify_one();
  if (watch != nullptr) watch(core.name.c_str(), true);
  try {
    core.entry();
  } catch (const std::exception& error) {
    core.fault = *error.what() == '\0' ? "exception without text" : error.what();
  } catch (...) {
    core.fault = "an object that is not a std::exception was thrown";
  }
  core.faults = ownFaults() - core.faults_before;
  if (watch != nullptr) watch(core.name.c_str(), false);
  core.over.store(true, std::memory_order_release);
  core.ended.ring();
}

PageFaults FlightThread::pageFaults() const {
  if (!core_) return faults_;
  if (core_->over.load(std::memory_order_acquire)) return core_->faults;
  if (!core_->begun.load(std::memory_order_acquire)) return {};
  const auto now = faultsOf(core_->kernel_id);
  return now ? *now - core_->faults_before : PageFaults{};
}

void FlightThread::watchAll(void (*watch)(const char* thread, bool begins)) {
  watch_of_all.store(watch, std::memory_order_relaxed);
}

bool FlightThread::joinWithin(Duration limit) {
  if (!joinable_) return true;
  if (!core_->ended.wait(0, limit)) return false;
  join();
  return true;
}

void FlightThread::join() {
  if (!joinable_) return;
  pthread_join(thread_, nullptr);
  joinable_ = false;
  fault_ = std::move(core_->fault);
  faults_ = core_->faults;
  core_.reset();
}

void FlightThread::abandon() {
  if (!joinable_) return;
  pthread_detach(thread_);
  joinable_ = false;
  // Kept until the program's end: the thread may continue at any time.
  static std::atomic<Core*> left{nullptr};
  Core* const core = core_.release();
  core->left_before = left.exchange(core);
}

}  // namespace swiftlet
