#include "firmware_host/outputs/run_folder/in_map_file.hpp"

#include <limits>

#include "drivers/recorded/trajectory_file.hpp"

namespace swiftlet {
namespace {

// Half a minute of a fast camera: loop closure that is further behind has lost keyframes long before.
constexpr std::size_t kMostWaiting = 4096;

}  // namespace

void InMapFile::addFrame(std::uint64_t frame, Stamp stamp, const NavState& state) {
  waiting_.push_back({frame, stamp, state.epoch, state.T_world_body});
  if (waiting_.size() > kMostWaiting) writeUpTo(waiting_.front().frame + 1);
}

void InMapFile::addReport(const LoopReport& report) {
  writeUpTo(report.frame);
  known_ = report.correction;
}

void InMapFile::finish() { writeUpTo(std::numeric_limits<std::uint64_t>::max()); }

void InMapFile::writeUpTo(std::uint64_t frame) {
  for (; !waiting_.empty() && waiting_.front().frame < frame; waiting_.pop_front()) {
    const Waiting& image = waiting_.front();
    if (!known_.located || known_.epoch != image.epoch) continue;
    file_.write(formatTum(image.stamp, known_.T_map_world * image.T_world_body));
  }
}

}  // namespace swiftlet
