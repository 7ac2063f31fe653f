#include "firmware_host/graph/log_node.hpp"

namespace swiftlet {
namespace {

/// Passes every queued value to `take`. Returns whether there were any.
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
  bool any = context_.options.remarks && context_.options.remarks(observer_);
  any = drain(loops, [this](const LoopReport& report) { observer_.onLoop(report); }) || any;
  any = drain(meshes, [this](const MeshResult& result) { observer_.onMesh(result); }) || any;
  any = drain(states, [this](const NavState& state) { observer_.onImuState(state); }) || any;
  if (const FrameResult* result = results.front(); result != nullptr) {
    // Takes the samples that the smoother took, so that a repetition of the run keeps the same ones.
    if (result->kind == TrackMessage::Kind::kFrame) samples.takeUpTo(result->step.samples, observer_);
    if (result->kind == TrackMessage::Kind::kEnd) samples.takeUpTo(SampleIn::kNoLimit, observer_);
    observer_.onResult(*result);
    results.pop();
    return true;
  }
  samples.takeSurplus(observer_);
  if (ended && !any && !done()) {
    if (mesh.refresh() > 0) observer_.onLocalMesh(mesh.value());
    finish();
  }
  return any;
}

}  // namespace swiftlet
