#pragma once
// Full smoothing of a run folder, later, as a function. What `swiftlet smooth` calls, and what it shares with
// the end of a run.

#include <atomic>
#include <string>
#include <vector>

#include "firmware_host/settings/settings.hpp"
#include "firmware_host/smoothing/full_smoothing.hpp"

namespace swiftlet {

/// As the settings say; `announce`: say on stderr what it will take before it begins.
FullSmoothingOptions smoothingOptions(const Settings& settings, bool announce);

/// map.tum. InputError.
void writeMapPoses(const std::string& path, const std::vector<MapPose>& poses);

struct SmoothRequest {
  std::string run;  ///< folder with keyframes.swk
  const std::atomic<bool>* stop = nullptr;
  bool announce = false;
};

/// Writes map.tum, then its figures into summary.json where there is one. Where nothing came out the folder
/// is as it was, and the result says why. InputError for bad input and where a file cannot be written.
FullSmoothing runSmooth(const SmoothRequest& request, const Settings& settings);

}  // namespace swiftlet
