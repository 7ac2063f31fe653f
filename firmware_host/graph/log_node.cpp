#include "firmware_host/graph/log_node.hpp"

namespace swiftlet {
namespace {

/// Gives all that waits to `take`; whether there was anything.
template <typename Queue, typename Take>
bool drain(Queue& queue, Take&& take) {
  bool any = false;
  while (const auto* value = queue.front()) {
    take(*value);
    queue.pop();
    any = true;
  }
  return any;
}

}  // namespace

bool LogNode::turn() {
  const bool ended = inputEnded();
  bool any = context_.options.remarks && context_.options.remarks(log_);
  any = drain(loops, [this](const LoopReport& report) { log_.onLoop(report); }) || any;
  any = drain(meshes, [this](const MeshResult& result) { log_.onMesh(result); }) || any;
  any = drain(states, [this](const NavState& state) { log_.onImuState(state); }) || any;
  if (const FrameResult* result = results.front(); result != nullptr) {
    // What the smoother had, so that a repetition of the run keeps the same.
    if (result->kind == TrackMessage::Kind::kFrame) samples.takeUpTo(result->step.samples, log_);
    if (result->kind == TrackMessage::Kind::kEnd) samples.takeUpTo(SampleIn::kNoLimit, log_);
    log_.onResult(*result);
    results.pop();
    return true;
  }
  samples.takeSurplus(log_);
  if (ended && !any && !done()) {
    if (mesh.refresh() > 0) log_.onLocalMesh(mesh.value());
    finish();
  }
  return any;
}

}  // namespace swiftlet
