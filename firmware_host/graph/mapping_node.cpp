#include "firmware_host/graph/mapping_node.hpp"

#include <algorithm>

#include "estimator/odometry/stamp_guard.hpp"
#include "firmware_host/interfaces/packed_copy.hpp"
#include "firmware_host/interfaces/run_listener.hpp"

namespace swiftlet {
MappingNode::MappingNode(GraphContext& context)
    : Node("map", Rank::kLow),
      context_(context),
      stage_(context.rig, context.settings.map_stage, context.options.depth_sensor, context.options.storage) {
  const GraphOptions& options = context.options;
  if (options.confusion) stage_.setConfusion(*options.confusion);
  if (options.labels == nullptr || !context.settings.map_stage.labels) return;
  held_ = std::make_unique<HeldFrames>(
      *options.labels, pixelsOf(context.rig),
      options.depth_sensor != nullptr ? options.depth_sensor->camera.pixels() : 0);
}

bool MappingNode::turn() {
  const bool ended = inputEnded();
  if (held_) {
    holdFrames();
    return takeHeldFrame() || useSpareTime(ended && held_->empty());
  }
  const MapMessage* message = frames.front();
  if (message == nullptr) return useSpareTime(ended);
  take(*message, findFor(*message));
  frames.pop();
  if (stage_.isCorrecting()) stepCorrection();
  return true;
}

MappingNode::AtHand MappingNode::findFor(const MapMessage& message) {
  AtHand at_hand;
  const KeyframeImages* found = images.find(message.frame, [](const KeyframeImages& of) { return of.frame; });
  if (found == nullptr) return at_hand;
  at_hand.image = &found->image;
  at_hand.number = found->number;
  // Left over from before the stamps jumped back.
  scenes.forgetIf([&](const SceneSlot& slot) { return isFarAhead(message.stamp, slot.images.stamp); });
  const SceneSlot* scene =
      scenes.connected() ? scenes.find(message.stamp, [](const SceneSlot& slot) { return slot.images.stamp; })
                         : nullptr;
  if (scene != nullptr) at_hand.scene = scene->images;
  return at_hand;
}

void MappingNode::take(const MapMessage& message, const AtHand& at_hand) {
  ++taken_;
  correct();
  if (records.connected()) record({message.frame, worlds_, spare_turns_, at_hand.number}, at_hand.scene);
  spare_turns_ = 0;
  if (at_hand.image == nullptr) ++without_image_;
  if (at_hand.image == nullptr || !fuse(message, at_hand)) stage_.announce(message.stamp);
}

void MappingNode::holdFrames() {
  while (const MapMessage* message = held_->full() ? nullptr : frames.front()) {
    const KeyframeImages* found =
        images.find(message->frame, [](const KeyframeImages& of) { return of.frame; });
    held_->hold(*message, found, findFor(*message).scene, wallSeconds());
    frames.pop();
  }
}

/// Maps the oldest held frame if it is due.
bool MappingNode::takeHeldFrame() {
  const HeldFrames::Frame* frame = held_->due(wallSeconds());
  if (frame == nullptr) return false;
  take(frame->message, {frame->has_images ? &frame->image : nullptr, frame->number, frame->scene});
  held_->drop();
  if (stage_.isCorrecting()) stepCorrection();
  return true;
}

bool MappingNode::useSpareTime(bool ended) {
  if (ended) {
    if (!done()) end();
    return false;
  }
  if (!spareTurn()) return false;
  ++spare_turns_;
  return true;
}

bool MappingNode::spareTurn() {
  if (stage_.isCorrecting()) {
    stepCorrection();
    return true;
  }
  if (stage_.counters().taken == 0 || report_.distance.caught_up) return false;
  spend(StageId::kDistance, [&] { stage_.updateDistance(vehicle_, {}, report_); });
  return true;
}

void MappingNode::end() {
  correct();
  if (records.connected()) record({0, worlds_, spare_turns_, {}, true}, {});
  stage_.drawRest();
  images.clear();
  scenes.clear();
  finish();
}

/// Applies loop closure's newest correction to what was fused before.
void MappingNode::correct() {
  const std::uint64_t number = worlds.refresh();
  if (number == worlds_) return;
  worlds_ = number;
  const WorldsInMap& now = worlds.value();
  spend(StageId::kCorrection, [&] { stage_.correct({now.keyframes.data(), now.keyframes.size()}); });
}

void MappingNode::stepCorrection() {
  spend(StageId::kCorrection, [&] { stage_.stepCorrection({}, corrected_); });
  if (corrected_.done) draw();
}

bool MappingNode::fuse(const MapMessage& message, const AtHand& at_hand) {
  MapInput input;
  input.stamp = message.stamp;
  input.frame = message.frame;
  input.epoch = message.epoch;
  input.T_map_body = message.pose.T_world_body;
  input.scan = message.pose.scan;
  if (const MapCorrection& now = worlds.value().newest; worlds_ > 0 && now.epoch == message.epoch) {
    input.T_map_world = now.T_map_world;
    input.T_map_body = now.T_map_world * input.T_map_body;
  }
  input.image = *at_hand.image;
  input.depth = at_hand.scene.depth;
  input.labels = at_hand.scene.labels;
  if (context_.options.depth_sensor != nullptr && at_hand.scene.empty()) {
    ++without_scene_;
    return false;
  }
  spend(StageId::kDepth, [&] { static_cast<void>(stage_.measure(input, {}, report_)); });
  if (report_.status.ok()) {
    spend(StageId::kVolume, [&] { static_cast<void>(stage_.integrate(input, {}, report_)); });
  }
  if (report_.status.code == StatusCode::kInvalidInput) {
    ++refused_;
    faults_.add(report_.status);
    return false;
  }
  vehicle_ = input.T_map_body.translation;
  draw();
  publishSurface(message.stamp);
  publishObstacle(message.stamp, input.T_map_body);
  return true;
}

void MappingNode::draw() {
  // What is not drawn now is counted in the report and drawn later.
  spend(StageId::kSurface, [&] { static_cast<void>(stage_.draw(vehicle_, {}, report_)); });
  spend(StageId::kDistance, [&] { stage_.updateDistance(vehicle_, {}, report_); });
}

/// To each outlet that requests it.
void MappingNode::publishSurface(Stamp stamp) {
  struct Gather : SurfaceSink {
    explicit Gather(std::vector<SurfaceVertex>& to) : vertices(to) {}
    void take(const SurfacePatch& patch) override {
      const std::size_t room = SurfaceNews::kMost - vertices.size();
      vertices.insert(
          vertices.end(), patch.vertices.begin(),
          patch.vertices.begin() + static_cast<std::ptrdiff_t>(std::min(room, patch.vertices.size())));
    }
    std::vector<SurfaceVertex>& vertices;
  };
  for (LiveOutlet* outlet : context_.options.outlets) {
    if (!outlet->surface_wanted.exchange(false, std::memory_order_acq_rel)) continue;
    SurfaceNews& out = outlet->surface.draft();
    out.stamp = stamp;
    out.vertices.clear();
    Gather gather(out.vertices);
    stage_.visitSurface(gather);
    outlet->surface.publish();
  }
}

void MappingNode::publishObstacle(Stamp stamp, const SE3& T_map_body) {
  for (LiveOutlet* outlet : context_.options.outlets)
    outlet->obstacle.write({stamp, T_map_body, stage_.distance().query(T_map_body.translation)});
}

void MappingNode::record(const MapStep& step, const SceneImages& scene) {
  MapRecord& out = records.draft();
  out.step = step;
  out.scene = scene;
  if (scene.depth.depth != nullptr) {
    out.depth.assign(scene.depth.depth, scene.depth.depth + scene.depth.camera.pixels());
    out.scene.depth.depth = out.depth.data();
  }
  if (!scene.labels.empty()) {
    out.labels.resize(static_cast<std::size_t>(scene.labels.width * scene.labels.height));
    out.scene.labels = packedCopy(scene.labels, out.labels.data());
  }
  records.send();
}

std::span<const std::uint32_t> MappingNode::tiedEpochs() const {
  const auto& tied = worlds.value().tied;
  return {tied.data(), tied.size()};
}

void MappingNode::report(RunStatistics& statistics) const {
  statistics.mapping = {taken_, without_image_, without_scene_, refused_, {}};
  if (held_) statistics.mapping->held = held_->counters();
  for (const auto& row : faults_.rows()) statistics.faults[row.text] += row.count;
}

void MappingNode::addLosses(std::map<std::string, std::uint64_t>& losses) const {
  Node::addLosses(losses);
  const std::uint64_t unmapped = without_image_ + without_scene_;
  if (unmapped > 0) losses["frames_unmapped"] += unmapped;
  if (!held_) return;
  const std::uint64_t without_labels = held_->counters().late + held_->counters().no_room;
  if (without_labels > 0) losses["map_frames_without_labels"] += without_labels;
}

}  // namespace swiftlet
