#pragma once
// Decides whether everything is alive: checks every member's heartbeat and the data of sensors and estimate
// ten times a second, and publishes one verdict (verdict.hpp) to all readers.
//
// Use: add every member, begin(), start(); or, without a thread, call step() at chosen times. Threads: its
// own thread (ThreadSettings: below `track`, above `mesh`, so that low-priority work cannot silence it) calls
// `facts` and the sinks; verdict() and expectEnd() from any thread; drainEvents from one thread; step() only
// without its own thread. Errors: none in flight; start() reports a thread that cannot be started. Memory:
// 130 kB, fixed; no allocation or lock after begin(). Cost: 10 us per step.

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/newest_shared.hpp"
#include "estimator/core/spsc_ring.hpp"
#include "firmware_host/realtime/doorbell.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/supervisor/arming_watch.hpp"
#include "firmware_host/supervisor/flight_facts.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"
#include "firmware_host/supervisor/liveness.hpp"
#include "firmware_host/supervisor/systemd_notify.hpp"
#include "firmware_host/supervisor/verdict.hpp"

namespace swiftlet {

class Supervisor {
 public:
  static constexpr Duration kPeriod = Duration::fromMilliseconds(100);
  static constexpr std::size_t kMostSinks = 8;
  /// Time from the failure of a run until systemd's watchdog kills the program if it has not ended: 4 s to
  /// abandon stuck threads and followers, the rest to write files to a slow disk.
  static constexpr Duration kLongestFailedEnd = Duration::fromMilliseconds(30'000);

  using Facts = std::function<void(FlightFacts&)>;
  using Sink = std::function<void(const Verdict&)>;

  Supervisor() = default;
  ~Supervisor() { stop(); }
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Call before begin(). `heart` outlives the supervisor. False: the table is full.
  [[nodiscard]] bool add(std::string_view name, const Heartbeat& heart);
  [[nodiscard]] bool addSink(Sink sink) { return sinks_.tryPushBack(std::move(sink)); }
  /// `facts` fills in the current facts. `facts` and `systemd` (may be null) outlive the supervisor.
  void begin(const FlightGround& ground, Facts facts, SystemdNotify* systemd = nullptr);

  ThreadReport start(const ThreadSettings& settings);
  /// Waits for the thread, at most one turn. Tells systemd that the run ends, unless a turn already did.
  void stop();
  /// Announces that the run ends in order. Call before the first thread returns for this reason.
  void expectEnd() { ending_.store(true, std::memory_order_release); }

  /// One turn; `now`: CLOCK_MONOTONIC.
  void step(Stamp now);

  /// The newest verdict; its `evaluated` is 0 before the first turn.
  [[nodiscard]] Verdict verdict() const;
  /// A flight thread was lost: the run must end with exit code 1.
  [[nodiscard]] bool runFailed() const { return run_failed_.load(std::memory_order_acquire); }
  /// Passes the changes since the last call as text, with stamps of the run's clock.
  bool drainEvents(const std::function<void(Stamp, const std::string&)>& take);
  /// For the summary, after stop(): the last verdict, first readiness, each member's turns.
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  struct Event {
    /// Fits a verdict in which every condition is missing.
    static constexpr std::size_t kTextBytes = 2560;
    Stamp stamp;
    std::array<char, kTextBytes> text{};
    std::size_t size = 0;
  };
  struct Member {
    std::array<char, Trouble::kNameBytes> name{};
    const Heartbeat* heart = nullptr;
  };

  void run();
  [[nodiscard]] bool findRunClock(const FlightFacts& facts, Stamp now);
  void tellTroubles(Stamp now);
  void tellArming();
  void tellSystemd(Stamp now);
  void tellEnd();
  template <typename Write>
  void event(Write&& write);

  FlightGround ground_;
  Facts facts_;
  FixedVector<Sink, kMostSinks> sinks_;
  SystemdNotify* systemd_ = nullptr;
  FixedVector<Member, Liveness::kMostMembers> members_;
  Liveness liveness_;
  ArmingWatch arming_;

  Verdict verdict_;
  Liveness::Troubles told_;  ///< troubles already reported in events
  bool arming_told_ = false;
  std::optional<ArmingVerdict> last_arming_;
  std::optional<Stamp> run_clock_;  ///< current time on the run's clock
  std::optional<Stamp> first_ready_;
  bool ready_sent_ = false, end_told_ = false;

  SpscRing<Event, 32> events_;
  NewestShared<Verdict> newest_;
  std::atomic<bool> ending_{false}, stopping_{false}, run_failed_{false};
  Doorbell bell_;
  FlightThread thread_;
};

}  // namespace swiftlet
