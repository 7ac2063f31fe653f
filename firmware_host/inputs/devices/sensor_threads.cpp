#include "firmware_host/inputs/devices/sensor_threads.hpp"

namespace swiftlet {

SensorThreads::SensorThreads(SensorInput& input, SensorSink& sink, const RealtimeGroup& realtime) {
  control_.stop = &stop_;
  for (const SensorInput::Thread& sensor : input.threads(sink, control_)) {
    ThreadSettings settings;
    settings.name = sensor.name;
    settings.priority = realtime.enabled ? realtime.sensor_priority : 0;
    settings.cpu = realtime.enabled ? realtime.sensor_cpu : -1;
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
