#include "firmware_host/lab/hil/fault_timeline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "drivers/input/input_error.hpp"
#include "drivers/input/read_file.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

struct Known {
  PlannedFaultKind kind;
  std::string_view name;
  bool imu, camera, trigger;
  double value;  ///< default, if the line has no value
  double low, high;
};

constexpr double kLongestStep = 1e6;  // s
constexpr double kWhite = 255;
/// More than a flight of an hour needs; the sum of as many clock steps fits a Duration.
constexpr std::size_t kMostFaults = 1000;

constexpr std::array<Known, 8> kFaults = {{
    {PlannedFaultKind::kUnplug, "unplug", true, true, false, 0, 0, 0},
    {PlannedFaultKind::kStall, "stall", true, true, false, 0, 0, 0},
    {PlannedFaultKind::kGarbage, "garbage", true, false, false, 0, 0, 0},
    {PlannedFaultKind::kDrop, "drop", true, true, true, 0.5, 0, 1},
    {PlannedFaultKind::kClockStep, "clock_step", true, false, false, 0.25, -kLongestStep, kLongestStep},
    {PlannedFaultKind::kDark, "dark", false, true, false, 0, 0, kWhite},
    {PlannedFaultKind::kFreeze, "freeze", false, true, false, 0, 0, 0},
    {PlannedFaultKind::kGlitch, "glitch", false, false, true, 0, 0, 0},
}};

constexpr std::array<std::pair<FaultDevice, std::string_view>, 4> kDevices = {{
    {FaultDevice::kImu, "imu"},
    {FaultDevice::kCamera0, "camera0"},
    {FaultDevice::kCamera1, "camera1"},
    {FaultDevice::kTrigger, "trigger"},
}};

bool has(const Known& fault, FaultDevice device) {
  if (device == FaultDevice::kImu) return fault.imu;
  return device == FaultDevice::kTrigger ? fault.trigger : fault.camera;
}

const Known& known(PlannedFaultKind kind) { return *std::ranges::find(kFaults, kind, &Known::kind); }

std::string namesFor(FaultDevice device) {
  std::string names;
  for (const Known& fault : kFaults) {
    if (has(fault, device)) names += (names.empty() ? "" : ", ") + std::string(fault.name);
  }
  return names;
}

std::string trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) {
    text.remove_suffix(1);
  }
  return std::string(text);
}

std::vector<std::string> fieldsOf(std::string_view line) {
  std::vector<std::string> fields;
  for (;;) {
    const std::size_t comma = line.find(',');
    fields.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

/// One line of the file.
class Row {
 public:
  Row(const std::string& file, int line, std::vector<std::string> fields)
      : file_(file), line_(line), fields_(std::move(fields)) {}

  PlannedFault read() const {
    if (fields_.size() < 4 || fields_.size() > 5) {
      fail("", fmt::format("{} fields", fields_.size()), "Write seconds,device,fault,for seconds[,value]");
    }
    PlannedFault fault;
    fault.begin = Duration::fromSeconds(number(0, "seconds", 0, kLongestStep));
    const auto device =
        std::ranges::find(kDevices, fields_[1], &std::pair<FaultDevice, std::string_view>::second);
    if (device == kDevices.end()) {
      fail("device", "`" + fields_[1] + "` is not a device", "Devices: imu, camera0, camera1, trigger");
    }
    fault.device = device->first;
    const auto kind = std::ranges::find(kFaults, fields_[2], &Known::name);
    if (kind == kFaults.end() || !has(*kind, fault.device)) {
      fail("fault", fmt::format("`{}` is not a fault of {}", fields_[2], fields_[1]),
           "Its faults: " + namesFor(fault.device));
    }
    fault.kind = kind->kind;
    fault.length = Duration::fromSeconds(number(3, "for seconds", 0, kLongestStep));
    fault.value = fields_.size() > 4 ? number(4, "value", kind->low, kind->high) : kind->value;
    return fault;
  }

 private:
  [[noreturn]] void fail(const char* field, const std::string& what, const std::string& remedy) const {
    throw InputError(file_, line_, field, what, remedy);
  }
  [[nodiscard]] double number(std::size_t index, const char* field, double low, double high) const {
    double value = 0;
    if (!parseDouble(fields_[index], value) || !(value >= low && value <= high)) {
      fail(field, "`" + fields_[index] + "` is not allowed",
           fmt::format("Write a number from {} to {}", low, high));
    }
    return value;
  }

  const std::string& file_;
  int line_;
  std::vector<std::string> fields_;
};

}  // namespace

std::string_view name(FaultDevice device) {
  return std::ranges::find(kDevices, device, &std::pair<FaultDevice, std::string_view>::first)->second;
}

std::string_view name(PlannedFaultKind kind) { return known(kind).name; }

FaultTimeline FaultTimeline::parse(const std::string& name, std::string_view text) {
  FaultTimeline timeline;
  int number = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    ++number;
    line = line.substr(0, line.find('#'));
    if (trimmed(line).empty()) continue;
    if (timeline.faults_.size() == kMostFaults) {
      throw InputError(name, number, "", fmt::format("more than {} faults", kMostFaults),
                       "Use a second flight for the rest");
    }
    timeline.faults_.push_back(Row(name, number, fieldsOf(line)).read());
  }
  std::ranges::stable_sort(timeline.faults_, {}, [](const PlannedFault& fault) { return fault.begin.ns; });
  return timeline;
}

FaultTimeline FaultTimeline::read(const std::string& path) {
  return parse(path, readFile(path, "Give a file of faults with --faults (docs/hil.md)"));
}

const PlannedFault* FaultTimeline::active(FaultDevice device, PlannedFaultKind kind, Duration time) const {
  for (const PlannedFault& fault : faults_) {
    if (fault.device == device && fault.kind == kind && fault.covers(time)) return &fault;
  }
  return nullptr;
}

bool FaultTimeline::strikes(const PlannedFault& fault, std::uint64_t n) const {
  const auto line = static_cast<std::uint64_t>(&fault - faults_.data());
  constexpr std::uint64_t kSpread = 0x9E3779B97F4A7C15;  // makes neighbouring draws independent
  return Random(n * kSpread, line).uniform() < fault.value;
}

Duration FaultTimeline::clockStep(Duration time) const {
  Duration sum;
  for (const PlannedFault& fault : faults_) {
    if (fault.kind == PlannedFaultKind::kClockStep && time >= fault.begin) {
      sum = sum + Duration::fromSeconds(fault.value);
    }
  }
  return sum;
}

std::string FaultTimeline::text() const {
  std::string all;
  for (const PlannedFault& fault : faults_) {
    all += fmt::format("{:.3f},{},{},{:.3f},{:g}\n", fault.begin.seconds(), name(fault.device),
                       name(fault.kind), fault.length.seconds(), fault.value);
  }
  return all;
}

}  // namespace swiftlet
