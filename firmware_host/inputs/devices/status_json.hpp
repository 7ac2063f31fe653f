#pragma once
// Status of devices for the summary, and as text for `doctor`.

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "firmware_host/inputs/devices/camera_thread.hpp"
#include "firmware_host/inputs/devices/imu_thread.hpp"
#include "firmware_host/inputs/devices/trigger_thread.hpp"

namespace swiftlet {

/// "unlocked", "locking", "locked".
const char* lockName(LockState lock);
/// Text for the event that a driver's stamps mark.
const char* stampEventName(StampEvent event);

nlohmann::ordered_json toJson(const TimesyncStatus& status);
nlohmann::ordered_json toJson(const ImuStatus& status);
nlohmann::ordered_json toJson(const CameraStatus& status);
nlohmann::ordered_json toJson(const TriggerStatus& status);

}  // namespace swiftlet
