#include "firmware_host/runs/record_run.hpp"

#include <memory>

#include "firmware_host/inputs/devices/live_input.hpp"
#include "firmware_host/inputs/devices/sensor_threads.hpp"
#include "firmware_host/outputs/recorder/folder_sink.hpp"
#include "firmware_host/outputs/recorder/mcap_sink.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "firmware_host/runs/vehicle_calibration.hpp"

namespace swiftlet {
namespace {

std::unique_ptr<RecordSink> makeSink(const RecordRequest& request, const Calibration& calibration,
                                     const Settings& settings) {
  if (request.mcap) return std::make_unique<McapSink>(request.out, calibration);
  return std::make_unique<FolderSink>(request.out, calibration, settings.cameras.rate_hz);
}

// Passes everything to the recording and to the watcher.
class WatchedSink final : public SensorSink {
 public:
  WatchedSink(RecordSink& record, RecordWatcher* watcher) : record_(record), watcher_(watcher) {}

  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) override {
    record_.takeImu(sample, arrival, host);
    if (watcher_ != nullptr) watcher_->takeImu(sample);
  }
  void takeScene(const SceneImages& scene) override { record_.takeScene(scene); }
  void takeImage(const CameraFrame& image, const HostTimes& host) override {
    record_.takeImage(image, host);
    if (watcher_ != nullptr) watcher_->takeImage(image);
  }
  void expectEnd() override { record_.expectEnd(); }

 private:
  RecordSink& record_;
  RecordWatcher* watcher_;
};

}  // namespace

RecordResult runRecord(const RecordRequest& request, const Settings& settings) {
  const Calibration calibration = calibratedOrBareRig(settings);
  LiveInput input(settings, calibration);
  for (const std::string& line : calibration.warnings) warn("warning: " + line + "\n");
  LiveInput::Opened opened = input.open();
  for (const std::string& line : opened.warnings) warn("warning: " + line + "\n");
  RecordResult result;
  result.cameras = calibration.rig.camera_count;
  if (!opened.faults.empty()) {
    result.missing = std::move(opened.faults);
    return result;
  }
  const auto made = makeSink(request, calibration, settings);
  RecordSink& sink = *made;
  WatchedSink watched(sink, request.watcher);
  if (request.watcher != nullptr) request.watcher->begin(calibration);
  SensorThreads threads(input, watched, settings.realtime);
  for (const std::string& line : threads.warnings()) warn("warning: " + line + "\n");
  const auto print = [&input] {
    input.drainEvents([](Stamp /*stamp*/, const std::string& line) { warn(line + "\n"); });
  };
  const double begin = wallSeconds();
  constexpr Duration kPeriod = Duration::fromMilliseconds(50);
  while (!sink.failed() && !(request.stop != nullptr && request.stop->load(std::memory_order_relaxed)) &&
         !(request.seconds > 0 && wallSeconds() - begin > request.seconds)) {
    print();
    if (request.watcher != nullptr && !request.watcher->goOn()) break;
    sleepFor(kPeriod);
  }
  threads.join();
  if (request.watcher != nullptr) request.watcher->end();
  print();
  sink.finish();
  result.written = sink.counters();
  return result;
}

}  // namespace swiftlet
