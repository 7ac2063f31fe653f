#include "firmware_host/runs/doctor_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimator/core/units.hpp"
#include "firmware_host/inputs/devices/connected_devices.hpp"
#include "firmware_host/inputs/devices/input_topics.hpp"
#include "firmware_host/inputs/devices/live_input.hpp"
#include "firmware_host/inputs/devices/sensor_threads.hpp"
#include "firmware_host/inputs/devices/status_json.hpp"
#include "firmware_host/inspection/inspect_log.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/runs/keeping_sink.hpp"
#include "firmware_host/runs/vehicle_calibration.hpp"

namespace swiftlet {
namespace {

bool namesDevices(const Settings& settings) {
  return !settings.imu_link.device.empty() || !settings.cameras.device0.empty() ||
         !settings.cameras.pipeline0.empty() || inputTopics(settings).any();
}

constexpr const char* kSlowTopics =
    "messages are lost in transit: set `sysctl net.core.rmem_max` to 10 MB, run drivers on this computer, "
    "use fewer subscribers and topics";

MachineLine line(const std::string& what, std::string found, bool good, std::string remedy) {
  return {what, std::move(found), good ? MachineVerdict::kGood : MachineVerdict::kPoor,
          good ? "" : std::move(remedy)};
}

void addInspection(const InspectionReport& inspection, MachineReport& report) {
  for (const Finding& finding : inspection.findings) {
    report.lines.push_back({finding.what, finding.evidence, MachineVerdict::kPoor, finding.remedy});
  }
  for (const Measured& measured : inspection.measured) {
    report.lines.push_back({measured.what, measured.found, MachineVerdict::kNote, ""});
  }
}

/// Watches the opened devices and reports what they did.
class VehicleCheck {
 public:
  VehicleCheck(const Settings& settings, const Calibration& calibration, LiveInput& input, double seconds)
      : settings_(settings),
        calibration_(calibration),
        topics_(inputTopics(settings, calibration.rig.camera_count)),
        input_(input),
        seconds_(seconds),
        sink_(most()) {}

  void run(const std::atomic<bool>* stop, MachineReport& report) {
    SensorThreads threads(input_, sink_, settings_.realtime);
    const double begin = wallSeconds();
    constexpr Duration kPeriod = Duration::fromMilliseconds(50);
    while (wallSeconds() - begin < seconds_ && !(stop != nullptr && stop->load(std::memory_order_relaxed))) {
      sleepFor(kPeriod);
    }
    threads.join();
    input_.drainEvents([&report](Stamp /*stamp*/, const std::string& text) {
      report.lines.push_back({"in this time", text, MachineVerdict::kNote, ""});
    });
    addImu(report);
    for (std::size_t i = 0; i < input_.cameras().size(); ++i) addCamera(i, report);
    addPairs(report);
    addTrigger(report);
    if (!calibration_.bare) addInspection(sink_.inspect(calibration_), report);
  }

 private:
  [[nodiscard]] std::size_t most() const {
    constexpr double kFastest = 2000;  // Hz, of any IMU
    constexpr double kMost = 1e6;      // 8 MB a stream: ten minutes of the fastest
    return static_cast<std::size_t>(std::min(seconds_ * kFastest, kMost)) + 1;
  }

  void addImu(MachineReport& report) {
    const CountingSink::Stream& stream = sink_.imu();
    const double wanted = calibration_.noise.rate_hz;
    constexpr double kTolerance = 0.05;  // of the rate
    report.lines.push_back(line(
        "IMU rate", fmt::format("{:.1f} Hz, calibration {:.1f} Hz", stream.rate(), wanted),
        std::abs(stream.rate() - wanted) < kTolerance * wanted,
        stream.stamps.empty() ? (topics_.imu.empty() ? "no samples: check power and wires, and that "
                                                       "imu_link.protocol and imu_link.baud match the device"
                                                     : "no samples: check that the driver is running")
                              : "set the device's output rate, or correct rate_hz in the calibration: the "
                                "noise depends on it"));
    if (const std::string asked = input_.imu().link().stream(); !asked.empty()) {
      report.lines.push_back({"IMU stream", asked, MachineVerdict::kNote, ""});
    }
    if (stream.stamps.size() < 2) return;
    const Duration typical = stream.medianStep();
    const Duration largest = stream.largestStep();
    report.lines.push_back(line(
        "IMU gaps",
        fmt::format("largest step {:.2f} ms, median {:.2f} ms", largest.seconds() * kToMs,
                    typical.seconds() * kToMs),
        largest < typical + typical + typical,
        topics_.imu.empty() ? "samples are lost in transit: raise the baud rate, or disable other outputs"
                            : kSlowTopics));
    const ImuStatus status = input_.imu().status();
    if (status.by_driver > 0) {
      report.lines.push_back(
          {"IMU clock", "wall clock, from the driver's stamps", MachineVerdict::kGood, ""});
      return;
    }
    if (status.by_arrival > 0) {
      report.lines.push_back({"IMU clock", "the device sends no clock: samples are stamped at arrival",
                              MachineVerdict::kPoor, "enable its time output"});
      return;
    }
    const std::string found = fmt::format(
        "{}, skew {:.1f} ppm, delay above the minimum: median {:.2f} ms, 99 % below {:.2f} ms, steps {}",
        lockName(status.clock.lock), status.clock.skew_ppm, status.clock.residual_p50.seconds() * kToMs,
        status.clock.residual_p99.seconds() * kToMs, status.clock.resets);
    // drivers/timesync/clock_map.cpp needs four seconds; the rest is for opening and the first sample.
    constexpr double kLockTime = 6;  // s
    if (status.clock.resets == 0 && status.clock.lock == LockState::kLocking && seconds_ < kLockTime) {
      report.lines.push_back(
          {"IMU clock", found, MachineVerdict::kNote, "run with `--seconds 10` to see whether it locks"});
      return;
    }
    report.lines.push_back(line(
        "IMU clock", found, status.clock.lock == LockState::kLocked && status.clock.resets == 0,
        status.clock.resets > 0 ? "the device restarts, or its clock is set while it runs"
                                : "the link is overloaded: raise the baud rate, or disable other outputs"));
  }

  void addCamera(std::size_t index, MachineReport& report) {
    const CameraThread& camera = *input_.cameras()[index];
    const CameraStatus status = camera.status();
    const CountingSink::Stream& stream = sink_.camera(index);
    const std::string name = fmt::format("camera {}", index);
    const CameraFacts& facts = camera.facts();
    const auto& cameras = settings_.cameras;
    const bool pipeline = !(index == 0 ? cameras.pipeline0 : cameras.pipeline1).empty();
    const bool topic = !topics_.camera.at(index).empty();
    report.lines.push_back(
        {name + " images",
         fmt::format("{}x{} {}, {}, from {} ({})", facts.width, facts.height, facts.format.fourcc(),
                     facts.rate > 0 ? fmt::format("{:.4g} Hz", facts.rate) : "rate unknown",
                     topic ? topics_.camera.at(index) : facts.card.data(), facts.driver.data()),
         MachineVerdict::kGood, ""});
    const double wanted = settings_.cameras.rate_hz;
    constexpr double kTolerance = 0.02;  // of the rate
    report.lines.push_back(
        line(name + " rate", fmt::format("{:.2f} Hz, requested {:.2f} Hz", stream.rate(), wanted),
             std::abs(stream.rate() - wanted) < kTolerance * wanted,
             stream.stamps.empty() ? "no images: a camera with an external trigger waits for it"
                                   : "check the light: a long exposure lowers the rate; or set "
                                     "cameras.rate_hz to a rate that the camera reaches"));
    const CameraCounters& c = status.counters;
    report.lines.push_back(line(
        name + " frames",
        fmt::format("{} received, {} missed, {} damaged, {} too short{}", c.frames, c.missed, c.damaged,
                    c.too_short,
                    topic ? fmt::format(", {} stale, {} with another clock", c.stale, c.wrong_clock) : ""),
        c.missed + c.damaged + c.too_short + c.stale + c.wrong_clock == 0,
        topic      ? kSlowTopics
        : pipeline ? "the pipeline or its source is too slow: use fewer conversions or a lower rate"
                   : "the bus is too slow for these cameras: use other USB controllers, shorter cables, or a "
                     "lower rate"));
    report.lines.push_back(line(
        name + " stamps", stampEventName(facts.event),
        facts.event != StampEvent::kArrival && c.stamp_ahead == 0,
        c.stamp_ahead > 0
            ? (topic      ? "its stamps are ahead of this computer's clock: synchronize both by NTP or PTP"
               : pipeline ? "the pipeline delivers images before their time: add `clocksync`"
                          : "the driver stamps frames later than it delivers them")
            : "the time of capture is unknown: use a driver or pipeline that stamps the start of exposure"));
    if (stream.stamps.size() < 2) return;
    constexpr double kMost = 0.99;
    report.lines.push_back(
        {name + " timing",
         fmt::format("steps deviate from {:.2f} ms by {:.3f} ms (99 %); from stamp to arrival {:.2f} ms, 99 "
                     "% below {:.2f} ms",
                     stream.medianStep().seconds() * kToMs, stream.jitter(kMost).seconds() * kToMs,
                     stream.latency(0.5).seconds() * kToMs, stream.latency(kMost).seconds() * kToMs),
         MachineVerdict::kGood, ""});
  }

  void addPairs(MachineReport& report) {
    const std::vector<Duration> distances = sink_.pairDistances();
    if (distances.empty()) return;
    const double median = distances[distances.size() / 2].seconds() * kToMs;
    const double largest = distances.back().seconds() * kToMs;
    // 0.2 ms is half a pixel at a focal length of 400 px and 6 rad/s; docs/timesync.md.
    constexpr double kGood = 0.2;  // ms
    report.lines.push_back(
        line("stereo pairs", fmt::format("{:.3f} ms apart, at most {:.3f} ms", median, largest),
             median < kGood, "free-running cameras drift apart: trigger both from one line"));
  }

  void addTrigger(MachineReport& report) {
    if (settings_.trigger.chip.empty()) return;
    if (const TriggerThread* trigger = input_.trigger()) {
      const TriggerStatus status = trigger->status();
      report.lines.push_back(line(
          "trigger edges", fmt::format("{} in {:.1f} s, {} missed", status.edges, seconds_, status.missed),
          status.edges > 0 && status.missed == 0,
          status.edges == 0 ? "no edge: check trigger.line and the signal's source"
                            : "another interrupt blocks the CPU: move it with smp_affinity"));
    }
    for (std::size_t i = 0; i < input_.cameras().size(); ++i) {
      const std::string name = fmt::format("camera {} trigger", i);
      if (const std::string warning = input_.cameras()[i]->triggerWarning(); !warning.empty()) {
        report.lines.push_back({name, "not used", MachineVerdict::kPoor, warning});
        continue;
      }
      const CameraStatus status = input_.cameras()[i]->status();
      report.lines.push_back(line(
          name,
          fmt::format("{}, frame after edge {:.3f} ms, 99 % within {:.1f} us", lockName(status.trigger.lock),
                      status.trigger.offset.seconds() * kToMs, status.trigger.residual_p99.seconds() * kToUs),
          status.trigger.lock == LockState::kLocked,
          "edges and frames do not match: this camera is not triggered by that line"));
    }
  }

  const Settings& settings_;
  const Calibration& calibration_;
  const InputTopics topics_;
  LiveInput& input_;
  double seconds_;
  KeepingSink sink_;
};

void addNext(const Settings& settings, DoctorReport& report) {
  if (!namesDevices(settings)) {
    report.next = {"connect cameras and IMU; then `swiftlet doctor` lists them",
                   "`swiftlet settings > vehicle.yaml`; set vehicle, imu_link and cameras",
                   "`swiftlet doctor --settings vehicle.yaml` checks them at work"};
    return;
  }
  if (!report.ready()) {
    report.next = {
        "fix what is poor above under \"this vehicle\", starting with the first line, and run this again"};
    return;
  }
  report.next = {"`swiftlet fly` with the same settings"};
}

}  // namespace

bool DoctorReport::ready() const {
  return !vehicle.lines.empty() && std::ranges::none_of(vehicle.lines, [](const MachineLine& line) {
    return line.verdict == MachineVerdict::kPoor;
  });
}

MachineReport examineLog(const LogRequest& request, const Settings& settings) {
  constexpr std::size_t kImages = 1200;  // a minute at 20 Hz
  const InspectionReport inspection = inspectLog(request, settings, kImages);
  MachineReport report;
  report.lines.push_back(
      {"images", fmt::format("{} of camera 0 checked", inspection.images), MachineVerdict::kNote, ""});
  for (const std::string& text : inspection.warnings) {
    report.lines.push_back({"warning", text, MachineVerdict::kNote, ""});
  }
  addInspection(inspection, report);
  return report;
}

DoctorReport examine(const DoctorRequest& request, const Settings& settings) {
  DoctorReport report;
  report.computer = inspectMachine("", settings.realtime.sensor_priority);
  // Cameras named in the settings are observed in operation below.
  report.connected = connectedDevices("", !namesDevices(settings));
  if (inputTopics(settings).any()) addTopics(settings, report.connected);
  if (namesDevices(settings)) {
    std::optional<Calibration> calibration;
    try {
      calibration = calibratedOrBareRig(settings);
      for (const std::string& text : calibration->warnings) {
        report.vehicle.lines.push_back({"calibration", text, MachineVerdict::kNote, ""});
      }
      LiveInput input(settings, *calibration);
      const LiveInput::Opened opened = input.open();
      for (const std::string& text : opened.faults) {
        report.vehicle.lines.push_back({"device", text, MachineVerdict::kPoor, ""});
      }
      for (const std::string& text : opened.warnings) {
        report.vehicle.lines.push_back({"device", text, MachineVerdict::kNote, ""});
      }
      if (opened.faults.empty()) {
        VehicleCheck(settings, *calibration, input, request.seconds).run(request.stop, report.vehicle);
      }
    } catch (const InputError& error) {
      report.vehicle.lines.push_back({"settings", error.what(), MachineVerdict::kPoor, ""});
    }
  }
  addNext(settings, report);
  return report;
}

}  // namespace swiftlet
