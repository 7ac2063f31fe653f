#include "firmware_host/smoothing/full_smoothing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>

#include "drivers/input/input_error.hpp"
#include "firmware_host/smoothing/keyframe_reader.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kMebibyte = std::size_t{1} << 20U;
// How often the memory needed is computed while keyframes are read: it goes through all sightings so far.
constexpr std::size_t kCheckedEvery = 1000;

bool stopped(const FullSmoothingOptions& options) {
  return options.stop != nullptr && options.stop->load(std::memory_order_relaxed);
}

/// Adds all records to the smoother, the last calibration estimate at the end. Returns early when stopped.
/// Once the memory limit is exceeded, keyframes are only counted.
void fill(KeyframeReader& reader, const FullSmoothingOptions& options, FullSmoother& smoother,
          FullSmoothing& result) {
  std::optional<CalibrationEstimate> calibration;
  bool full = false;
  while (!stopped(options)) {
    switch (reader.next()) {
      case KeyframeReader::Next::kSample:
        if (!full) smoother.addImu(reader.sample());
        break;
      case KeyframeReader::Next::kKeyframe:
        ++result.keyframes;
        if (full) break;
        smoother.addKeyframe(reader.frame(), reader.state(), reader.noiseInUse());
        full = smoother.size() % kCheckedEvery == 0 && smoother.memoryNeeded() > options.most_bytes;
        break;
      case KeyframeReader::Next::kRevisit:
        if (full) break;
        if (const Status kept = smoother.addRevisit(reader.revisit()); !kept.ok()) result.faults.add(kept);
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
  // In proportion, if only the first keyframes were kept.
  const std::size_t bytes =
      smoother.memoryNeeded() * result.keyframes / std::max<std::size_t>(smoother.size(), 1);
  if (bytes > options.most_bytes) {
    result.problem = fmt::format(
        "full smoothing of {} keyframes needs up to {} MiB, above smoother.full_memory_mib ({}). Raise it on "
        "a computer with enough memory: `swiftlet smooth RUN --set smoother.full_memory_mib={}`",
        result.keyframes, bytes / kMebibyte + 1, options.most_bytes / kMebibyte, bytes / kMebibyte + 1);
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
