#include "firmware_host/outputs/run_folder/in_map_file.hpp"

#include "drivers/recorded/trajectory_file.hpp"

namespace swiftlet {
namespace {

// Half a minute of a fast camera: if loop closure is further behind, it has lost keyframes long before.
constexpr std::size_t kMostWaiting = 4096;

}  // namespace

void InMapFile::addFrame(std::uint64_t frame, Stamp stamp, const NavState& state) {
  waiting_.push_back({frame, stamp, state.epoch, state.T_world_body});
  write(false);
}

void InMapFile::addReport(const LoopReport& report) {
  reports_.push_back({report.frame, report.correction});
  if (reports_.size() > kMostWaiting) takeReport();
  write(false);
}

void InMapFile::finish() { write(true); }

void InMapFile::takeReport() {
  known_ = reports_.front().correction;
  reports_.pop_front();
}

void InMapFile::write(bool ended) {
  for (; !waiting_.empty(); waiting_.pop_front()) {
    const Waiting& image = waiting_.front();
    while (!reports_.empty() && reports_.front().frame <= image.frame) takeReport();
    // Only the report on a later keyframe says that there is none on this image.
    if (reports_.empty() && !ended && waiting_.size() <= kMostWaiting) return;
    if (!known_.located || known_.epoch != image.epoch) continue;
    file_.write(formatTum(image.stamp, known_.T_map_world * image.T_world_body));
  }
}

}  // namespace swiftlet
