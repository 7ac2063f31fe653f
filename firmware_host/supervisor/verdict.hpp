#pragma once
// The supervisor's findings at one moment, and the only answer to "is everything alive, and may it fly?".
// Read by arming, MAVLink, ROS diagnostics, the live view, the log, systemd and the exit code.
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

/// An older verdict is invalid: the supervisor itself has missed five of its periods.
inline constexpr Duration kOldestVerdict = Duration::fromMilliseconds(500);

enum class Condition : std::uint8_t {
  kOk,
  kLate,      ///< silent for too long, or faulty without being gone
  kLost,      ///< threw, ended, or was silent for longer than its limit
  kUnsteady,  ///< works, but has failed four times in this run
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
  kFlapping,     ///< failed too often
};

/// A member of the flight, or the data of a sensor, that is not well.
struct Trouble {
  static constexpr std::size_t kNameBytes = 16;
  static constexpr std::size_t kTextBytes = 160;

  std::array<char, kNameBytes> member{};  ///< zero-terminated
  std::uint8_t row = 0;                   ///< in the supervisor's table; at most one trouble per row
  Condition condition = Condition::kOk;
  Cause cause = Cause::kNone;
  Health effect = Health::kDegraded;    ///< upper limit of the health
  bool blocks_arming = false;           ///< by the arming condition `members`
  Stamp since;                          ///< CLOCK_MONOTONIC, the last sign of life or the end
  std::array<char, kTextBytes> text{};  ///< "no progress for 0.4 s"; zero-terminated

  [[nodiscard]] const char* name() const { return member.data(); }
  /// Whether the troubles are the same apart from the numbers in their texts, which are not news.
  [[nodiscard]] bool sameAs(const Trouble& other) const;
};

struct Verdict {
  /// 16 threads, four sensors' data, two products, the IMU's values and the files.
  static constexpr std::size_t kMostTroubles = 24;

  Stamp evaluated;  ///< CLOCK_MONOTONIC
  Health health = Health::kInitializing;
  bool run_failed = false;  ///< the run must end with exit code 1; never becomes false again
  bool ending = false;      ///< the run ends in order
  ArmingVerdict arming;
  FixedVector<Trouble, kMostTroubles> troubles;
  // Incremented with each change, so that a reader can tell news from numbers that merely advance.
  std::uint32_t arming_changes = 0;
  std::uint32_t trouble_changes = 0;

  [[nodiscard]] bool stale(Stamp now) const { return now - evaluated > kOldestVerdict; }
  /// The worst trouble, the first of equal ones; null: none.
  [[nodiscard]] const Trouble* worst() const;
};

/// {"run_failed", "arming", "troubles": [{"member", "condition", "since_ns", "text"}]}
nlohmann::ordered_json toJson(const Verdict& verdict);

/// The worse of two. Initializing is worse than good: a missing pose cannot be flown.
Health worse(Health a, Health b);

}  // namespace swiftlet
