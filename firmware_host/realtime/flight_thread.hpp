#pragma once
// A thread for the flight path: name, real-time priority, CPU, and a fixed stack that is touched in advance.
// What the thread was granted is a value; a missing permission is not an error.
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

/// Stack of a flight thread: a whole replay of a recorded log on one thread uses at most 0.25 MiB. The rest
/// is room for other logs, other compilers and the sanitizers' own 0.8 MiB.
inline constexpr std::size_t kFlightStackBytes = std::size_t{2} * 1024 * 1024;

enum class ThreadPolicy {
  kOther,  ///< SCHED_OTHER: shares time with everything else
  kFifo,   ///< SCHED_FIFO: runs until it sleeps or a higher priority needs the CPU
};

/// "SCHED_OTHER", "SCHED_FIFO".
const char* policyName(ThreadPolicy policy);

struct ThreadSettings {
  std::string name;  ///< as shown by `top -H` and `perf`; the kernel keeps 15 characters
  int priority = 0;  ///< 1 to 99: SCHED_FIFO with this priority; 0: SCHED_OTHER
  int cpu = -1;      ///< the one CPU to run on; -1: any
  std::size_t stack_bytes = kFlightStackBytes;
};

/// Page faults. Minor: a page was mapped or copied; major: read from a disk.
struct PageFaults {
  std::uint64_t minor = 0;
  std::uint64_t major = 0;
};

/// What was requested and what the kernel granted.
struct ThreadReport {
  std::string name;
  ThreadPolicy wanted_policy = ThreadPolicy::kOther;
  ThreadPolicy actual_policy = ThreadPolicy::kOther;
  int wanted_priority = 0;
  int actual_priority = 0;
  int wanted_cpu = -1;
  std::vector<int> actual_cpus;  ///< CPUs that the thread may run on
  std::size_t stack_bytes = 0;
  bool started = false;
  std::string message;  ///< what is missing and the remedy, one sentence each; empty: all granted
  PageFaults faults;    ///< of the entry; set when the thread has ended

  /// Whether it runs with the requested policy and priority.
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
  /// Joins unless the thread was abandoned. The owner must have requested its end before.
  ~FlightThread();
  FlightThread(const FlightThread&) = delete;
  FlightThread& operator=(const FlightThread&) = delete;

  /// Starts `entry` on the thread; not while one is running. Returns when the thread has begun, or with
  /// `started` false and the reason if it could not be created.
  ThreadReport start(const ThreadSettings& settings, std::function<void()> entry);
  /// Waits for the end; returns at once if there is no thread.
  void join();
  /// Waits for the end, at most `limit`. False: it still runs. True also if there is no thread.
  [[nodiscard]] bool joinWithin(Duration limit);
  /// Abandons a thread that does not end; does nothing if there is none.
  void abandon();

  [[nodiscard]] bool joinable() const { return joinable_; }
  /// After join: what() of the exception that ended the thread; empty: it returned.
  [[nodiscard]] const std::string& fault() const { return fault_; }
  /// Page faults since `entry` began: up to now for a running or stuck thread, all for one that has ended.
  /// Opens a file: not for the flight path.
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

  /// State used by the thread itself; it outlives this object if the thread is abandoned.
  struct Core {
    Stack stack;
    std::function<void()> entry;
    std::string fault;
    std::string name;
    ThreadReport seen;  ///< what the thread found out about itself when it began
    pid_t kernel_id = 0;
    PageFaults faults_before;  ///< from creating the thread
    PageFaults faults;         ///< of an entry that has ended
    std::atomic<bool> begun{false};
    std::atomic<bool> over{false};
    Doorbell ended;  ///< rung in the thread's last step
    Core* left_before = nullptr;
  };

  static void* run(void* core);
  static void begin(Core& core);
  int create(const ThreadSettings& settings, bool fifo, bool pinned);

  std::unique_ptr<Core> core_;
  pthread_t thread_{};
  bool joinable_ = false;
  std::string fault_;
  PageFaults faults_;  ///< of a joined thread
};

}  // namespace swiftlet
