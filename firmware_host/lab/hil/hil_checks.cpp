#include "firmware_host/lab/hil/hil_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <string_view>

#include "estimator/messages/names.hpp"
#include "firmware_host/lab/budget/xml_text.hpp"
#include "firmware_host/lab/evaluation/association.hpp"

namespace swiftlet {
namespace {

// Longest times until the user must have been told.
constexpr Duration kUnplugShows{100'000'000};     // the next call on the device fails
constexpr Duration kSilenceShows{1'300'000'000};  // silence is reported after 1 s and checked every 0.1 s
constexpr Duration kOddImagesShow{600'000'000};   // five images at 10 Hz, and one
constexpr Duration kLossShows{2'000'000'000};     // includes a whole second of the rate watch
constexpr double kLossShare = 0.4;                // by chance a second may lose less than half of it
constexpr double kDarkGrey = 12;                  // the estimator's own limit for dark images
constexpr double kSmallStep = 0.1;                // s; smaller ones may look like delay
constexpr Duration kToldWithin{3'000'000'000};    // a clock step is recognized after 2 s at the latest
// Limits for health.
constexpr Duration kLowered{500'000'000};        // a silent input shows by 0.3 s on the states' own stamps
constexpr Duration kRecovered{3'000'000'000};    // reopened in 0.2 s, clock in 0.1 s, ten images, and margin
constexpr Duration kBlindFailed{3'400'000'000};  // failed after 3 s without an image
// Limits for poses with good health.
constexpr double kWrongMotion = 0.06;  // m over 1 s, four times the largest error of an undisturbed flight
constexpr double kWrongStep = 0.03;    // m between consecutive images: 0.6 m/s of false motion
constexpr Duration kMotion{1'000'000'000};
constexpr Duration kMostApart{20'000'000};

bool takesAway(const PlannedFault& fault) {
  return fault.kind == PlannedFaultKind::kUnplug || fault.kind == PlannedFaultKind::kStall ||
         (fault.device == FaultDevice::kImu && fault.kind == PlannedFaultKind::kGarbage);
}

/// Whether `other` hides `fault` while it lasts, or both are reported with the same word.
bool hides(const PlannedFault& other, const PlannedFault& fault) {
  if (&other == &fault || other.device != fault.device || other.kind == fault.kind) return false;
  switch (fault.kind) {
    case PlannedFaultKind::kUnplug:
      return false;
    case PlannedFaultKind::kGlitch:
      return other.kind == PlannedFaultKind::kDrop;
    case PlannedFaultKind::kDrop:
      return true;
    case PlannedFaultKind::kFreeze:
      return takesAway(other) || other.kind == PlannedFaultKind::kDark;
    default:
      return takesAway(other);
  }
}

std::string deviceStart(FaultDevice device) {
  switch (device) {
    case FaultDevice::kImu:
      return "IMU (";
    case FaultDevice::kCamera0:
      return "camera 0 (";
    case FaultDevice::kCamera1:
      return "camera 1 (";
    case FaultDevice::kTrigger:
      break;
  }
  return "trigger (";
}

/// Texts that tell the user of a fault; any of them counts.
std::span<const std::string_view> wordsOf(PlannedFaultKind kind) {
  static constexpr std::array<std::string_view, 3> kGone = {": gone", ": not there", ": down"};
  static constexpr std::array<std::string_view, 2> kNothing = {": sends nothing", ": sends unexpected data"};
  static constexpr std::array<std::string_view, 2> kLost = {": loses data", ": sends nothing"};
  static constexpr std::array<std::string_view, 1> kClock = {": its clock jumped"};
  static constexpr std::array<std::string_view, 1> kDark = {": sees nothing"};
  static constexpr std::array<std::string_view, 1> kSame = {": repeats one image"};
  static constexpr std::array<std::string_view, 1> kMuch = {": sends too much"};
  switch (kind) {
    case PlannedFaultKind::kUnplug:
      return kGone;
    case PlannedFaultKind::kStall:
    case PlannedFaultKind::kGarbage:
      return kNothing;
    case PlannedFaultKind::kDrop:
      return kLost;
    case PlannedFaultKind::kClockStep:
      return kClock;
    case PlannedFaultKind::kDark:
      return kDark;
    case PlannedFaultKind::kFreeze:
      return kSame;
    case PlannedFaultKind::kGlitch:
      break;
  }
  return kMuch;
}

/// Time that a fault must last before it must be reported; empty: never.
std::optional<Duration> toldAfter(const PlannedFault& fault) {
  switch (fault.kind) {
    case PlannedFaultKind::kUnplug:
      return kUnplugShows;
    case PlannedFaultKind::kStall:
    case PlannedFaultKind::kGarbage:
      return kSilenceShows;
    case PlannedFaultKind::kDrop:
      return fault.value >= kLossShare ? std::optional(kLossShows) : std::nullopt;
    case PlannedFaultKind::kDark:
      return fault.value <= kDarkGrey ? std::optional(kOddImagesShow) : std::nullopt;
    case PlannedFaultKind::kFreeze:
      return kOddImagesShow;
    case PlannedFaultKind::kGlitch:
      return kLossShows;
    case PlannedFaultKind::kClockStep:
      break;
  }
  return std::abs(fault.value) >= kSmallStep ? std::optional(Duration{}) : std::nullopt;
}

std::string faultName(const PlannedFault& fault) {
  return fmt::format("{} {} at {:.3f} s", name(fault.device), name(fault.kind), fault.begin.seconds());
}

class Checker {
 public:
  explicit Checker(const HilEvidence& evidence) : e_(evidence) {}

  std::vector<HilCheck> operator()() {
    add("log played to its end, no image late", e_.complete, "complete, each image in time",
        "incomplete, or some images late");
    add("flight ended as requested", e_.finished, "its summary says so",
        "the flight has no summary, or did not finish");
    std::array<bool, 4> seen{};
    for (const PlannedFault& fault : e_.faults.faults()) {
      checkTold(fault);
      checkLowered(fault);
      seen.at(static_cast<std::size_t>(fault.device)) = true;
    }
    for (std::size_t d = 0; d < seen.size(); ++d) {
      if (seen.at(d)) checkReturned(static_cast<FaultDevice>(d));
    }
    checkBlind();
    checkRecovered();
    checkPoses("frames", e_.frames, true);
    if (!e_.states.empty()) checkPoses("states at IMU rate", e_.states, false);
    return std::move(checks_);
  }

 private:
  void add(std::string name, bool passed, std::string good, std::string bad) {
    checks_.push_back({std::move(name), passed, passed ? std::move(good) : std::move(bad)});
  }
  [[nodiscard]] Duration time(Stamp stamp) const { return stamp - e_.first_image; }
  /// Time from which on every fault is over; a step is over at once.
  [[nodiscard]] Duration calm(std::optional<FaultDevice> device = std::nullopt) const {
    Duration end;
    for (const PlannedFault& fault : e_.faults.faults()) {
      const Duration length = fault.kind == PlannedFaultKind::kClockStep ? Duration{} : fault.length;
      if (!device || fault.device == *device) end = std::max(end, fault.begin + length);
    }
    return end;
  }
  [[nodiscard]] Duration played() const { return time(e_.last_image); }

  /// Overlapping faults of one kind are reported once, when the first begins.
  [[nodiscard]] Duration beginOfChain(const PlannedFault& fault) const {
    Duration begin = fault.begin;
    for (bool grew = true; grew;) {
      grew = false;
      for (const PlannedFault& other : e_.faults.faults()) {
        if (other.device != fault.device || other.kind != fault.kind) continue;
        if (other.begin >= begin || other.begin + other.length < begin) continue;
        begin = other.begin;
        grew = true;
      }
    }
    return begin;
  }

  void checkTold(const PlannedFault& fault) {
    const std::optional<Duration> after = toldAfter(fault);
    const Duration from = beginOfChain(fault);
    const FaultStretch shown = longestVisible(fault, e_.faults);
    Duration until = shown.end + kToldWithin;
    // A clock step that cannot be noticed becomes visible when the sensor is heard again.
    if (fault.kind == PlannedFaultKind::kClockStep)
      until = std::max(shown.begin, calm(fault.device)) + kToldWithin;
    const bool steps = fault.kind == PlannedFaultKind::kClockStep;
    if (!after || (!steps && shown.length() < *after) || until > played()) return;
    const std::string device = deviceStart(fault.device);
    const std::string check = fmt::format("reported with a remedy within {:g} s of its end: {}",
                                          kToldWithin.seconds(), faultName(fault));
    for (const HilEvidence::Line& line : e_.remarks) {
      const Duration at = time(line.stamp);
      if (at < from || at > until || !line.text.starts_with(device)) continue;
      const bool says = std::ranges::any_of(wordsOf(fault.kind), [&](std::string_view word) {
        return line.text.find(word) != std::string::npos;
      });
      if (!says || line.text.find("; ") == std::string::npos) continue;
      add(check, true, fmt::format("at {:.2f} s: {}", at.seconds(), line.text), "");
      return;
    }
    add(check, false, "",
        fmt::format(
            "no line of events.log from {:.2f} to {:.2f} s names the device, the fault and the remedy",
            from.seconds(), until.seconds()));
  }

  /// A device's lines must end with one that ends its current fault.
  void checkReturned(FaultDevice device) {
    const Duration until = calm(device) + kRecovered;
    if (until > played()) return;
    const std::string start = deviceStart(device);
    std::string fault;
    std::string defect;
    for (const HilEvidence::Line& line : e_.remarks) {
      if (!line.text.starts_with(start) || time(line.stamp) > until) continue;
      const auto has = [&](std::string_view word) { return line.text.find(word) != std::string::npos; };
      if (has(": its clock jumped")) continue;
      const bool of_working =
          has(": loses data") || has(": sees nothing") || has(": repeats") || has(": sends too");
      if (has(": works again")) {
        fault.clear();
      } else if (has(": normal again")) {
        defect.clear();
      } else {
        (of_working ? defect : fault) = line.text;
      }
    }
    const std::string& stands = fault.empty() ? defect : fault;
    add(fmt::format("no longer reported as faulty {:g} s after its last fault: {}", kRecovered.seconds(),
                    name(device)),
        stands.empty(), fmt::format("works at {:.2f} s", until.seconds()),
        fmt::format("still reported at {:.2f} s: {}", until.seconds(), stands));
  }

  [[nodiscard]] const HilEvidence::Judged* firstOf(Duration from, Duration until, Health health,
                                                   bool is) const {
    for (const std::vector<HilEvidence::Judged>* list : {&e_.frames, &e_.states}) {
      for (const HilEvidence::Judged& pose : *list) {
        if (time(pose.stamp) < from || time(pose.stamp) >= until) continue;
        if ((pose.health == health) == is) return &pose;
      }
    }
    return nullptr;
  }

  void checkLowered(const PlannedFault& fault) {
    const bool unseen = fault.kind == PlannedFaultKind::kFreeze ||
                        (fault.kind == PlannedFaultKind::kDark && fault.value <= kDarkGrey);
    if (fault.device == FaultDevice::kTrigger || (!takesAway(fault) && !unseen)) return;
    const Duration from = fault.begin + kLowered;
    const Duration until = std::min(fault.begin + fault.length, played());
    if (from >= until) return;
    const HilEvidence::Judged* good = firstOf(from, until, Health::kGood, true);
    add(fmt::format("health not good from {:g} s after its start to its end: {}", kLowered.seconds(),
                    faultName(fault)),
        good == nullptr,
        fmt::format("no state is good from {:.2f} to {:.2f} s", from.seconds(), until.seconds()),
        good == nullptr ? "" : fmt::format("good at {:.3f} s", time(good->stamp).seconds()));
  }

  [[nodiscard]] bool blind(Duration at, FaultDevice camera) const {
    return std::ranges::any_of(e_.faults.faults(), [&](const PlannedFault& fault) {
      const bool odd = fault.kind == PlannedFaultKind::kFreeze ||
                       (fault.kind == PlannedFaultKind::kDark && fault.value <= kDarkGrey);
      return fault.device == camera && (takesAway(fault) || odd) && fault.covers(at);
    });
  }

  /// If both cameras are lost for longer than coasting is trusted, health must be failed.
  void checkBlind() {
    constexpr Duration kStep{10'000'000};
    Duration since = Duration{-1};
    for (Duration at; at < played(); at = at + kStep) {
      if (!blind(at, FaultDevice::kCamera0) || !blind(at, FaultDevice::kCamera1)) {
        since = Duration{-1};
        continue;
      }
      if (since < Duration{}) since = at;
      if (at - since < kBlindFailed) continue;
      if (const HilEvidence::Judged* other = firstOf(at, at + kStep, Health::kFailed, false)) {
        add(fmt::format("health failed from {:g} s without a usable image", kBlindFailed.seconds()), false,
            "",
            fmt::format("{} at {:.3f} s, blind since {:.2f} s", healthName(other->health),
                        time(other->stamp).seconds(), since.seconds()));
        return;
      }
    }
  }

  void checkRecovered() {
    const Duration from = calm();
    if (e_.faults.faults().empty() || from + kRecovered > played()) return;
    const HilEvidence::Judged* good = firstOf(from, from + kRecovered, Health::kGood, true);
    add(fmt::format("health good within {:g} s of the last fault's end", kRecovered.seconds()),
        good != nullptr,
        good == nullptr
            ? ""
            : fmt::format("good {:.2f} s after the last fault", (time(good->stamp) - from).seconds()),
        fmt::format("not good; the last fault ended at {:.2f} s", from.seconds()));
  }

  /// Compares the motion over a second with the truth's, within stretches of good poses.
  void checkPoses(const std::string& what, const std::vector<HilEvidence::Judged>& poses, bool steps) {
    if (e_.truth.empty()) return;
    double worst = 0;
    double worst_step = 0;
    Duration at;
    Duration step_at;
    std::size_t compared = 0;
    std::size_t first = 0;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      if (poses[i].health != Health::kGood || (i > 0 && poses[i].epoch != poses[i - 1].epoch)) {
        first = poses[i].health == Health::kGood ? i : i + 1;
        continue;
      }
      if (steps && i > first) {
        const double error = motionError(poses[i - 1], poses[i]).value_or(0);
        if (error > worst_step) step_at = time(poses[i].stamp);
        worst_step = std::max(worst_step, error);
      }
      while (first < i && poses[i].stamp - poses[first + 1].stamp >= kMotion) ++first;
      if (poses[i].stamp - poses[first].stamp < kMotion) continue;
      const std::optional<double> error = motionError(poses[first], poses[i]);
      if (!error) continue;
      ++compared;
      if (*error > worst) at = time(poses[i].stamp);
      worst = std::max(worst, *error);
    }
    std::string check = fmt::format("good {}: motion wrong by at most {:g} m over 1 s", what, kWrongMotion);
    std::string says = fmt::format("largest error {:.4f} m over 1 s (at {:.2f} s, {} compared)", worst,
                                   at.seconds(), compared);
    if (steps) {
      check += fmt::format(", {:g} m between images", kWrongStep);
      says += fmt::format(", {:.4f} m between images (at {:.2f} s)", worst_step, step_at.seconds());
    }
    add(check, compared > 0 && worst <= kWrongMotion && worst_step <= kWrongStep, says,
        compared > 0 ? says : "no second of good poses has truth to compare with");
  }

  [[nodiscard]] std::optional<double> motionError(const HilEvidence::Judged& a,
                                                  const HilEvidence::Judged& b) const {
    const std::optional<SE3> true_a = interpolate(e_.truth, a.stamp, kMostApart);
    const std::optional<SE3> true_b = interpolate(e_.truth, b.stamp, kMostApart);
    if (!true_a || !true_b) return std::nullopt;
    const SE3 truth = true_a->inverse() * *true_b;
    const SE3 estimate = a.T_world_body.inverse() * b.T_world_body;
    const double error = (truth.inverse() * estimate).translation.norm();
    return std::isfinite(error) ? error : HUGE_VAL;
  }

  const HilEvidence& e_;
  std::vector<HilCheck> checks_;
};

}  // namespace

FaultStretch longestVisible(const PlannedFault& fault, const FaultTimeline& faults) {
  // Between the ends of the faults that hide it.
  std::vector<Duration> edges = {fault.begin, fault.begin + fault.length};
  for (const PlannedFault& other : faults.faults()) {
    if (!hides(other, fault)) continue;
    for (const Duration edge : {other.begin, other.begin + other.length}) {
      if (edge > edges[0] && edge < edges[1]) edges.push_back(edge);
    }
  }
  std::ranges::sort(edges);
  FaultStretch longest{fault.begin, fault.begin};
  FaultStretch current = longest;
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    const bool hidden = std::ranges::any_of(faults.faults(), [&](const PlannedFault& other) {
      return hides(other, fault) && other.covers(edges[i]);
    });
    if (hidden) {
      current = {edges[i + 1], edges[i + 1]};
      continue;
    }
    current.end = edges[i + 1];
    if (current.length() > longest.length()) longest = current;
  }
  return longest;
}

bool HilVerdict::passed() const {
  return std::ranges::all_of(checks_, [](const HilCheck& check) { return check.passed; });
}

std::string HilVerdict::text() const {
  std::string text;
  for (const HilCheck& check : checks_) {
    text += fmt::format("  {} {}: {}\n", check.passed ? "passed" : "failed", check.name, check.says);
  }
  return text + (passed() ? "all passed\n" : "FAILED\n");
}

std::string HilVerdict::junit(const std::string& suite) const {
  std::string cases;
  std::size_t failures = 0;
  for (const HilCheck& check : checks_) {
    const std::string start = fmt::format("    <testcase classname=\"hil\" name=\"{}\"", xmlText(check.name));
    if (check.passed) {
      cases += start + "/>\n";
      continue;
    }
    ++failures;
    cases += start + fmt::format(">\n      <failure type=\"failed\" message=\"{}\"/>\n    </testcase>\n",
                                 xmlText(check.says));
  }
  const std::string counts =
      fmt::format(R"(tests="{}" failures="{}" errors="0" skipped="0")", checks_.size(), failures);
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites {0}>\n  <testsuite name=\"{1}\" {0}>\n{2}"
      "    <system-out>{3}</system-out>\n  </testsuite>\n</testsuites>\n",
      counts, xmlText(suite), cases, xmlText(text(), XmlPlace::kContent));
}

HilVerdict checkHil(const HilEvidence& evidence) { return HilVerdict(Checker(evidence)()); }

}  // namespace swiftlet
