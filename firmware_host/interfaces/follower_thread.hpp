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
  /// Limits the end of a run to 2 s if all three followers are stuck.
  static constexpr Duration kLongestEnd = Duration::fromMilliseconds(600);

  FollowerThread() = default;
  ~FollowerThread() { static_cast<void>(end()); }
  FollowerThread(const FollowerThread&) = delete;
  FollowerThread& operator=(const FollowerThread&) = delete;

  /// Throws InputError with `file` and `field`, the setting that requested it, if the thread cannot be
  /// started.
  void start(const ThreadSettings& settings, const std::string& file, const std::string& field,
             std::function<void()> entry);
  /// Tells the entry to end and waits until it returns. False: it did not return within `limit` and is
  /// abandoned, now or by an earlier call.
  [[nodiscard]] bool end(Duration limit = kLongestEnd);
  /// Requests the end without waiting for it.
  void tellEnd() { ending_.store(true, std::memory_order_relaxed); }
  /// Called by the entry at each turn: beats. False: the entry must return.
  [[nodiscard]] bool turn();

  /// For the entry, which may note what it is doing, and for the supervisor.
  [[nodiscard]] Heartbeat& heart() { return heart_; }
  [[nodiscard]] const Heartbeat& heart() const { return heart_; }
  /// After end(): why it ended early or was abandoned; empty: it ended normally.
  [[nodiscard]] const std::string& fault() const { return fault_; }

  /// For the entry: calls `work(now)` every `period` seconds of the host's clock until the thread must end.
  /// Missed periods are skipped.
  void repeat(double period, const std::function<void(double now)>& work);

  /// For tests that throw or stall inside the thread: called on each follower's thread at each turn;
  /// returning false ends the thread early. Null: not called.
  static void watchTurns(bool (*watch)(const char* thread));

 private:
  std::atomic<bool> ending_{false};
  bool abandoned_ = false;
  bool returned_early_ = false;  ///< written by the thread, read after it has ended
  Heartbeat heart_;
  std::string name_;
  std::string fault_;
  FlightThread thread_;
};

/// A follower of a run, as the run sees it. Each kind of follower derives its own Work, whose constructor
/// starts the thread last.
class Follower {
 public:
  Follower(const Follower&) = delete;
  Follower& operator=(const Follower&) = delete;

  /// For the supervisor; valid as long as this object.
  [[nodiscard]] const Heartbeat& heart() const { return work_->thread_.heart(); }
  /// Requests the end without waiting, so that several followers can end at the same time.
  void tellEnd() { work_->thread_.tellEnd(); }
  /// Ends the thread and returns its counters for the summary; `fault`: why it ended early, or that it is
  /// stuck.
  nlohmann::ordered_json finish();

 protected:
  class Work {
   public:
    Work() = default;
    virtual ~Work() = default;
    Work(const Work&) = delete;
    Work& operator=(const Work&) = delete;

    /// False: the thread is stuck and is abandoned together with this object.
    [[nodiscard]] virtual bool end() { return thread_.end(); }
    /// Its counters, after it has ended.
    [[nodiscard]] virtual nlohmann::ordered_json json() const = 0;

   protected:
    FollowerThread thread_;
    friend Follower;
  };
  explicit Follower(std::unique_ptr<Work> work) : work_(std::move(work)) {}
  /// Ends the thread. A stuck thread is abandoned; its outlet must then stay alive.
  ~Follower();

  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
