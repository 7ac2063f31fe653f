// Cameras and IMU behind topics of another implementation's process: nothing torn, each loss counted,
// malformed messages and wrong clocks named. SWIFTLET_DDS_SECONDS: how long the first case takes (2).

#include <poll.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "drivers/dds/topic_camera.hpp"
#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/inputs/devices/topic_imu_link.hpp"
#include "tests/drivers/dds/peer_process.hpp"
#include "tests/drivers/dds/test_topics.hpp"

namespace swiftlet {
namespace {

using test::ownDomain;

constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr double kRate = 30;

class DriverProcess : public test::PeerProcess {
 public:
  explicit DriverProcess(std::vector<std::string> arguments)
      : PeerProcess(SWIFTLET_DDS_DRIVER, withDomain(std::move(arguments))) {}

  struct Count {
    std::uint64_t sent = 0, withheld = 0, twice = 0;
  };
  /// Of camera 0, camera 1 and the IMU.
  std::array<Count, 3> counts() {
    const std::string text = said_ + finish();
    std::array<Count, 3> all{};
    const std::size_t at = text.find("driver ");
    REQUIRE(at != std::string::npos);
    std::istringstream words(text.substr(at + 7));
    for (Count& count : all) REQUIRE(words >> count.sent >> count.withheld >> count.twice);
    return all;
  }
  bool ended() {
    said_ += poll();
    return said_.find("ended") != std::string::npos;
  }

 private:
  static std::vector<std::string> withDomain(std::vector<std::string> arguments) {
    arguments.push_back("domain=" + std::to_string(ownDomain()));
    return arguments;
  }
  std::string said_;
};

DdsNetwork network() {
  DdsNetwork network;
  network.domain = ownDomain();
  return network;
}
TopicCameraSettings cameraSettings(const std::string& topic) {
  TopicCameraSettings settings;
  settings.network = network();
  settings.topic = topic;
  settings.width = kWidth;
  settings.height = kHeight;
  settings.rate = kRate;
  // On a busy machine the driver's process takes long to begin.
  settings.patience = Duration::fromMilliseconds(8000);
  return settings;
}
TopicImuSettings imuSettings(const std::string& topic) {
  TopicImuSettings settings;
  settings.network = network();
  settings.topic = topic;
  settings.rate = test::kMadeUpImuRate;
  settings.patience = Duration::fromMilliseconds(8000);
  return settings;
}

/// What came out of one camera.
struct Seen {
  std::uint64_t images = 0;  ///< from the first that counts
  std::uint64_t torn = 0, disordered = 0, late_stamps = 0;
  std::uint64_t newest = 0;
  double latency = 0;  ///< s, sum
};

void look(CapturedFrame& frame, std::size_t camera, Seen& seen) {
  static std::vector<std::uint8_t> expected(static_cast<std::size_t>(kWidth) * kHeight);
  std::uint64_t pattern = 0;
  std::memcpy(&pattern, frame.image.data, sizeof(pattern));
  if (pattern <= seen.newest) ++seen.disordered;
  seen.newest = pattern;
  test::fillPattern(expected, pattern);
  if (pattern % 2 != camera || std::memcmp(frame.image.data, expected.data(), expected.size()) != 0)
    ++seen.torn;
  seen.latency += (frame.arrival - frame.stamp).seconds();
  if (frame.stamp > frame.arrival) ++seen.late_stamps;
  if (pattern >= test::patternOf(camera, 0)) ++seen.images;
}

TEST_CASE("nothing is torn, and each message that is lost is counted") {
  const char* asked = std::getenv("SWIFTLET_DDS_SECONDS");
  const std::string seconds = asked != nullptr ? asked : "2";
  DriverProcess driver({"seconds=" + seconds, "lead=1", "lose=17", "twice=13"});
  std::array<TopicCamera, 2> cameras = {TopicCamera(cameraSettings(test::kTopicCameras[0])),
                                        TopicCamera(cameraSettings(test::kTopicCameras[1]))};
  TopicImuLink imu(imuSettings(test::kTopicImu));
  REQUIRE(imu.open().ok());
  for (TopicCamera& camera : cameras) REQUIRE(camera.open().ok());
  std::array<Seen, 2> seen;
  std::uint64_t samples = 0, bad_samples = 0, at_rest = 0;
  while (!driver.ended()) {
    std::array<pollfd, 3> waiting = {
        {{cameras[0].fd(), POLLIN, 0}, {cameras[1].fd(), POLLIN, 0}, {imu.fd(), POLLIN, 0}}};
    ::poll(waiting.data(), waiting.size(), 10);
    for (std::size_t i = 0; i < 2; ++i) {
      for (;;) {
        CapturedFrame frame;
        REQUIRE(cameras[i].next(frame).ok());
        if (!frame.valid()) break;
        look(frame, i, seen[i]);
      }
    }
    REQUIRE(imu.receive(monotonicNow()).ok());
    for (ImuReading reading; imu.next(reading);) {
      const double n = std::round(reading.gyro.x() * 1e6);
      const Eigen::Vector3d gyro = test::madeUpGyro(static_cast<std::uint64_t>(n));
      const bool whole = (reading.gyro - gyro).norm() < 1e-12 &&
                         (reading.accel - gyro - Eigen::Vector3d(0, 0, test::kMadeUpGravity)).norm() < 1e-12;
      if (!whole) ++bad_samples;
      // Sample 0 also stands for the rest before.
      ++(n == 0 ? at_rest : samples);
    }
  }
  const auto told = driver.counts();
  for (std::size_t i = 0; i < 2; ++i) {
    const CameraCounters& c = cameras[i].counters();
    const auto [sent, withheld, twice] = told[i];
    std::cout << "dds_topics: camera " << i << ": " << sent << " sent, " << withheld << " withheld; "
              << seen[i].images << " taken, " << c.missed << " missed, " << seen[i].torn << " torn, "
              << c.lost << " lost by DDS, " << c.overrun << " overrun, " << c.stale << " stale, latency "
              << 1e3 * seen[i].latency / static_cast<double>(c.frames) << " ms\n";
    CHECK(seen[i].torn == 0);
    CHECK(seen[i].disordered == 0);
    CHECK(seen[i].late_stamps == 0);
    CHECK(withheld > 0);
    // Whatever the kernel lost: each one is counted.
    CHECK(c.missed == withheld + (sent - seen[i].images));
    CHECK(seen[i].images * 100 >= sent * 99);
    // Of two equal ones the kernel may have lost one.
    CHECK(c.stale <= twice);
    CHECK(c.stale + c.lost + c.overrun >= twice);
    CHECK(c.damaged + c.too_short + c.wrong_clock == 0);
  }
  const nlohmann::ordered_json link = imu.counters();
  std::cout << "dds_topics: IMU: " << told[2].sent << " sent, " << told[2].withheld << " withheld; "
            << samples << " taken, " << link.dump() << '\n';
  CHECK(bad_samples == 0);
  CHECK(at_rest > 0);
  CHECK(link.at("missing_samples") == told[2].withheld + (told[2].sent - 1 - samples));
  CHECK(link.at("stale") <= told[2].twice);
  CHECK(samples * 100 >= told[2].sent * 99);
}

TEST_CASE("malformed messages are counted and cost nothing else") {
  DriverProcess driver({"seconds=1.5", "lead=0", "images=bad"});
  TopicCamera camera(cameraSettings(test::kTopicCameras[0]));
  TopicCamera second(cameraSettings(test::kTopicCameras[1]));
  TopicImuLink imu(imuSettings(test::kTopicImu));
  REQUIRE(imu.open().ok());
  REQUIRE(camera.open().ok());
  REQUIRE(second.open().ok());
  Seen seen;
  while (!driver.ended()) {
    pollfd waiting{camera.fd(), POLLIN, 0};
    ::poll(&waiting, 1, 5);
    for (;;) {
      CapturedFrame frame;
      REQUIRE(camera.next(frame).ok());
      if (!frame.valid()) break;
      look(frame, 0, seen);
    }
    REQUIRE(imu.receive(monotonicNow()).ok());
    for (ImuReading reading; imu.next(reading);) CHECK(reading.gyro.allFinite());
  }
  const CameraCounters& c = camera.counters();
  std::cout << "dds_topics: " << seen.images << " sound, " << c.damaged << " damaged, " << c.too_short
            << " too short\n";
  CHECK(seen.torn == 0);
  CHECK(seen.images >= 15);
  CHECK(c.damaged >= 12);
  CHECK(c.too_short >= 3);
  CHECK(imu.counters().at("damaged") > 100);
}

TEST_CASE("what is wrong with a topic is said by name") {
  DriverProcess driver({"seconds=1", "ahead=5"});
  const auto refusal = [](TopicCamera& camera) {
    const DeviceFault fault = camera.open();
    CHECK_FALSE(camera.isOpen());
    std::cout << "dds_topics: " << describe(fault, "camera 0") << '\n';
    return fault;
  };
  TopicCamera of_the_future(cameraSettings(test::kTopicCameras[0]));
  DeviceFault fault = refusal(of_the_future);
  CHECK(fault.kind == DeviceFaultKind::kWrongClock);
  CHECK_THAT(std::string(fault.text()),
             Catch::Contains("stamps are -4.9") || Catch::Contains("stamps are -5.0"));
  TopicImuLink imu(imuSettings(test::kTopicImu));
  CHECK(imu.open().kind == DeviceFaultKind::kWrongClock);
  CHECK_FALSE(imu.isOpen());

  // What there is has been heard by now.
  const auto impatient = [](const std::string& topic) {
    TopicCameraSettings settings = cameraSettings(topic);
    settings.patience = Duration::fromMilliseconds(500);
    return settings;
  };
  TopicCamera misnamed(impatient("/camera/infra1/image_rect_raw"));
  fault = refusal(misnamed);
  CHECK(fault.kind == DeviceFaultKind::kMissing);
  CHECK_THAT(std::string(fault.text()), Catch::Contains("near: /camera/camera/infra1/image_rect_raw"));
  TopicCamera mistyped(impatient(test::kTopicImu));
  fault = refusal(mistyped);
  CHECK_THAT(std::string(fault.text()), Catch::Contains("is a sensor_msgs/msg/Imu"));
  TopicCamera unrooted(cameraSettings("camera/image"));
  CHECK_THAT(std::string(refusal(unrooted).text()), Catch::Contains("starts with /"));
  TopicCameraSettings elsewhere = cameraSettings(test::kTopicCameras[0]);
  elsewhere.network.domain = 231;
  elsewhere.network.interface = "nosuch0";
  TopicCamera nowhere(elsewhere);
  CHECK_THAT(std::string(refusal(nowhere).text()), Catch::Contains("nosuch0"));
}

TEST_CASE("a camera of another size is refused, and the wall clock may be set in flight") {
  DriverProcess driver({"seconds=2", "lead=0"});
  TopicCameraSettings small = cameraSettings(test::kTopicCameras[1]);
  small.width = 320;
  TopicCamera smaller(small);
  const DeviceFault fault = smaller.open();
  std::cout << "dds_topics: " << describe(fault, "camera 1") << '\n';
  CHECK_THAT(std::string(fault.text()), Catch::Contains("640x480, but the calibration is for 320x480"));

  // Its driver does not follow the step.
  bool stepped = false;
  TopicCameraSettings settings = cameraSettings(test::kTopicCameras[0]);
  settings.read_clocks = [&stepped] {
    HostClocks now = readHostClocks();
    if (stepped) now.realtime_ahead = now.realtime_ahead + Duration::fromMilliseconds(-100'000);
    return now;
  };
  TopicCamera camera(settings);
  REQUIRE(camera.open().ok());
  TopicImuLink imu(imuSettings(test::kTopicImu));
  REQUIRE(imu.open().ok());
  std::uint64_t images = 0;
  while (!driver.ended()) {
    pollfd waiting{camera.fd(), POLLIN, 0};
    ::poll(&waiting, 1, 5);
    for (;;) {
      CapturedFrame frame;
      REQUIRE(camera.next(frame).ok());
      if (!frame.valid()) break;
      ++images;
      const double age = (frame.arrival - frame.stamp).seconds();
      CHECK((age > 0 && age < 0.5));
    }
    stepped = images > 20;
  }
  DeviceFault remark;
  REQUIRE(camera.nextRemark(remark));
  CHECK(remark.kind == DeviceFaultKind::kClockSet);
  CHECK_THAT(std::string(remark.text()), Catch::Contains("-100.000 s"));
  CHECK(images > 40);
  CHECK(camera.counters().wrong_clock == 0);
}

}  // namespace
}  // namespace swiftlet
