// Exposure control on camera threads: sources that take each request two images later, in a room whose light
// changes; whether stamps stay in the middle of the exposure, and whether two cameras are set alike.

#include <sys/eventfd.h>
#include <unistd.h>
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <deque>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "drivers/device/monotonic_now.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/inputs/devices/camera_thread.hpp"

namespace swiftlet {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr Duration kFramePeriod = Duration::fromMilliseconds(50);
const ExposureSetting kStart{Duration::fromMilliseconds(4), 1};
/// White in the room at which kStart is right: the scene is grey 102.
constexpr double kRight = 102 / 0.004;

/// Gives an image whenever it is asked for one and one is due.
class RoomCamera : public CameraSource {
 public:
  explicit RoomCamera(std::uint64_t images) : left_(images) {
    waiting_.assign(ExposureControl::kActingDelay, kStart);
  }
  ~RoomCamera() override { ::close(fd_); }

  std::function<double(std::uint64_t)> light = [](std::uint64_t) { return kRight; };
  std::vector<ExposureSetting> in_force;  ///< of each image
  int opened = 0;
  bool able = true;

  DeviceFault open() override {
    open_ = true;
    ++opened;
    facts_ = {};
    facts_.width = facts_.stride = kWidth;
    facts_.height = kHeight;
    facts_.exposure = kStart.exposure;
    facts_.event = StampEvent::kStartOfExposure;
    return {};
  }
  void close() override {
    open_ = false;
    forgetLent();
  }
  [[nodiscard]] bool isOpen() const override { return open_; }
  [[nodiscard]] int fd() const override { return fd_; }

  DeviceFault next(CapturedFrame& frame) override {
    frame.release();
    if (left_ == 0) return {};
    --left_;
    const ExposureSetting setting = waiting_.front();
    waiting_.pop_front();
    // Unless a request comes: as it is.
    waiting_.push_back(waiting_.empty() ? setting : waiting_.back());
    in_force.push_back(setting);
    const double grey = light(number_) * setting.exposure.seconds() * setting.gain;
    for (std::uint8_t& pixel : pixels_) {
      pixel = static_cast<std::uint8_t>(std::clamp(grey + random_.normal(), 0.0, 255.0));
    }
    frame.image = {pixels_.data(), kWidth, kHeight, kWidth};
    frame.event = StampEvent::kStartOfExposure;
    frame.stamp = startOf(number_);
    frame.arrival = frame.stamp + kFramePeriod;
    frame.sequence = number_++;
    lend(frame, 0);
    return {};
  }

  [[nodiscard]] std::optional<ExposureAbility> exposureAbility() const override {
    if (!able) return std::nullopt;
    return ExposureAbility{{Duration{20'000}, Duration::fromMilliseconds(40), 16}, kStart};
  }
  DeviceFault setExposure(const ExposureSetting& setting) override {
    waiting_.back() = setting;
    return {};
  }
  void more(std::uint64_t images) { left_ += images; }

  static Stamp startOf(std::uint64_t number) {
    return {static_cast<std::int64_t>(number + 1) * kFramePeriod.ns};
  }

 protected:
  void giveBack(std::uint32_t /*buffer*/) override {}

 private:
  bool open_ = false;
  int fd_ = ::eventfd(1, EFD_NONBLOCK);  // readable at once
  std::uint64_t left_;
  std::uint64_t number_ = 0;
  std::deque<ExposureSetting> waiting_;
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(kWidth * kHeight);
  Random random_{3, 1};
};

class StampSink : public SensorSink {
 public:
  void takeImu(const ImuSample& /*sample*/, Stamp /*arrival*/, const HostTimes& /*host*/) override {}
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& image, const HostTimes& /*host*/) override {
    stamps.push_back(image.stamp);
    numbers.push_back(image.sequence);
    count.store(stamps.size());
  }
  std::vector<Stamp> stamps;
  std::vector<std::uint64_t> numbers;
  std::atomic<std::size_t> count{0};
};

CameraThread::Setup setup(const std::optional<ExposureLoop::Setup>& exposure) {
  CameraThread::Setup result;
  result.name = "camera";
  result.settings.rate_hz = 1 / kFramePeriod.seconds();
  result.exposure = exposure;
  return result;
}

}  // namespace

TEST_CASE("stamps are in the middle of the exposure that was in force") {
  constexpr std::uint64_t kImages = 200;
  auto owned = std::make_unique<RoomCamera>(0);
  RoomCamera& camera = *owned;
  // A step, a ramp, and a flash that is white all over.
  camera.light = [](std::uint64_t k) {
    if (k >= 150) return 40 * kRight;
    return kRight * (k < 40 ? 1.0 : k < 100 ? 0.05 : 2.0);
  };
  SharedExposure asked;
  CameraThread thread(setup(ExposureLoop::Setup{true, 450, kFramePeriod, &asked, nullptr}), std::move(owned));
  REQUIRE(thread.open().ok());
  StampSink sink;
  std::atomic<bool> stop{false};
  RunControl control;
  control.stop = &stop;
  camera.more(kImages + 8);  // some go by before the flight
  std::thread flight([&] { thread.run(sink, control); });
  for (int i = 0; i < 5000 && thread.status().counters.frames < kImages; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  stop = true;
  flight.join();
  REQUIRE(sink.stamps.size() > kImages - 20);
  double shortest = 1;
  double longest = 0;
  for (std::size_t i = 0; i < sink.stamps.size(); ++i) {
    const std::uint64_t k = sink.numbers[i];
    const double exposure = camera.in_force.at(k).exposure.seconds();
    shortest = std::min(shortest, exposure);
    longest = std::max(longest, exposure);
    INFO("image " << k);
    CHECK(std::abs((sink.stamps[i] - RoomCamera::startOf(k)).seconds() - exposure / 2) < 2e-9);
  }
  // It has moved a lot, and it is right in the end although the flash was white all over.
  CHECK(longest > 2 * shortest);
  const ExposureSetting& last = camera.in_force.back();
  CHECK(40 * kRight * last.exposure.seconds() * last.gain == Approx(102).epsilon(0.15));
  CHECK(thread.status().asked.has_value());
}

TEST_CASE("a camera whose exposure cannot be set is refused when its control is asked for") {
  auto owned = std::make_unique<RoomCamera>(0);
  owned->able = false;
  SharedExposure asked;
  CameraThread thread(setup(ExposureLoop::Setup{true, 450, kFramePeriod, &asked, nullptr}), std::move(owned));
  const DeviceFault fault = thread.open();
  CHECK(fault.kind == DeviceFaultKind::kUnsupported);
  CHECK(fault.text().find("cameras.exposure_control") != std::string_view::npos);
  CHECK(!thread.facts().card[0]);
}

TEST_CASE("two cameras are set alike, and the second goes on when the first is silent") {
  SharedExposure asked;
  std::array<ExposureLoop, 2> loops = {ExposureLoop({true, 450, kFramePeriod, &asked, nullptr}),
                                       ExposureLoop({false, 450, kFramePeriod, &asked, nullptr})};
  std::array<RoomCamera, 2> cameras = {RoomCamera(1000), RoomCamera(1000)};
  for (std::size_t c = 0; c < 2; ++c) {
    REQUIRE(cameras[c].open().ok());
    REQUIRE(loops[c].begin(cameras[c]).ok());
  }
  double light = kRight;
  cameras[0].light = cameras[1].light = [&](std::uint64_t) { return light; };
  const auto step = [&](std::size_t c, std::uint64_t k) {
    CapturedFrame frame;
    REQUIRE(cameras[c].next(frame).ok());
    const ImageView view{frame.image.data, kWidth, kHeight, kWidth};
    CHECK(loops[c].inForce(k) == cameras[c].in_force[k]);
    REQUIRE(loops[c].step(k, view, frame.arrival, cameras[c]).ok());
  };
  std::uint64_t k = 0;
  for (; k < 80; ++k) {
    if (k == 20) light = kRight / 10;
    step(0, k);
    step(1, k);
    CHECK(loops[0].asked() == loops[1].asked());
    CHECK(cameras[0].in_force[k] == cameras[1].in_force[k]);
  }
  CHECK(loops[1].asked().exposure.seconds() * loops[1].asked().gain > 8 * kStart.exposure.seconds());
  // Camera 0 is gone: what was asked last stays for half a second, then camera 1 decides.
  light = kRight;
  const ExposureSetting last = loops[0].asked();
  for (int i = 0; i < 60; ++i, ++k) {
    step(1, k);
    if (i < 8) CHECK(loops[1].asked() == last);
  }
  const ExposureSetting& alone = loops[1].asked();
  CHECK(light * alone.exposure.seconds() * alone.gain == Approx(102).epsilon(0.12));
}

TEST_CASE("a turn bounds the exposure, and without an IMU a turn is supposed") {
  NewestShared<TurnRate> turn;
  SharedExposure asked;
  RoomCamera camera(1000);
  REQUIRE(camera.open().ok());
  ExposureLoop loop({true, 450, kFramePeriod, &asked, &turn});
  REQUIRE(loop.begin(camera).ok());
  camera.light = [](std::uint64_t) { return kRight / 4; };
  std::uint64_t k = 0;
  const auto exposure_after = [&](double rate) {
    for (int i = 0; i < 80; ++i, ++k) {
      CapturedFrame frame;
      REQUIRE(camera.next(frame).ok());
      if (rate > 0) turn.write({rate, frame.arrival});
      REQUIRE(loop.step(k, {frame.image.data, kWidth, kHeight, kWidth}, frame.arrival, camera).ok());
    }
    return loop.asked().exposure.seconds();
  };
  CHECK(exposure_after(3.0) == Approx(ExposureControl::kBlur / (450 * 3.0)).epsilon(0.01));
  CHECK(exposure_after(0.5) == Approx(ExposureControl::kBlur / (450 * 0.5)).epsilon(0.01));
  CHECK(exposure_after(0) == Approx(ExposureControl::kBlur / (450 * 1.0)).epsilon(0.01));
}

}  // namespace swiftlet
