#include "firmware_host/smoothing/full_smoothing.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>

#include "drivers/input/input_error.hpp"
#include "firmware_host/smoothing/keyframe_reader.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kMebibyte = std::size_t{1} << 20U;

void add(const Status& kept, FaultCounts& faults) {
  if (!kept.ok()) faults.add(kept);
}

bool stopped(const FullSmoothingOptions& options) {
  return options.stop != nullptr && options.stop->load(std::memory_order_relaxed);
}

/// Adds all records to the smoother, the last calibration estimate at the end. Returns early when stopped.
void fill(KeyframeReader& reader, const FullSmoothingOptions& options, FullSmoother& smoother,
          FullSmoothing& result) {
  std::optional<CalibrationEstimate> calibration;
  while (!stopped(options)) {
    switch (reader.next()) {
      case KeyframeReader::Next::kSample:
        smoother.addImu(reader.sample());
        break;
      case KeyframeReader::Next::kKeyframe:
        add(smoother.addKeyframe(reader.frame(), reader.state(), reader.noiseInUse()), result.faults);
        break;
      case KeyframeReader::Next::kRevisit:
        add(smoother.addRevisit(reader.revisit()), result.faults);
        break;
      case KeyframeReader::Next::kCalibration:
        calibration = reader.calibration();
        break;
      case KeyframeReader::Next::kEnd:
        if (calibration) smoother.setCalibration(*calibration);
        result.cut = reader.cut();
        return;
    }
  }
}

void solve(FullSmoother& smoother, const FullSmoothingOptions& options, FullSmoothing& result) {
  const std::size_t bytes = smoother.memoryNeeded();
  if (bytes > options.most_bytes) {
    result.problem = fmt::format(
        "full smoothing of {} keyframes needs up to {} MiB, above smoother.full_memory_mib ({}). Raise it on "
        "a computer with enough memory: `swiftlet smooth RUN --set smoother.full_memory_mib={}`",
        smoother.size(), bytes / kMebibyte + 1, options.most_bytes / kMebibyte, bytes / kMebibyte + 1);
    return;
  }
  if (options.begins) options.begins(smoother.size(), bytes);
  const Status status = smoother.solve(result.report, options.stop);
  if (!status.ok()) {
    result.problem = status.what;
    return;
  }
  result.poses.reserve(smoother.size());
  for (std::size_t k = 0; k < smoother.size(); ++k) {
    const NavState solved = smoother.state(k);
    result.poses.push_back({solved.stamp, solved.T_world_body});
  }
}

}  // namespace

FullSmoothing smoothKeyframes(const std::string& path, const FullSmoothingOptions& options) {
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    throw InputError(path, 0, "", std::string("cannot be read: ") + std::strerror(errno),
                     "Give the folder of a run with smoother.horizon: full");
  }
  FullSmoothing result;
  result.spent = measured([&] {
    KeyframeReader reader(path, in);
    FullSmoother smoother(reader.rig(), reader.noise(), {});
    fill(reader, options, smoother, result);
    if (stopped(options)) {
      result.problem = kFullSmoothingStopped;
      return;
    }
    solve(smoother, options, result);
  });
  return result;
}

}  // namespace swiftlet
