#include "firmware_host/inspection/inspect_log.hpp"

#include <memory>
#include <optional>

#include "drivers/recorded/open_log.hpp"

namespace swiftlet {

InspectionReport inspectLog(const LogRequest& request, const Settings& settings, std::size_t most_images) {
  std::optional<Inspection> inspection;
  std::optional<Stamp> first;
  LogOptions options = request.options(settings);
  options.imu_after_last_image = true;
  options.wants_image = [&](Stamp stamp, std::uint32_t camera) {
    if (!first) first = stamp;
    const double seconds = (stamp - *first).seconds();
    if (seconds < request.from || seconds > request.until.value_or(seconds)) return false;
    return inspection->wants(stamp, camera);
  };
  const std::unique_ptr<LogSource> source = openLog(request.log, options);
  inspection.emplace(source->calibration(), most_images);
  SensorMessage message;
  while (!request.stopped() && !inspection->done() && source->next(message)) {
    if (const auto* sample = std::get_if<ImuSample>(&message)) {
      inspection->add(*sample);
    } else {
      inspection->add(std::get<CameraFrame>(message));
    }
  }
  InspectionReport report = inspection->report();
  report.warnings = source->warnings();
  return report;
}

}  // namespace swiftlet
