#pragma once
// A thread for the flight path: name, real-time priority, CPU, and a fixed stack that is touched in advance.
// The result is reported as a value; a missing permission is not an error.
//
// Without permission for SCHED_FIFO the thread runs under SCHED_OTHER; if the CPU does not exist or is not
// allowed it runs on any CPU. The report says what is missing and how to get it. ready_to_arm.hpp decides
// whether that is good enough.
//
// - Memory: the stack is a separate mapping with a guard page below it. It is written before the thread
//   starts, so every page is resident.
// - Exceptions: an exception that escapes `entry` ends the thread and is kept as text (fault()); it does not
//   reach the caller.
// - Sleeps are exact: the thread's timer slack is 1 ns (50 us by default under SCHED_OTHER).
// - Stuck threads: joinWithin() waits for a bounded time, abandon() gives the thread up. Its stack and entry
//   then stay allocated. The owner must keep everything that the entry uses.

#include <pthread.h>
#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "firmware_host/realtime/doorbell.hpp"

namespace swiftlet {

/// Stack of a flight thread: a whole replay of a recorded log on one thread uses 0.25 MiB at its deepest.
/// The rest is room for other logs, other compilers and the sanitizers' own 0.8 MiB.
inline constexpr std::size_t kFlightStackBytes = std::size_t{2} * 1024 * 1024;

enum class ThreadPolicy {
  kOther,  ///< SCHED_OTHER: shares time with everything else
  kFifo,   ///< SCHED_FIFO: runs until it sleeps or a higher priority needs the CPU
};

/// "SCHED_OTHER", "SCHED_FIFO".
const char* policyName(ThreadPolicy policy);

struct ThreadSettings {
  std::string name;  ///< as `top -H` and `perf` show it; the kernel keeps 15 characters
  int priority = 0;  ///< 1 to 99: SCHED_FIFO with this priority; 0: SCHED_OTHER
  int cpu = -1;      ///< the one CPU to run on; -1: any
  std::size_t stack_bytes = kFlightStackBytes;
};

/// Accesses to memory that was not there. Minor: a page was mapped or copied; major: read from a disk.
struct PageFaults {
  std::uint64_t minor = 0;
  std::uint64_t major = 0;
};

/// What was wanted and what the kernel gave.
struct ThreadReport {
  std::string name;
  ThreadPolicy wanted_policy = ThreadPolicy::kOther;
  ThreadPolicy actual_policy = ThreadPolicy::kOther;
  int wanted_priority = 0;
  int actual_priority = 0;
  int wanted_cpu = -1;
  std::vector<int> actual_cpus;  ///< that the thread may run on
  std::size_t stack_bytes = 0;
  bool started = false;
  std::string message;  ///< what is missing and the remedy, one sentence each; empty: all as wanted
  PageFaults faults;    ///< of its entry; filled in when the thread is ended

  /// It runs, with the policy and priority that it was to have.
  [[nodiscard]] bool hasPriority() const {
    return started && actual_policy == wanted_policy && actual_priority == wanted_priority;
  }
};

nlohmann::ordered_json toJson(const ThreadReport& report);
/// One line: name, policy, priority, CPUs, and what is missing.
std::string describe(const ThreadReport& report);

class FlightThread {
 public:
  FlightThread() = default;
  /// Joins unless the thread was abandoned. The owner must have asked it to end before.
  ~FlightThread();
  FlightThread(const FlightThread&) = delete;
  FlightThread& operator=(const FlightThread&) = delete;

  /// Starts `entry` on the thread; not while one is running. Returns when the thread has begun, or with
  /// `started` false and the reason when there is no thread.
  ThreadReport start(const ThreadSettings& settings, std::function<void()> entry);
  /// Waits for the end; nothing when there is no thread.
  void join();
  /// Waits for the end, at most `limit`; false: it still runs. True when there is no thread.
  [[nodiscard]] bool joinWithin(Duration limit);
  /// Gives a thread up that does not end; nothing when there is none.
  void abandon();

  [[nodiscard]] bool joinable() const { return joinable_; }
  /// After join: what() of the exception that ended the thread; empty: it returned.
  [[nodiscard]] const std::string& fault() const { return fault_; }
  /// Since `entry` began: of a thread that runs, or hangs, as the kernel counts them; of one that has ended,
  /// all. Opens a file: not for the flight path.
  [[nodiscard]] PageFaults pageFaults() const;

  /// For tests that arm allocation traps: called on each thread of the program when its entry begins and
  /// ends. Null: not called.
  static void watchAll(void (*watch)(const char* thread, bool begins));

 private:
  /// A mapping with a guard page at its low end.
  class Stack {
   public:
    ~Stack() { release(); }
    [[nodiscard]] bool reserve(std::size_t bytes);
    void release();
    [[nodiscard]] void* low() const { return low_; }
    [[nodiscard]] std::size_t bytes() const { return bytes_; }

   private:
    void* mapping_ = nullptr;
    void* low_ = nullptr;  ///< above the guard page
    std::size_t bytes_ = 0;
    std::size_t guard_ = 0;
  };

  /// What the thread itself uses: it outlives this object where the thread is abandoned.
  struct Core {
    Stack stack;
    std::function<void()> entry;
    std::string fault;
    std::string name;
    ThreadReport seen;  ///< what the thread found of itself as it began
    pid_t kernel_id = 0;
    PageFaults faults_before;  ///< of making the thread
    PageFaults faults;         ///< of an entry that has ended
    std::atomic<bool> begun{false};
    std::atomic<bool> over{false};
    Doorbell ended;  ///< rung by the thread's last step
    Core* left_before = nullptr;
  };

  static void* run(void* core);
  static void begin(Core& core);
  int create(const ThreadSettings& settings, bool fifo, bool pinned);

  std::unique_ptr<Core> core_;
  pthread_t thread_{};
  bool joinable_ = false;
  std::string fault_;
  PageFaults faults_;  ///< of a thread that was joined
};

}  // namespace swiftlet
