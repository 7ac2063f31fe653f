#pragma once
// A thread that follows a run at its own pace by reading a LiveOutlet. It beats at each turn.
//
// Declare it after everything that its entry uses. The owner calls end(). If end() abandons the thread,
// everything that the entry uses must stay alive, this object included: the owner leaks it on purpose.

#include <atomic>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "estimator/core/stamp.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"

namespace swiftlet {

class FollowerThread {
 public:
  /// A run's end takes 2 s at most, should all three followers be stuck.
  static constexpr Duration kLongestEnd = Duration::fromMilliseconds(600);

  FollowerThread() = default;
  ~FollowerThread() { static_cast<void>(end()); }
  FollowerThread(const FollowerThread&) = delete;
  FollowerThread& operator=(const FollowerThread&) = delete;

  /// Throws InputError with `file` and `field`, the setting that requested it, if the thread cannot be
  /// started.
  void start(const ThreadSettings& settings, const std::string& file, const std::string& field,
             std::function<void()> entry);
  /// Waits for the entry to return, which looks at ending(). False: it did not within `limit` and is given
  /// up, now or by an earlier call.
  [[nodiscard]] bool end(Duration limit = kLongestEnd);
  /// Waits for nothing.
  void tellEnd() { ending_.store(true, std::memory_order_relaxed); }
  /// Of the entry, at each turn: beats. False: it is to return.
  [[nodiscard]] bool turn();

  /// Of the entry, which may say what it does; of the supervisor.
  [[nodiscard]] Heartbeat& heart() { return heart_; }
  [[nodiscard]] const Heartbeat& heart() const { return heart_; }
  /// After end(): why it ended early or was abandoned; empty: it ended normally.
  [[nodiscard]] const std::string& fault() const { return fault_; }

  /// For the entry: `work(now)` every `period` seconds of the host's clock, until it is to end. A thread that
  /// came late does not hurry after.
  void repeat(double period, const std::function<void(double now)>& work);

  /// For tests that throw or stall inside the thread: called on each follower's thread at each turn;
  /// returning false ends the thread early. Null: not called.
  static void watchTurns(bool (*watch)(const char* thread));

 private:
  std::atomic<bool> ending_{false};
  bool abandoned_ = false;
  bool returned_early_ = false;  ///< of the thread; read after its end
  Heartbeat heart_;
  std::string name_;
  std::string fault_;
  FlightThread thread_;
};

/// A follower of a run, as the run sees it. Each kind of follower derives its own Work, which starts the
/// thread as the last step of its construction.
class Follower {
 public:
  Follower(const Follower&) = delete;
  Follower& operator=(const Follower&) = delete;

  /// For the supervisor; as long as this object.
  [[nodiscard]] const Heartbeat& heart() const { return work_->thread_.heart(); }
  /// Tells it to end, and waits for nothing: so that several end at the same time.
  void tellEnd() { work_->thread_.tellEnd(); }
  /// Ends it and returns its counters for the summary; `fault`: why it ended early, or that it is stuck.
  nlohmann::ordered_json finish();

 protected:
  class Work {
   public:
    Work() = default;
    virtual ~Work() = default;
    Work(const Work&) = delete;
    Work& operator=(const Work&) = delete;

    /// False: the thread is stuck and was left behind, with all of this.
    [[nodiscard]] virtual bool end() { return thread_.end(); }
    /// Its counters, after it has ended.
    [[nodiscard]] virtual nlohmann::ordered_json json() const = 0;

   protected:
    FollowerThread thread_;
    friend Follower;
  };
  explicit Follower(std::unique_ptr<Work> work) : work_(std::move(work)) {}
  /// Ends it; a thread that is stuck is left behind: its outlet has to stay then.
  ~Follower();

  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
