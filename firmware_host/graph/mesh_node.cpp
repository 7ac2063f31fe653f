#include "firmware_host/graph/mesh_node.hpp"

#include "firmware_host/interfaces/run_listener.hpp"

namespace swiftlet {

MeshNode::MeshNode(GraphContext& context)
    : Node("mesh", Rank::kMesh),
      context_(context),
      stage_(context.rig, HorizonLimits{},
             MeshPlanes{context.settings.odometry.regularity_enabled,
                        context.settings.odometry.plane_point_sigma}) {}

bool MeshNode::turn() {
  const bool ended = inputEnded();
  const std::uint64_t number = window.refresh();
  if (number == window_) {
    if (ended) {
      image.clear();
      finish();
    }
    return false;
  }
  const MeshMessage& message = window.value();
  skipped_ += number - window_ - 1;
  window_ = number;
  meshFrame(message);
  return true;
}

void MeshNode::meshFrame(const MeshMessage& message) {
  const ImageSlot* slot = message.image > 0
                              ? image.find(message.image, [](const ImageSlot& s) { return s.frame.number; })
                              : nullptr;
  if (!message.hasPose()) return;
  if (slot == nullptr) ++without_image_;
  MeshInput input;
  input.window = &message.window;
  input.tracks = &message.tracked;
  if (slot != nullptr) input.image = slot->frame.image;
  const Spent spent = context_.timed(StageId::kMesh, [&] {
    // Refused input is counted by the stage.
    if (stage_.step(input).code != StatusCode::kInvalidInput) publish(message.tracked.keyframe);
  });
  context_.count(StageId::kMesh, spent, message.tracked.keyframe);
  steps.send({message.tracked.index, window_, slot != nullptr ? message.image : 0});
}

void MeshNode::publish(bool keyframe) {
  if (newest.connected()) {
    stage_.horizonMesh(newest.draft());
    newest.send();
  }
  for (LiveOutlet* outlet : context_.options.outlets) {
    stage_.horizonMesh(outlet->mesh.draft());
    outlet->mesh.publish();
  }
  if (const PlaneReport* report = stage_.newPlanes()) planes.send(*report);
  if (!meshes.connected()) return;
  MeshResult& out = meshes.draft();
  out.keyframe = keyframe;
  stage_.frameMesh(out.frame);
  if (keyframe) stage_.horizonMesh(out.horizon);
  out.hull.clear();
  for (const Eigen::Vector2f& corner : stage_.hull()) static_cast<void>(out.hull.tryPushBack(corner));
  meshes.send();
}

void MeshNode::report(RunStatistics& statistics) const {
  statistics.mesh = {stage_.counters(), stage_.horizon().counters(), skipped_, without_image_};
}

}  // namespace swiftlet
