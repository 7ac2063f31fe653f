#include "firmware_host/commands/reported_run.hpp"

#include <exception>
#include <filesystem>
#include <system_error>
#include <utility>

#include "firmware_host/lab/evaluation/confusion_picture.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"

namespace swiftlet {

ReportedRun readReportedRun(const std::string& folder, const std::string& given_truth,
                            const Settings& settings) {
  namespace fs = std::filesystem;
  RunFiles files = readRunFiles(folder);
  const std::string log = files.text("run/log");
  const std::string source = given_truth.empty() ? log : given_truth;
  Truth truth;
  if (!source.empty()) {
    try {
      truth = readTruth(source, true);
      truth.poses = onImageClock(std::move(truth.poses), cameraToImuShift(files.summary));
    } catch (const std::exception& error) {
      // A log without truth, or one that cannot be reached, is no error of the run; a truth given as an
      // option must exist.
      if (!given_truth.empty()) throw;
      files.missing.push_back({"truth", error.what()});
    }
  }
  ReportedRun run;
  std::error_code unreachable;
  fs::path world = fs::is_directory(source, unreachable) ? fs::path(source) : fs::path(log);
  if (!fs::is_directory(world, unreachable)) world.clear();
  try {
    const fs::path surface = world / "truth" / "mesh.ply";
    if (!world.empty() && fs::exists(surface, unreachable)) run.true_surface = surface.string();
    if (!world.empty()) run.labels = readLabelNames(world.string());
  } catch (const std::exception& error) {
    files.missing.push_back({"labels.csv", error.what()});
  }
  run.view = viewOf(std::move(files), truth.poses, truth.name,
                    accuracyOptions(settings.evaluation, AlignKind::kYaw));
  return run;
}

}  // namespace swiftlet
