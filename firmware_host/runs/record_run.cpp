#include "firmware_host/runs/record_run.hpp"

#include "firmware_host/inputs/devices/live_input.hpp"
#include "firmware_host/inputs/devices/sensor_threads.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/runs/fly_run.hpp"

namespace swiftlet {

RecordResult runRecord(const RecordRequest& request, const Settings& settings) {
  const Calibration calibration = vehicleCalibration(settings);
  LiveInput input(settings, calibration);
  LiveInput::Opened opened = input.open();
  for (const std::string& line : opened.warnings) warn("warning: " + line + "\n");
  RecordResult result;
  result.cameras = calibration.rig.camera_count;
  if (!opened.faults.empty()) {
    result.missing = std::move(opened.faults);
    return result;
  }
  FolderSink sink(request.out, calibration, settings.cameras.rate_hz);
  SensorThreads threads(input, sink, settings.realtime);
  for (const std::string& line : threads.warnings()) warn("warning: " + line + "\n");
  const auto print = [&input] {
    input.drainEvents([](Stamp /*stamp*/, const std::string& line) { warn(line + "\n"); });
  };
  const double begin = wallSeconds();
  constexpr Duration kPeriod = Duration::fromMilliseconds(50);
  while (!sink.failed() && !(request.stop != nullptr && request.stop->load(std::memory_order_relaxed)) &&
         !(request.seconds > 0 && wallSeconds() - begin > request.seconds)) {
    print();
    sleepFor(kPeriod);
  }
  threads.join();
  print();
  sink.finish();
  result.written = sink.counters();
  return result;
}

}  // namespace swiftlet
