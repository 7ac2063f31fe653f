#pragma once
// Full smoothing of a finished run folder: implements `swiftlet smooth` and shares its steps with the end of
// a run.

#include <atomic>
#include <string>
#include <vector>

#include "firmware_host/settings/settings.hpp"
#include "firmware_host/smoothing/full_smoothing.hpp"

namespace swiftlet {

/// Options from the settings; `announce`: print the expected memory on stderr first.
FullSmoothingOptions smoothingOptions(const Settings& settings, bool announce);

/// Writes map.tum. InputError if it cannot.
void writeMapPoses(const std::string& path, const std::vector<MapPose>& poses);

struct SmoothRequest {
  std::string run;  ///< folder with keyframes.swk
  const std::atomic<bool>* stop = nullptr;
  bool announce = false;
};

/// Writes map.tum, then adds the results to summary.json if there is one. On failure the folder is unchanged
/// and the result gives the reason. InputError for bad input and if a file cannot be written.
FullSmoothing runSmooth(const SmoothRequest& request, const Settings& settings);

}  // namespace swiftlet
