#pragma once
// The IMU's thread at work for a test: where its samples go, and what it said.

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "firmware_host/inputs/devices/imu_thread.hpp"

namespace swiftlet::test {

/// Keeps what comes, for another thread to look at meanwhile.
class KeepingSink : public SensorSink {
 public:
  struct Kept {
    ImuSample sample;
    Stamp arrival;
  };

  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& /*host*/) override {
    const std::size_t n = count_.load(std::memory_order_relaxed);
    if (n == kept_.size()) return;
    kept_[n] = {sample, arrival};
    count_.store(n + 1, std::memory_order_release);
  }
  void takeScene(const SceneImages& /*scene*/) override {}
  void takeImage(const CameraFrame& /*image*/, const HostTimes& /*host*/) override {}

  [[nodiscard]] std::size_t count() const { return count_.load(std::memory_order_acquire); }
  [[nodiscard]] const Kept& operator[](std::size_t i) const { return kept_.at(i); }

 private:
  std::vector<Kept> kept_ = std::vector<Kept>(10'000);
  std::atomic<std::size_t> count_{0};
};

/// Runs the thread until it goes.
class RunningImu {
 public:
  RunningImu(ImuThread& imu, SensorSink& sink) : imu_(imu) {
    control_.stop = &stop_;
    thread_ = std::thread([this, &sink] { imu_.run(sink, {}, control_); });
  }
  ~RunningImu() { end(); }
  void end() {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }

  /// What the journal said so far, a line each; every call adds what came since.
  const std::vector<std::string>& lines() {
    DeviceEvent event;
    while (imu_.journal().next(event)) lines_.push_back(imu_.journal().text(event));
    return lines_;
  }
  std::size_t linesWith(const std::string& part) {
    std::size_t count = 0;
    for (const std::string& line : lines()) count += line.find(part) != std::string::npos ? 1 : 0;
    return count;
  }

 private:
  ImuThread& imu_;
  std::atomic<bool> stop_{false};
  RunControl control_;
  std::vector<std::string> lines_;
  std::thread thread_;
};

/// Waits until it is so, a machine under load and a sanitizer included; false: it never was.
inline bool soon(const std::function<bool()>& is_so) {
  for (int i = 0; i < 5000 && !is_so(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  return is_so();
}

}  // namespace swiftlet::test
