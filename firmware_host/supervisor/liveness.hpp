#pragma once
// Who is late, who is lost, and what it means for the flight. Pure: facts and the time in, troubles out; no
// clock, no heap, no thread. Cost: some microseconds.
//
// | row                     | late after      | lost after               | lost means
// | flight thread           | 0.3 s           | 3 s, or threw, or ended  | health failed, the run ends
// | side thread             | 1 s (log, record 1.5 s) | 10 s, or threw, or ended | degraded
// | thread of a camera, the trigger | 1 s     | 10 s, or threw, or ended | degraded
// | IMU's data              | 0.1 s           | 1 s                      | health failed until it is back
// | a camera's data         | 0.5 s           | 2 s                      | degraded; the estimator coasts
// | trigger's data          | 1 s             |                          | degraded
// | states while samples come | 0.3 s         | 3 s                      | health failed until they are back
// | frames while images come  | 1 s           | 3 s                      | health failed until they are back
// | equal IMU readings      |                 | 100 in a row             | health failed until they differ
// | files                   |                 | at once                  | degraded
// Limits of images and edges are at least two and a half periods of a slow camera, five for a lost one.
// liveness.cpp has the reasons. A stall that is over is forgotten, but for two things: what went bad four
// times stays degraded, and a flight thread that was lost ends the run. A throw and an early end stay.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "estimator/core/fixed_vector.hpp"
#include "firmware_host/supervisor/flight_facts.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"
#include "firmware_host/supervisor/verdict.hpp"

namespace swiftlet {

enum class MemberKind : std::uint8_t {
  kFlight,  ///< without it there is no estimate: the IMU's thread, propagate, track, smooth
  kSide,    ///< mesh, loop, map, log, record, and the followers
  kSensor,  ///< threads of cameras and the trigger
};

struct MemberRule {
  MemberKind kind = MemberKind::kSide;
  Duration late;  ///< without a turn of its loop
  Duration lost;
};

/// By the thread's name; an unknown one is a side thread.
MemberRule memberRule(std::string_view name);

class Liveness {
 public:
  static constexpr std::size_t kMostMembers = 16;

  using Troubles = FixedVector<Trouble, Verdict::kMostTroubles>;

  /// Call before the first judge(); beats are in the order of adding. False: the table is full.
  [[nodiscard]] bool add(std::string_view name);
  void begin(const FlightGround& ground) { ground_ = ground; }

  /// `facts.ending` is to be read after the beats.
  void judge(std::span<const Beat> beats, const FlightFacts& facts, Stamp now);

  /// In the order of the rows.
  [[nodiscard]] const Troubles& troubles() const { return troubles_; }
  /// A flight thread was lost.
  [[nodiscard]] bool runFailed() const { return run_failed_; }

 private:
  /// Rows after the members': sensors' data, products, the IMU's values, the files.
  enum Other : std::size_t {
    kImuData,
    kCameraData,
    kTriggerData = kCameraData + kMaxCameras,
    kStates,
    kFrames,
    kImuValues,
    kFiles,
    kOthers
  };
  struct Row {
    std::array<char, Trouble::kNameBytes> name{};
    MemberRule rule;
    Trouble trouble;  ///< of the last judgement
    int times_bad = 0;
  };
  /// Whether output is produced while input arrives.
  struct Progress {
    std::uint64_t in = 0, out = 0;
    Stamp in_at;                         ///< of the newest input
    std::optional<Stamp> waiting_since;  ///< the first input after the newest product
  };
  struct DataRule;
  struct ProductRule;

  void judgeThread(Row& row, const Beat& beat, bool ending, Stamp now);
  void judgeData(Other other, const DataRule& rule, const SensorNews& news, Stamp now);
  void judgeProduct(Other other, const ProductRule& rule, Progress& progress, std::uint64_t in,
                    std::uint64_t out, bool wanted, Stamp now);
  void judgeValues(const FlightFacts& facts, Stamp now);
  void judgeFiles(const FlightFacts& facts, Stamp now);
  void settle(Row& row, const Trouble& found);
  [[nodiscard]] Row& other(Other which) { return others_[which]; }
  /// Seconds of the host since `from`, without the time in which the supervisor itself stood still.
  [[nodiscard]] double silence(Stamp from, Stamp now) const;

  FlightGround ground_;
  FixedVector<Row, kMostMembers> members_;
  std::array<Row, kOthers> others_{};
  Progress states_, frames_;
  Troubles troubles_;
  std::optional<Stamp> begun_;  ///< the first judge()
  Stamp judged_;                ///< the last
  Stamp floor_;                 ///< silence counts from here at the earliest
  bool run_failed_ = false;
};

}  // namespace swiftlet
