#include "firmware_host/runs/smooth_run.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/smoothing/map_keeper.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// A killed run has no summary. A summary that is not valid JSON is left unchanged.
void addToSummary(const fs::path& path, const FullSmoothing& found) {
  std::ifstream file(path);
  if (!file) return;
  Json summary;
  try {
    summary = Json::parse(file);
    summary.at("counters")["full_smoothing"] = toJson(found.report);
    StageTable times;
    addTime(times, StageId::kMap, found.spent);
    summary.at("timing").update(timingJson(times));
  } catch (const Json::exception&) {
    throw InputError(path, 0, "",
                     "is damaged: the results of full smoothing are not added; map.tum is written",
                     "Delete it, or replay the log again");
  }
  writeJson(path, summary);
}

}  // namespace

FullSmoothingOptions smoothingOptions(const Settings& settings, bool announce) {
  FullSmoothingOptions options;
  options.most_bytes = static_cast<std::size_t>(settings.full_memory_mib) * kMebibyte;
  if (announce) {
    options.begins = [](std::size_t keyframes, std::size_t bytes) {
      warn(fmt::format("smoothing {} keyframes with up to {} MiB of memory\n", keyframes,
                       bytes / kMebibyte + 1));
    };
  }
  return options;
}

void writeMapPoses(const std::string& path, const std::vector<MapPose>& poses) {
  WholeFile file(path);
  for (const MapPose& pose : poses) file.write(formatTum(pose.stamp, pose.T_world_body) + "\n");
  file.commit();
}

FullSmoothing runSmooth(const SmoothRequest& request, const Settings& settings) {
  const fs::path folder(request.run);
  FullSmoothingOptions options = smoothingOptions(settings, request.announce);
  options.stop = request.stop;
  FullSmoothing found = smoothKeyframes(folder / kKeyframeFile, options);
  if (found.poses.empty()) return found;
  writeMapPoses(folder / "map.tum", found.poses);
  addToSummary(folder / "summary.json", found);
  return found;
}

}  // namespace swiftlet
