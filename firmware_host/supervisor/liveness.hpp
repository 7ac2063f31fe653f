#pragma once
// Judges which threads and sensors are late or lost, and what that means for the flight. Pure: facts and the
// time in, troubles out; no clock, no heap, no thread. Cost: some microseconds.
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
// Limits for images and edges are at least two and a half periods of a slow camera, five for a lost one.
// liveness.cpp gives the reasons. A trouble that is over is forgotten, with these exceptions: what has failed
// four times stays degraded, a lost flight thread ends the run, and exceptions and early ends stay.

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
  kFlight,  ///< needed for the estimate: the IMU's thread, propagate, track, smooth
  kSide,    ///< mesh, loop, map, log, record, and the followers
  kSensor,  ///< threads of cameras and the trigger
};

struct MemberRule {
  MemberKind kind = MemberKind::kSide;
  Duration late;  ///< longest time without a turn of its loop
  Duration lost;
};

/// Rule by the thread's name; an unknown thread is a side thread.
MemberRule memberRule(std::string_view name);

class Liveness {
 public:
  static constexpr std::size_t kMostMembers = 16;

  using Troubles = FixedVector<Trouble, Verdict::kMostTroubles>;

  /// Call before the first judge(), which takes beats in the same order. False: the table is full.
  [[nodiscard]] bool add(std::string_view name);
  void begin(const FlightGround& ground) { ground_ = ground; }

  /// Read `facts.ending` after the beats.
  void judge(std::span<const Beat> beats, const FlightFacts& facts, Stamp now);

  /// In the order of the rows.
  [[nodiscard]] const Troubles& troubles() const { return troubles_; }
  /// Whether a flight thread was lost.
  [[nodiscard]] bool runFailed() const { return run_failed_; }

 private:
  /// Rows after the threads': data of sensors, products, the IMU's values, files.
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
    Trouble trouble;  ///< of the last judge()
    int times_bad = 0;
  };
  /// Whether output is produced while input arrives.
  struct Progress {
    std::uint64_t in = 0, out = 0;
    Stamp in_at;                         ///< time of the newest input
    std::optional<Stamp> waiting_since;  ///< time of the first input after the newest product
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
  /// Seconds of the host's clock since `from`, not counting gaps of the supervisor itself.
  [[nodiscard]] double silence(Stamp from, Stamp now) const;

  FlightGround ground_;
  FixedVector<Row, kMostMembers> members_;
  std::array<Row, kOthers> others_{};
  Progress states_, frames_;
  Troubles troubles_;
  std::optional<Stamp> begun_;  ///< time of the first judge()
  Stamp judged_;                ///< time of the last judge()
  Stamp floor_;                 ///< silence is counted from this time at the earliest
  bool run_failed_ = false;
};

}  // namespace swiftlet
