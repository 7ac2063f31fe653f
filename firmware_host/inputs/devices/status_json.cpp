#include "firmware_host/inputs/devices/status_json.hpp"

#include <nlohmann/json.hpp>

#include "estimator/core/units.hpp"

namespace swiftlet {

using Json = nlohmann::ordered_json;

const char* lockName(LockState lock) {
  switch (lock) {
    case LockState::kUnlocked:
      return "unlocked";
    case LockState::kLocking:
      return "locking";
    case LockState::kLocked:
      return "locked";
  }
  return "unknown";
}

const char* stampEventName(StampEvent event) {
  switch (event) {
    case StampEvent::kStartOfExposure:
      return "of the start of exposure";
    case StampEvent::kEndOfExposure:
      return "of the end of exposure";
    case StampEvent::kEndOfFrame:
      return "of the end of the frame";
    case StampEvent::kArrival:
      return "of the arrival";
  }
  return "unknown";
}

Json toJson(const TimesyncStatus& status) {
  return {{"lock", lockName(status.lock)},
          {"offset_ns", status.offset.ns},
          {"skew_ppm", status.skew_ppm},
          {"uncertainty_ms", status.uncertainty.seconds() * kToMs},
          {"residual_p50_ms", status.residual_p50.seconds() * kToMs},
          {"residual_p99_ms", status.residual_p99.seconds() * kToMs},
          {"samples", status.samples},
          {"resets", status.resets},
          {"refused", status.refused}};
}

Json toJson(const ImuStatus& status) {
  return {{"samples", status.samples},         {"refused", status.refused},
          {"by_exchange", status.by_exchange}, {"by_arrival", status.by_arrival},
          {"by_driver", status.by_driver},     {"clock", toJson(status.clock)}};
}

Json toJson(const CameraStatus& status) {
  const CameraCounters& c = status.counters;
  Json json = {{"frames", c.frames},         {"missed", c.missed},           {"damaged", c.damaged},
               {"too_short", c.too_short},   {"stamp_ahead", c.stamp_ahead}, {"reopened", c.reopened},
               {"repeated", status.repeated}};
  if (c.stale + c.wrong_clock + c.lost + c.overrun > 0) {
    json["stale"] = c.stale;
    json["wrong_clock"] = c.wrong_clock;
    json["lost_on_the_way"] = c.lost;
    json["overrun"] = c.overrun;
  }
  if (status.asked) {
    json["exposure_ms"] = status.asked->exposure.seconds() * kToMs;
    json["gain"] = status.asked->gain;
  }
  if (status.trigger.samples + status.trigger.refused > 0) {
    json["by_trigger"] = status.by_trigger;
    json["by_lag"] = status.by_lag;
    json["trigger"] = toJson(status.trigger);
    json["trigger"]["missed_edges"] = status.trigger.missed_edges;
    json["trigger"]["glitch_edges"] = status.trigger.glitch_edges;
    json["trigger"]["unmatched_frames"] = status.trigger.unmatched_frames;
  }
  return json;
}

Json toJson(const TriggerStatus& status) { return {{"edges", status.edges}, {"missed", status.missed}}; }

}  // namespace swiftlet
