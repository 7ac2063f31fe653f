#include "firmware_host/lab/hil/hil_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>

#include "drivers/device/monotonic_now.hpp"
#include "drivers/recorded/open_log.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/inputs/devices/device_times.hpp"
#include "firmware_host/lab/hil/log_reader.hpp"
#include "firmware_host/lab/hil/played_camera.hpp"
#include "firmware_host/lab/hil/played_imu.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

/// Largest distance of a log's images from the cameras' instants: their stamps say when they were taken, and
/// the camera will report when they were shown.
constexpr Duration kOffGrid = Duration::fromMilliseconds(1);
/// Period at which all devices are checked while nothing is due.
constexpr Duration kLook = Duration{500'000};
/// Slots after the last image: the driver shows its last images only while more follow.
constexpr std::int64_t kSlotsBehind = 6;

void demand(const DeviceFault& fault, const std::string& device, const char* setting) {
  if (!fault.ok()) throw InputError("settings", 0, setting, describe(fault, device), "");
}

/// Drives the trigger's line.
class PlayedTrigger {
 public:
  PlayedTrigger(std::string file, const FaultTimeline& faults) : file_(std::move(file)), faults_(faults) {
    if (!file_.empty() && !pull(false)) {
      throw InputError("settings", 0, "hil.trigger_pull", file_ + ": cannot be written",
                       "Set the `pull` file of a gpio-sim line, and run as its owner");
    }
  }

  void begin(const FrameGrid& grid, std::int64_t last_slot) {
    grid_ = grid;
    last_slot_ = last_slot;
  }

  /// Up at each instant, down a quarter of a period later.
  void step(Stamp now) {
    const std::optional<Stamp> when = due();
    if (!when || now < *when) return;
    switch (next_) {
      case Next::kUp:
        raise(grid_.instant(slot_) - grid_.first);
        break;
      case Next::kGlitchDown:
        static_cast<void>(pull(false));
        next_ = Next::kGlitchUp;
        break;
      case Next::kGlitchUp:
        static_cast<void>(pull(true));
        next_ = Next::kDown;
        break;
      case Next::kDown:
        static_cast<void>(pull(false));
        next_ = Next::kUp;
        break;
    }
  }
  [[nodiscard]] std::optional<Stamp> due() const {
    if (file_.empty() || (next_ == Next::kUp && slot_ > last_slot_)) return std::nullopt;
    switch (next_) {
      case Next::kUp:
        return grid_.instant(slot_);
      case Next::kGlitchDown:
        return grid_.instant(slot_ - 1) + kGlitch;
      case Next::kGlitchUp:
        return grid_.instant(slot_ - 1) + kGlitch + kGlitch;
      case Next::kDown:
        break;
    }
    return grid_.instant(slot_ - 1) + Duration{grid_.period.ns / 4};
  }
  [[nodiscard]] std::uint64_t edges() const { return edges_; }

 private:
  enum class Next : std::uint8_t { kUp, kGlitchDown, kGlitchUp, kDown };
  /// Half the length of a glitch: the kernel's simulated line merges immediate edges into one interrupt.
  static constexpr Duration kGlitch = Duration::fromMilliseconds(1);

  void raise(Duration time) {
    const auto number = static_cast<std::uint64_t>(slot_++);
    const PlannedFault* drop = faults_.active(FaultDevice::kTrigger, PlannedFaultKind::kDrop, time);
    if (drop != nullptr && faults_.strikes(*drop, number)) return;
    ++edges_;
    static_cast<void>(pull(true));
    const bool glitch = faults_.active(FaultDevice::kTrigger, PlannedFaultKind::kGlitch, time) != nullptr;
    next_ = glitch ? Next::kGlitchDown : Next::kDown;
  }
  [[nodiscard]] bool pull(bool up) const {
    std::ofstream file(file_);
    file << (up ? "pull-up" : "pull-down") << std::flush;
    return static_cast<bool>(file);
  }

  std::string file_;
  const FaultTimeline& faults_;
  FrameGrid grid_;
  std::int64_t slot_ = 0;
  std::int64_t last_slot_ = 0;
  Next next_ = Next::kUp;
  std::uint64_t edges_ = 0;
};

class HilRun {
 public:
  HilRun(const HilRequest& request, const Settings& settings)
      : request_(request),
        settings_(settings),
        source_(openLog(request.log, options(settings))),
        reader_(*source_),
        trigger_(settings.hil.trigger_pull, request.faults) {}

  HilResult operator()() {
    if (settings_.imu_link.device.empty()) {
      throw InputError("settings", 0, "imu_link.device", "no IMU is set",
                       "Set a serial port that does not exist (its name is linked to a pseudo-terminal), or "
                       "a CAN interface");
    }
    std::filesystem::create_directories(request_.out);
    writeWholeFile(std::filesystem::path(request_.out) / "faults.csv", request_.faults.text() + "\n");
    openDevices();
    if (!waitForReader()) {
      warn(fmt::format("error: no program opened {} within {:.0f} s\n", settings_.imu_link.device,
                       request_.patience));
      return end(false);
    }
    chooseGrid();
    writeTruth();
    return end(play());
  }

 private:
  static LogOptions options(const Settings& settings) {
    LogOptions options;
    options.calibration_options.accept_unusual_rig = settings.calibration.accept_unusual_rig;
    options.imu_after_last_image = true;
    return options;
  }

  void openDevices() {
    imu_ = std::make_unique<PlayedImu>(makeImuWire(settings_.imu_link), reader_, request_.faults,
                                       source_->calibration().imuCorrection(), request_.skew_ppm);
    if (!imu_->next())
      throw InputError(request_.log, 0, "", "has no IMU samples to play", "Give a log with IMU samples");
    demand(imu_->open(), settings_.imu_link.device, "imu_link.device");
    const std::array<const std::string*, kMaxCameras> outputs = {&settings_.hil.output0,
                                                                 &settings_.hil.output1};
    const std::array<const std::string*, kMaxCameras> captures = {&settings_.cameras.device0,
                                                                  &settings_.cameras.device1};
    static constexpr std::array<const char*, kMaxCameras> kSettings = {"hil.output0", "hil.output1"};
    for (std::size_t c = 0; c < source_->rig().camera_count; ++c) {
      if (outputs[c]->empty()) {
        throw InputError("settings", 0, kSettings[c], fmt::format("no output node for camera {}", c),
                         "Set the output node of the vivid driver that feeds this camera (docs/hil.md)");
      }
      const CameraModel& model = source_->rig().camera[c];
      cameras_.push_back(std::make_unique<PlayedCamera>(c, reader_, request_.faults));
      demand(cameras_.back()->open(*outputs[c], *captures[c], model.width(), model.height()), *outputs[c],
             kSettings[c]);
      if (!cameras_.back()->next()) {
        throw InputError(request_.log, 0, "", fmt::format("no image of camera {}", c),
                         "Give a log with images");
      }
    }
  }

  bool waitForReader() {
    const double begin = wallSeconds();
    constexpr Duration kPeriod = Duration::fromMilliseconds(20);
    while (!imu_->isRead()) {
      if (stopped() || wallSeconds() - begin > request_.patience) return false;
      sleepFor(kPeriod);
    }
    return true;
  }

  void chooseGrid() {
    grid_.period = Duration::fromSeconds(1 / settings_.cameras.rate_hz);
    grid_.first_log = cameras_.front()->next()->stamp;
    for (const auto& camera : cameras_) {
      const Stamp first = camera->next()->stamp;
      if (grid_.offGrid(first) > kOffGrid) {
        throw InputError(request_.log, 0, "", "the cameras' images were not taken at the same time",
                         "Play a log of synchronized cameras");
      }
    }
    const Stamp earliest = monotonicNow() + Duration::fromSeconds(request_.lead + 2 * grid_.period.seconds());
    grid_.first = Stamp{(earliest.ns / grid_.period.ns + 1) * grid_.period.ns};
    // From the log's list of images.
    last_slot_ = static_cast<std::int64_t>(source_->frameCount()) - 1;
    if (request_.seconds > 0) {
      last_slot_ =
          std::min(last_slot_, static_cast<std::int64_t>(request_.seconds * settings_.cameras.rate_hz));
    }
    for (const auto& camera : cameras_) camera->begin(grid_, monotonicNow(), last_slot_);
    trigger_.begin(grid_, last_slot_);
    imu_->begin(grid_, grid_.first_log + Duration{(last_slot_ + 1) * grid_.period.ns});
  }

  void writeTruth() {
    const Trajectory truth = source_->groundTruth();
    if (truth.empty()) return;
    WholeFile file(std::filesystem::path(request_.out) / "truth.tum");
    // Truth of the played part.
    for (const TrajectoryPoint& point : truth) {
      const Stamp host = grid_.toHost(point.stamp);
      if (host < grid_.first || host > grid_.instant(last_slot_)) continue;
      file.write(formatTum(host, point.T_world_body) + "\n");
    }
    file.commit();
  }

  bool play() {
    const Stamp end = grid_.instant(last_slot_ + kSlotsBehind);
    for (Stamp now = monotonicNow(); now < end; now = monotonicNow()) {
      if (stopped()) return false;
      if (broke(imu_->step(now), settings_.imu_link.device)) return false;
      trigger_.step(now);
      for (std::size_t c = 0; c < cameras_.size(); ++c) {
        if (broke(cameras_[c]->step(monotonicNow()), fmt::format("camera {}'s output", c))) return false;
      }
      Stamp next = monotonicNow() + kLook;
      if (const auto due = imu_->due()) next = std::min(next, *due);
      if (const auto due = trigger_.due()) next = std::min(next, *due);
      if (next > monotonicNow()) sleepUntil(secondsOf(next));
    }
    return true;
  }

  /// An unplanned fault ends the replay, and the report says so.
  bool broke(const DeviceFault& fault, const std::string& device) {
    if (fault.ok()) return false;
    fault_ = describe(fault, device);
    warn("error: " + fault_ + "\n");
    return true;
  }

  HilResult end(bool complete) {
    HilResult result;
    nlohmann::ordered_json& json = result.report;
    json["log"] = request_.log;
    json["first_image_ns"] = grid_.first.ns;
    json["first_image_log_ns"] = grid_.first_log.ns;
    json["last_image_ns"] = grid_.instant(last_slot_).ns;
    json["period_ns"] = grid_.period.ns;
    json["imu"] = {{"sent", imu_->counters().sent},
                   {"withheld", imu_->counters().withheld},
                   {"late_ms",
                    {{"p50", imu_->lateness().percentile(0.5) * kToMs},
                     {"p99", imu_->lateness().percentile(0.99) * kToMs},
                     {"max", imu_->lateness().max() * kToMs}}}};
    std::uint64_t bad = 0;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const PlayedCamera::Counters& counters = cameras_[c]->counters();
      json[fmt::format("camera{}", c)] = {{"shown", counters.shown},
                                          {"late", counters.late},
                                          {"missing", counters.missing},
                                          {"slipped", counters.slipped}};
      bad += counters.late + counters.slipped;
    }
    json["trigger_edges"] = trigger_.edges();
    json["complete"] = complete;
    if (!fault_.empty()) json["fault"] = fault_;
    result.complete = complete && bad == 0;
    writeWholeFile(std::filesystem::path(request_.out) / "hil.json", json.dump(2) + "\n");
    return result;
  }

  [[nodiscard]] bool stopped() const {
    return request_.stop != nullptr && request_.stop->load(std::memory_order_relaxed);
  }

  const HilRequest& request_;
  const Settings& settings_;
  std::unique_ptr<LogSource> source_;
  LogReader reader_;
  std::unique_ptr<PlayedImu> imu_;
  std::vector<std::unique_ptr<PlayedCamera>> cameras_;
  PlayedTrigger trigger_;
  FrameGrid grid_;
  std::int64_t last_slot_ = 0;
  std::string fault_;  ///< unplanned fault
};

}  // namespace

HilResult runHil(const HilRequest& request, const Settings& settings) { return HilRun(request, settings)(); }

}  // namespace swiftlet
