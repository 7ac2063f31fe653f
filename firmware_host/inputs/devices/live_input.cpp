#include "firmware_host/inputs/devices/live_input.hpp"

#include <fmt/format.h>

#include <charconv>
#include <utility>

#include "drivers/dds/topic_camera.hpp"
#include "drivers/gstreamer/pipeline_source.hpp"
#include "drivers/image/pixel_format.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/v4l2/camera_device.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/inputs/devices/can_imu_link.hpp"
#include "firmware_host/inputs/devices/input_topics.hpp"
#include "firmware_host/inputs/devices/port_imu_link.hpp"
#include "firmware_host/inputs/devices/status_json.hpp"
#include "firmware_host/inputs/devices/topic_imu_link.hpp"

namespace swiftlet {
namespace {

constexpr const char* kTriggerByImu = "imu";
constexpr const char* kAnyFormat = "any";
/// Longer than an IMU's samples take over any link, whose buffers hold at most 16 ms.
constexpr Duration kLinkPatience = Duration::fromMilliseconds(25);
/// Samples from topics pass through two other processes, scheduled at the kernel's discretion, and may wait
/// for a separate accelerometer.
constexpr Duration kTopicPatience = Duration::fromMilliseconds(60);

[[noreturn]] void failAt(const char* setting, const std::string& what, const std::string& remedy) {
  throw InputError("settings", 0, setting, what, remedy);
}

/// Whether autopilot.device names the IMU's port, so that both share one link.
bool sharesLink(const Settings& settings) {
  const std::string& device = settings.autopilot.device;
  if (device.empty() || !samePort(device, settings.imu_link.device)) return false;
  if (settings.imu_link.protocol != "mavlink") {
    failAt(
        "autopilot.device", device + " is the port of an IMU with the protocol " + settings.imu_link.protocol,
        "Set the autopilot's own port. Only an autopilot can share the link, with imu_link.protocol mavlink");
  }
  if (settings.imu_link.baud != settings.autopilot.baud) {
    failAt("autopilot.baud",
           fmt::format("is {} baud and imu_link.baud is {}, but both use {}", settings.autopilot.baud,
                       settings.imu_link.baud, device),
           "Set both to the baud rate of that port");
  }
  return true;
}

std::unique_ptr<ImuLink> makeTopicLink(const Settings& settings, const InputTopics& topics, double rate) {
  if (!settings.imu_link.device.empty()) {
    failAt("imu_link.topic", "cannot be combined with imu_link.device", "Remove one of them");
  }
  if (topics.imu.empty()) {
    failAt("imu_link.accel_topic", "is set without a topic for the gyroscope",
           "Set imu_link.topic to the gyroscope's topic; a topic with both sensors needs no accel_topic");
  }
  TopicImuSettings link;
  link.network = inputNetwork(settings);
  link.topic = topics.imu;
  link.accel_topic = topics.accel;
  link.rate = rate;
  return std::make_unique<TopicImuLink>(std::move(link));
}

std::unique_ptr<ImuLink> makeImuLink(const ImuLinkGroup& settings, double rate, LinkOutbox* outbox) {
  if (settings.protocol == "dronecan") return std::make_unique<CanImuLink>(settings);
  if (settings.protocol != "mavlink" && udpAddress(settings.device, "imu_link.device")) {
    failAt("imu_link.device", settings.protocol + " needs a serial port",
           "Set the serial port, or set imu_link.protocol to mavlink for an autopilot on UDP");
  }
  return std::make_unique<PortImuLink>(settings, rate, outbox);
}

/// The IMU's input named by trigger.line; empty: all inputs.
std::optional<std::uint8_t> imuLine(const std::string& text) {
  if (text.empty()) return std::nullopt;
  std::uint8_t line = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), line);
  if (error != std::errc{} || end != text.data() + text.size()) {
    failAt("trigger.line", text + " is not an input of an IMU",
           "Set the input's number, or leave it empty for all inputs");
  }
  return line;
}

/// Origin of a camera, as named in the settings.
struct CameraOrigin {
  const char* device_key;
  const char* pipeline_key;
  const char* topic_key;
  const std::string& device;
  const std::string& pipeline;
  const std::string& topic;

  [[nodiscard]] bool named() const { return !device.empty() || !pipeline.empty() || !topic.empty(); }
  /// The setting that names the origin.
  [[nodiscard]] const char* key() const {
    if (!topic.empty()) return topic_key;
    return pipeline.empty() ? device_key : pipeline_key;
  }
  /// For messages: the origin's name; a long pipeline is cut.
  [[nodiscard]] std::string name() const {
    constexpr std::size_t kMost = 40;
    if (!topic.empty()) return topic;
    if (pipeline.size() <= kMost) return pipeline.empty() ? device : pipeline;
    return pipeline.substr(0, kMost) + "...";
  }
};

CameraOrigin originOf(const CamerasGroup& group, const InputTopics& topics, std::size_t index) {
  if (index == 0) {
    return {"cameras.device0", "cameras.pipeline0", "cameras.topic0",
            group.device0,     group.pipeline0,     topics.camera[0]};
  }
  return {"cameras.device1", "cameras.pipeline1", "cameras.topic1",
          group.device1,     group.pipeline1,     topics.camera[1]};
}

CameraDeviceSettings deviceSettings(const Settings& settings, const std::string& path, int width,
                                    int height) {
  const CamerasGroup& group = settings.cameras;
  CameraDeviceSettings device;
  device.setPath(path.c_str());
  if (group.format != kAnyFormat) device.setFormat(group.format.c_str());
  device.width = width;
  device.height = height;
  device.rate = group.rate_hz;
  device.triggered = !settings.trigger.chip.empty();
  if (group.exposure_ms > 0) device.exposure = Duration::fromSeconds(group.exposure_ms * kFromMs);
  if (group.gain >= 0) device.gain = group.gain;
  return device;
}

std::unique_ptr<CameraSource> makeSource(const Settings& settings, const CameraOrigin& origin, int width,
                                         int height) {
  const CamerasGroup& group = settings.cameras;
  if (!origin.device.empty()) {
    return std::make_unique<CameraDevice>(deviceSettings(settings, origin.device, width, height));
  }
  std::optional<Duration> exposure;
  if (group.exposure_ms > 0) exposure = Duration::fromSeconds(group.exposure_ms * kFromMs);
  if (!origin.topic.empty()) {
    TopicCameraSettings camera;
    camera.network = inputNetwork(settings);
    camera.topic = origin.topic;
    camera.width = width;
    camera.height = height;
    camera.rate = group.rate_hz;
    camera.exposure = exposure;
    return std::make_unique<TopicCamera>(std::move(camera));
  }
  return std::make_unique<PipelineSource>(
      PipelineSettings{origin.pipeline, width, height, group.rate_hz, exposure});
}

/// Both cameras come from device0 or pipeline0: side by side in one image, or in alternating pixels.
bool twoInOne(const CamerasGroup& group) {
  const std::optional<PixelFormat> format = pixelFormat(group.format);
  return group.side_by_side || (format && format->layout == PixelLayout::kPairs);
}

/// Requires one origin per camera, and no setting that does not apply to it.
void checkOrigins(const CamerasGroup& group, const InputTopics& topics) {
  bool any_device = false;
  for (std::size_t i = 0; i < kMaxCameras; ++i) {
    const CameraOrigin origin = originOf(group, topics, i);
    any_device = any_device || !origin.device.empty();
    const int origins = static_cast<int>(!origin.device.empty()) +
                        static_cast<int>(!origin.pipeline.empty()) + static_cast<int>(!origin.topic.empty());
    if (origins < 2) continue;
    failAt(origin.key(),
           fmt::format("cannot be combined with {}",
                       origin.device.empty() ? origin.pipeline_key : origin.device_key),
           "Remove one of them");
  }
  if (!originOf(group, topics, 0).named()) {
    failAt("cameras.device0", "no camera is set",
           "Set its video node (`swiftlet doctor` lists them), a pipeline in cameras.pipeline0, or a topic "
           "in cameras.topic0");
  }
  if (any_device) return;
  if (group.format != kAnyFormat) {
    failAt(
        "cameras.format", "applies only to video nodes, and none is set",
        "Set the format in the pipeline, for example `! video/x-raw,format=NV12`; topics carry their format");
  }
  if (group.gain >= 0) {
    failAt("cameras.gain", "applies only to video nodes, and none is set",
           "Set the gain in the pipeline's source element or in the topic's driver");
  }
}

void checkCameras(const CamerasGroup& group, const InputTopics& topics, const Rig& rig) {
  checkOrigins(group, topics);
  if (group.format != kAnyFormat && !pixelFormat(group.format)) {
    failAt("cameras.format", group.format + " is not a supported format",
           "See docs/v4l2.md for the supported formats; `any` uses the first that the camera offers");
  }
  const bool two_in_one = twoInOne(group);
  const CameraOrigin other = originOf(group, topics, 1);
  const bool second = two_in_one || other.named();
  if (rig.camera_count == 2 && !second) {
    failAt("cameras.device1", "the calibration has two cameras, the settings have one",
           "Set the second camera's video node, pipeline or topic, or cameras.side_by_side if one image "
           "holds both cameras");
  }
  if (rig.camera_count == 1 && second) {
    failAt("vehicle.calibration", "the settings have two cameras, the calibration has one",
           fmt::format("Calibrate both, or remove {}", other.named() ? other.key() : "cameras.side_by_side"));
  }
  if (!two_in_one && !group.device1.empty() && group.device0 == group.device1) {
    failAt("cameras.device1", "is the same video node as cameras.device0",
           "Set the other camera's node; set cameras.side_by_side if one node delivers both cameras");
  }
  if (two_in_one && other.named()) {
    failAt(other.key(), "is set, but one image already holds both cameras",
           group.side_by_side ? "Remove it or cameras.side_by_side"
                              : "Remove it, or choose another cameras.format");
  }
  if (two_in_one &&
      (rig.camera[0].width() != rig.camera[1].width() || rig.camera[0].height() != rig.camera[1].height())) {
    failAt("cameras.device0",
           "delivers two cameras of the same size, but the calibration has two different sizes",
           "Give the calibration of these cameras");
  }
}

}  // namespace

std::size_t namedCameras(const Settings& settings) {
  const InputTopics topics = inputTopics(settings, kMaxCameras);
  const bool second = twoInOne(settings.cameras) || originOf(settings.cameras, topics, 1).named();
  return second ? 2 : 1;
}

LiveInput::LiveInput(const Settings& settings, const Calibration& calibration) {
  const InputTopics topics = inputTopics(settings, calibration.rig.camera_count);
  const bool imu_topics = !topics.imu.empty() || !topics.accel.empty();
  topics_ = topics.any();
  if (settings.imu_link.device.empty() && !imu_topics) {
    failAt(
        "imu_link.device", "no IMU is set",
        "Set its serial port or CAN interface (`swiftlet doctor` lists them), or a topic in imu_link.topic");
  }
  if (settings.trigger.chip == kTriggerByImu && (imu_topics || settings.imu_link.protocol == "dronecan")) {
    failAt("trigger.chip",
           imu_topics ? "ROS 2 topics do not carry trigger edges" : "dronecan does not carry trigger edges",
           "Set the GPIO chip that receives the trigger, or remove trigger.chip");
  }
  const Rig& rig = calibration.rig;
  CamerasGroup cameras = settings.cameras;
  if (rig.rolls()) {
    cameras.shutter = kRolling;
    cameras.readout_ms = rig.readout.seconds() / kFromMs;
  }
  checkCameras(cameras, topics, rig);
  // Configuring a sensor disables its other outputs, edges included.
  const bool keeps_edges = settings.trigger.chip == kTriggerByImu && settings.imu_link.protocol != "mavlink";
  const double asked_rate = keeps_edges ? 0 : calibration.noise.rate_hz;
  if (sharesLink(settings)) outbox_ = std::make_unique<LinkOutbox>();
  imu_ = std::make_unique<ImuThread>(
      imu_topics ? fmt::format("IMU ({})", topics.imu)
                 : fmt::format("IMU ({}, {})", settings.imu_link.device, settings.imu_link.protocol),
      imu_topics ? makeTopicLink(settings, topics, calibration.noise.rate_hz)
                 : makeImuLink(settings.imu_link, asked_rate, outbox_.get()),
      calibration.imuCorrection(), Duration::fromSeconds(settings.imu_link.delay_ms * kFromMs),
      calibration.noise.rate_hz);
  const std::size_t nodes = twoInOne(cameras) ? 1 : rig.camera_count;
  for (std::size_t i = 0; i < nodes; ++i) {
    const CameraOrigin origin = originOf(cameras, topics, i);
    CameraThread::Setup setup;
    setup.name = fmt::format("camera {} ({})", nodes < rig.camera_count ? "0 and 1" : std::to_string(i),
                             origin.name());
    const int halves = cameras.side_by_side ? 2 : 1;
    setup.first = static_cast<std::uint32_t>(i);
    setup.settings = cameras;
    if (!settings.trigger.chip.empty()) setup.trigger = settings.trigger;
    if (cameras.exposure_control) {
      setup.exposure = {i == 0, rig.camera[i].focal(), Duration::fromSeconds(1 / cameras.rate_hz), &asked_,
                        &imu_->turnRate()};
    }
    cameras_.push_back(std::make_unique<CameraThread>(
        setup, makeSource(settings, origin, halves * rig.camera[i].width(), rig.camera[i].height())));
    edge_rings_.push_back(&cameras_.back()->edges());
  }
  if (settings.trigger.chip == kTriggerByImu) {
    imu_edges_ = {edge_rings_, settings.trigger.edge == "rising", imuLine(settings.trigger.line)};
  } else if (!settings.trigger.chip.empty()) {
    trigger_ = std::make_unique<TriggerThread>(settings.trigger, cameras.rate_hz);
  }
}

LiveInput::~LiveInput() = default;

LiveInput::Opened LiveInput::open() {
  Opened opened;
  const auto note = [&](const DeviceFault& fault, const DeviceJournal& journal) {
    if (!fault.ok()) opened.faults.push_back(describe(fault, journal.name()));
  };
  note(imu_->open(), imu_->journal());
  for (const DeviceFault& warning : imu_->warnings()) {
    opened.warnings.push_back(describe(warning, imu_->journal().name()));
  }
  for (const auto& camera : cameras_) {
    note(camera->open(), camera->journal());
    for (const DeviceFault& warning : camera->warnings()) {
      opened.warnings.push_back(describe(warning, camera->journal().name()));
    }
    if (const std::string warning = camera->triggerWarning(); !warning.empty()) {
      opened.warnings.push_back(camera->journal().name() + ": " + warning);
    }
  }
  if (trigger_) note(trigger_->open(), trigger_->journal());
  return opened;
}

std::vector<SensorInput::Thread> LiveInput::threads(SensorSink& sink, const RunControl& control) {
  static constexpr std::array<const char*, kMaxCameras> kCameraThreads = {"camera0", "camera1"};
  std::vector<Thread> threads;
  threads.push_back({"imu", imu_->level(), [this, &sink, &control] { imu_->run(sink, imu_edges_, control); },
                     &imu_->heart()});
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    threads.push_back({kCameraThreads[i], cameras_[i]->level(),
                       [this, i, &sink, &control] { cameras_[i]->run(sink, control); },
                       &cameras_[i]->heart()});
  }
  if (trigger_) {
    threads.push_back({"trigger", Level::kSensor, [this, &control] { trigger_->run(edge_rings_, control); },
                       &trigger_->heart()});
  }
  return threads;
}

Duration LiveInput::samplePatience() const { return topics_ ? kTopicPatience : kLinkPatience; }

void LiveInput::look(FlightFacts& facts) const {
  if (trigger_) {
    const TriggerStatus status = trigger_->status();
    facts.trigger = {status.edges, 0, status.heard, status.heard};
  } else if (hasTrigger()) {
    const ImuStatus status = imu_->status();
    facts.trigger = {status.edges, 0, status.edge, status.edge};
  }
  for (std::size_t i = 0; i < cameras_.size(); ++i) facts.off_trigger[i] = cameras_[i]->status().off_trigger;
}

std::uint64_t LiveInput::taken() const {
  std::uint64_t images = 0;
  for (const auto& camera : cameras_) images += camera->taken();
  return images;
}

std::vector<DeviceJournal*> LiveInput::journals() {
  std::vector<DeviceJournal*> all = {&imu_->journal()};
  for (const auto& camera : cameras_) all.push_back(&camera->journal());
  if (trigger_) all.push_back(&trigger_->journal());
  return all;
}

bool LiveInput::drainEvents(const std::function<void(Stamp, const std::string&)>& take) {
  bool any = false;
  DeviceEvent event;
  for (DeviceJournal* journal : journals()) {
    while (journal->next(event)) {
      take(event.stamp, journal->text(event));
      any = true;
    }
  }
  return any;
}

nlohmann::ordered_json LiveInput::counters() {
  nlohmann::ordered_json json;
  json["imu"] = toJson(imu_->status());
  json["imu"]["link"] = imu_->link().counters();
  for (std::size_t i = 0; i < cameras_.size(); ++i)
    json[fmt::format("camera{}", i)] = toJson(cameras_[i]->status());
  if (trigger_) json["trigger"] = toJson(trigger_->status());
  for (const DeviceJournal* journal : journals()) {
    json["faults"][journal->name()] = journal->faults();
    if (journal->lost() > 0) json["lines_lost"][journal->name()] = journal->lost();
  }
  return json;
}

}  // namespace swiftlet
