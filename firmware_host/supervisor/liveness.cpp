#include "firmware_host/supervisor/liveness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace swiftlet {
namespace {

constexpr Duration milliseconds(std::int64_t ms) { return Duration::fromMilliseconds(ms); }

/// A flight thread looks at its arrows every 5 ms and works for 50 ms at most, 0.2 s if another program takes
/// the CPU; at 0.3 s the autopilot's own limits for a pose are used up. A stall of 3 s exceeds the longest
/// coast that the estimator calls degraded: a restart is better than waiting.
constexpr MemberRule kFlightRule = {MemberKind::kFlight, milliseconds(300), milliseconds(3000)};
/// Solving the pose graph or redrawing the map takes tenths of a second; 10 s is a hang.
constexpr MemberRule kSideRule = {MemberKind::kSide, milliseconds(1000), milliseconds(10'000)};
/// An fsync on an SD card occasionally takes up to a second.
constexpr MemberRule kFileRule = {MemberKind::kSide, milliseconds(1500), milliseconds(10'000)};
/// Sensor threads wait for their device for half a second at most; reopening one takes longer.
constexpr MemberRule kSensorRule = {MemberKind::kSensor, milliseconds(1000), milliseconds(10'000)};

struct NamedRule {
  std::string_view name;
  MemberRule rule;
};
constexpr NamedRule kRules[] = {
    // The IMU's thread is a flight thread: without samples there is no state, and only a restart brings a
    // dead thread back. Its limits are those of sensors, since reopening a port takes as long as a camera.
    {"imu", {MemberKind::kFlight, kSensorRule.late, kSensorRule.lost}},
    {"propagate", kFlightRule},
    {"track", kFlightRule},
    {"smooth", kFlightRule},
    {"log", kFileRule},
    {"record", kFileRule},
    {"camera0", kSensorRule},
    {"camera1", kSensorRule},
    {"trigger", kSensorRule},
};

/// Cameras are opened one after the other and may need seconds to their first image.
constexpr Duration kFirstMessage = milliseconds(10'000);
/// As in PX4: a working sensor never repeats all six values so often (its lowest bits flicker).
constexpr std::uint64_t kStuckReadings = 100;
/// As in PX4: what has failed four times will fail again.
constexpr int kTimesBad = 4;
/// The supervisor runs every 0.1 s. After a longer gap of its own (process stopped, machine overloaded), the
/// silence of others proves nothing and is counted from the end of the gap.
constexpr Duration kOwnBreak = milliseconds(300);

template <std::size_t kBytes, typename... Arguments>
void print(std::array<char, kBytes>& into, fmt::format_string<Arguments...> format,
           Arguments&&... arguments) {
  const auto result =
      fmt::format_to_n(into.data(), kBytes - 1, format, std::forward<Arguments>(arguments)...);
  *result.out = '\0';
}

}  // namespace

struct Liveness::DataRule {
  const char* what;  ///< "sample"
  Duration late;
  std::optional<Duration> lost;
  Health lost_effect;
  bool blocks_arming;  ///< set if ReadyToArm does not check this
};

struct Liveness::ProductRule {
  const char* product;
  const char* input;
  Duration late;
  Duration lost;
};

MemberRule memberRule(std::string_view name) {
  const auto* found = std::ranges::find(kRules, name, &NamedRule::name);
  return found != std::end(kRules) ? found->rule : kSideRule;
}

bool Liveness::add(std::string_view name) {
  Row row;
  print(row.name, "{}", name);
  row.rule = memberRule(name);
  return members_.tryPushBack(row);
}

double Liveness::silence(Stamp from, Stamp now) const { return (now - std::max(from, floor_)).seconds(); }

void Liveness::judge(std::span<const Beat> beats, const FlightFacts& facts, Stamp now) {
  if (!begun_) {
    begun_ = now;
    floor_ = now;
    print(other(kImuData).name, "imu");
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      print(others_[kCameraData + c].name, "camera{}", c);
    }
    print(other(kTriggerData).name, "trigger");
    print(other(kStates).name, "propagate");
    print(other(kFrames).name, "smooth");
    print(other(kImuValues).name, "imu");
    print(other(kFiles).name, "files");
  } else if (now - judged_ > kOwnBreak) {
    floor_ = now;
  }
  judged_ = now;

  for (std::size_t i = 0; i < std::min(beats.size(), members_.size()); ++i) {
    judgeThread(members_[i], beats[i], facts.ending, now);
  }
  if (!facts.ending) {
    // 0.1 s are three periods of a slow IMU; a gap of 1 s is longer than any that can be bridged.
    constexpr DataRule kImu = {"sample", milliseconds(100), milliseconds(1000), Health::kFailed, false};
    // A few lost images in a row are left to the estimator; after half a second the camera counts as late.
    // Slow cameras: late after two and a half periods, lost after twice as many.
    const double rate = ground_.camera_rate;
    const DataRule image_rule = {"image", imageLimit(milliseconds(500), rate),
                                 imageLimit(milliseconds(2000), rate / 2), Health::kDegraded, false};
    const DataRule edge_rule = {"edge", imageLimit(milliseconds(1000), rate), std::nullopt, Health::kDegraded,
                                true};
    judgeData(kImuData, kImu, facts.imu, now);
    for (std::size_t c = 0; c < std::min(static_cast<std::size_t>(ground_.cameras), kMaxCameras); ++c) {
      judgeData(static_cast<Other>(kCameraData + c), image_rule, facts.camera[c], now);
    }
    if (ground_.trigger) judgeData(kTriggerData, edge_rule, facts.trigger, now);
    // The same limits as for the threads that produce them: readers miss the product, not the turn.
    constexpr ProductRule kState = {"state", "samples", kFlightRule.late, kFlightRule.lost};
    constexpr ProductRule kFrame = {"frame", "images", milliseconds(1000), kFlightRule.lost};
    const EstimateNews& estimate = facts.estimate;
    judgeProduct(kStates, kState, states_, facts.imu.messages, estimate.states,
                 estimate.has_state && estimate.states > 0, now);
    std::uint64_t images = 0;
    for (const SensorNews& camera : facts.camera) images += camera.messages;
    judgeProduct(kFrames, kFrame, frames_, images, estimate.frames, true, now);
    judgeValues(facts, now);
  }
  judgeFiles(facts, now);

  troubles_.clear();
  const auto gather = [this](Row& row, std::size_t index) {
    row.trouble.row = static_cast<std::uint8_t>(index);
    row.trouble.member = row.name;
    if (row.trouble.condition != Condition::kOk) static_cast<void>(troubles_.tryPushBack(row.trouble));
  };
  for (std::size_t i = 0; i < members_.size(); ++i) gather(members_[i], i);
  for (std::size_t i = 0; i < kOthers; ++i) gather(others_[i], kMostMembers + i);
}

void Liveness::judgeThread(Row& row, const Beat& beat, bool ending, Stamp now) {
  const Cause before = row.trouble.cause;
  if (before == Cause::kThrew || before == Cause::kEndedEarly) return;
  const bool flight = row.rule.kind == MemberKind::kFlight;
  Trouble found;
  found.since = beat.life == Life::kNotBegun ? *begun_ : beat.last;
  const double silent = silence(found.since, now);
  const bool ends = beat.life == Life::kEnded;
  if (beat.life == Life::kFailed) {
    found.condition = Condition::kLost;
    found.cause = Cause::kThrew;
    print(found.text, "{}", beat.fault);
  } else if (ends && !ending) {
    found.condition = Condition::kLost;
    found.cause = Cause::kEndedEarly;
    print(found.text, kReturnedEarly);
  } else if (!ends && silent > row.rule.late.seconds()) {
    found.condition = silent > row.rule.lost.seconds() ? Condition::kLost : Condition::kLate;
    found.cause = Cause::kNoTurn;
    const bool told = *beat.doing != '\0';
    print(found.text, "{} for {:.1f} s{}{}", beat.turns > 0 ? "no progress" : "not started", silent,
          told ? ", last seen at: " : "", beat.doing);
  }
  const bool lost = found.condition == Condition::kLost;
  if (lost && flight) {
    found.effect = Health::kFailed;
    run_failed_ = true;
  }
  // A late side thread does not prevent arming; a lost one does, since something is wrong.
  found.blocks_arming = lost || row.rule.kind != MemberKind::kSide;
  settle(row, found);
}

void Liveness::judgeData(Other which, const DataRule& rule, const SensorNews& news, Stamp now) {
  Trouble found;
  found.since = news.messages > 0 ? news.arrival : *begun_;
  found.blocks_arming = rule.blocks_arming;
  const double silent = silence(found.since, now) * ground_.speed;
  found.cause = Cause::kNoData;
  if (news.messages == 0) {
    if (silent > kFirstMessage.seconds()) found.condition = Condition::kLate;
    print(found.text, "no {} since the start", rule.what);
  } else if (silent > rule.late.seconds()) {
    const bool lost = rule.lost && silent > rule.lost->seconds();
    found.condition = lost ? Condition::kLost : Condition::kLate;
    if (lost) found.effect = rule.lost_effect;
    print(found.text, "no {} for {:.1f} s", rule.what, silent);
  }
  settle(other(which), found);
}

void Liveness::judgeProduct(Other which, const ProductRule& rule, Progress& progress, std::uint64_t in,
                            std::uint64_t out, bool wanted, Stamp now) {
  const bool in_came = in != progress.in;
  if (in_came) progress.in_at = now;
  if (out != progress.out || !wanted || now - progress.in_at > rule.late) {
    progress.waiting_since.reset();
  } else if (in_came && !progress.waiting_since) {
    progress.waiting_since = now;
  }
  progress.in = in;
  progress.out = out;
  Trouble found;
  if (progress.waiting_since) {
    found.since = *progress.waiting_since;
    const double silent = silence(found.since, now) * ground_.speed;
    if (silent > rule.late.seconds()) {
      const bool lost = silent > rule.lost.seconds();
      found.condition = lost ? Condition::kLost : Condition::kLate;
      found.cause = Cause::kNoProduct;
      if (lost) found.effect = Health::kFailed;
      found.blocks_arming = true;
      print(found.text, "no {} for {:.1f} s while {} come", rule.product, silent, rule.input);
    }
  }
  settle(other(which), found);
}

void Liveness::judgeValues(const FlightFacts& facts, Stamp now) {
  Trouble found;
  if (facts.equal_samples >= kStuckReadings) {
    const Trouble& before = other(kImuValues).trouble;
    found.since = before.cause == Cause::kStuckValues ? before.since : now;
    found.condition = Condition::kLost;
    found.cause = Cause::kStuckValues;
    found.effect = Health::kFailed;
    found.blocks_arming = true;
    print(found.text, "{} identical samples in a row", facts.equal_samples);
  }
  settle(other(kImuValues), found);
}

void Liveness::judgeFiles(const FlightFacts& facts, Stamp now) {
  Trouble found;
  if (facts.file_problem[0] != '\0') {
    const Trouble& before = other(kFiles).trouble;
    found.since = before.cause == Cause::kFiles ? before.since : now;
    found.condition = Condition::kLost;
    found.cause = Cause::kFiles;
    print(found.text, "{}", facts.file_problem.data());
  }
  settle(other(kFiles), found);
}

void Liveness::settle(Row& row, const Trouble& found) {
  const bool was_well =
      row.trouble.condition == Condition::kOk || row.trouble.condition == Condition::kUnsteady;
  const Trouble before = row.trouble;
  row.trouble = found;
  if (found.condition != Condition::kOk) {
    if (was_well) ++row.times_bad;
    return;
  }
  row.trouble.cause = Cause::kNone;
  if (row.times_bad < kTimesBad) return;
  row.trouble.condition = Condition::kUnsteady;
  row.trouble.cause = Cause::kFlapping;
  row.trouble.since = before.since;
  row.trouble.blocks_arming = true;
  print(row.trouble.text, "failed {} times in this run", row.times_bad);
}

}  // namespace swiftlet
