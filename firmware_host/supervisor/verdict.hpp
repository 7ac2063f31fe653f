#pragma once
// What the supervisor found at one moment: the only answer to "is everything alive, and may it fly?". Arming,
// MAVLink, ROS diagnostics, the live view, the log, systemd and the exit code read it.
//
// Trivially copyable: some 7 kB.

#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/nav_state.hpp"
#include "firmware_host/realtime/ready_to_arm.hpp"

namespace swiftlet {

/// An older verdict is none: the supervisor itself has stopped, five of its periods ago.
inline constexpr Duration kOldestVerdict = Duration::fromMilliseconds(500);

enum class Condition : std::uint8_t {
  kOk,
  kLate,      ///< silent for longer than its longest silence, or at fault without being gone
  kLost,      ///< gone: it threw, ended, or was silent for longer than its limit
  kUnsteady,  ///< works, but went bad four times in this run
};
/// "ok", "late", "lost", "unsteady".
const char* conditionName(Condition condition);

enum class Cause : std::uint8_t {
  kNone,
  kNoTurn,       ///< the thread's loop makes no progress
  kThrew,        ///< an exception ended the thread
  kEndedEarly,   ///< the thread returned although the run continues
  kNoData,       ///< the sensor delivers nothing
  kStuckValues,  ///< the IMU repeats one reading
  kNoProduct,    ///< the stage runs and receives input but produces no output
  kFiles,        ///< files are not written
  kFlapping,     ///< went bad too often
};

/// One member of the flight, or one of its sensors' data, that is not well.
struct Trouble {
  static constexpr std::size_t kNameBytes = 16;
  static constexpr std::size_t kTextBytes = 160;

  std::array<char, kNameBytes> member{};  ///< ends with a zero
  std::uint8_t row = 0;                   ///< of the supervisor's table: one trouble a row at a time
  Condition condition = Condition::kOk;
  Cause cause = Cause::kNone;
  Health effect = Health::kDegraded;    ///< the health is at best this
  bool blocks_arming = false;           ///< as condition `members`
  Stamp since;                          ///< CLOCK_MONOTONIC: the last sign of life, or the end
  std::array<char, kTextBytes> text{};  ///< "no progress for 0.4 s"; ends with a zero

  [[nodiscard]] const char* name() const { return member.data(); }
  /// The same trouble regardless of the numbers in its text: a changed number alone is not news.
  [[nodiscard]] bool sameAs(const Trouble& other) const;
};

struct Verdict {
  /// 16 threads, four sensors' data, two products, the IMU's values and the files.
  static constexpr std::size_t kMostTroubles = 24;

  Stamp evaluated;  ///< CLOCK_MONOTONIC
  Health health = Health::kInitializing;
  bool run_failed = false;  ///< the run must end with exit code 1; never becomes false again
  bool ending = false;      ///< the run is ending in order
  ArmingVerdict arming;
  FixedVector<Trouble, kMostTroubles> troubles;
  // Counted up with each change, so that a reader knows news from figures that run on.
  std::uint32_t arming_changes = 0;
  std::uint32_t trouble_changes = 0;

  [[nodiscard]] bool stale(Stamp now) const { return now - evaluated > kOldestVerdict; }
  /// The worst trouble, the first of them; null: none.
  [[nodiscard]] const Trouble* worst() const;
};

/// {"run_failed", "arming", "troubles": [{"member", "condition", "since_ns", "text"}]}
nlohmann::ordered_json toJson(const Verdict& verdict);

/// The worse of two: initializing before good, since a pose that is not there yet is not to be flown by.
Health worse(Health a, Health b);

}  // namespace swiftlet
