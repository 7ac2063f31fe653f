#include "firmware_host/inputs/devices/sensor_threads.hpp"

namespace swiftlet {

SensorThreads::SensorThreads(SensorInput& input, SensorSink& sink, const RealtimeGroup& realtime) {
  control_.stop = &stop_;
  for (const SensorInput::Thread& sensor : input.threads(sink, control_)) {
    ThreadSettings settings;
    settings.name = sensor.name;
    if (realtime.enabled) {
      const bool low = sensor.level != SensorInput::Level::kSensor;
      settings.priority = low ? realtime.low_priority : realtime.sensor_priority;
      settings.cpu = low ? realtime.low_cpu : realtime.sensor_cpu;
    }
    const ThreadReport report = threads_.at(started_++).start(settings, sensor.run);
    if (!report.message.empty()) warnings_.push_back("thread " + report.name + ": " + report.message);
  }
}

void SensorThreads::join() {
  stop_.store(true);
  for (std::size_t i = 0; i < started_; ++i) threads_.at(i).join();
  started_ = 0;
}

}  // namespace swiftlet
