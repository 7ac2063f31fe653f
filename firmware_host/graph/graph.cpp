#include "firmware_host/graph/graph.hpp"

#include <malloc.h>

#include <algorithm>

#include "estimator/odometry/odometry_inputs.hpp"
#include "firmware_host/realtime/memory_lock.hpp"

namespace swiftlet {
namespace {

/// Bytes currently allocated by malloc.
std::int64_t heapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<std::int64_t>(info.uordblks + info.hblkhd);
}

}  // namespace

template <typename T, typename... Arguments>
std::unique_ptr<T> Graph::make(Arguments&&... arguments) {
  const std::int64_t before = heapBytes();
  auto node = std::make_unique<T>(std::forward<Arguments>(arguments)...);
  reserved_.push_back({node->name(), heapBytes() - before});
  return node;
}

Graph::Graph(const Rig& rig, const ImuNoise& noise, const Settings& settings, RunObserver& observer,
             const GraphOptions& options)
    : context_{rigInUse(rig, settings.odometry), noise, settings, options, {}} {
  sensors_ = make<SensorNode>(context_);
  propagate_ = make<PropagateNode>(context_);
  track_ = make<TrackNode>(context_, *sensors_);
  smooth_ = make<SmoothNode>(context_);
  if (settings.mesh.enabled) mesh_ = make<MeshNode>(context_);
  if (settings.loop.enabled) loop_ = make<LoopNode>(context_);
  if (settings.map.enabled) map_ = make<MappingNode>(context_);
  if (loop_ && map_ && options.kept_volume) options.kept_volume(map_->stage().submaps(), loop_->keptNodes());
  log_ = make<LogNode>(context_, observer);
  if (options.recorder != nullptr) record_ = make<RecordNode>(*options.recorder, *sensors_);
  for (Node* node : std::initializer_list<Node*>{propagate_.get(), track_.get(), smooth_.get(), mesh_.get(),
                                                 loop_.get(), map_.get(), log_.get(), record_.get()}) {
    if (node != nullptr) nodes_.push_back(node);
  }
  const std::int64_t before = heapBytes();
  connectNodes(observer);
  reserved_.push_back({"arrows", heapBytes() - before});
}

Graph::~Graph() = default;

// The whole system on one screen: every arrow, from writer to reader. Capacity, policy and counter of an
// arrow are declared at the reader's end, in the reader's header.
void Graph::connectNodes(const RunObserver& observer) {
  const GraphOptions& options = context_.options;
  SensorNode& sensors = *sensors_;
  PropagateNode& propagate = *propagate_;
  TrackNode& track = *track_;
  SmoothNode& smooth = *smooth_;

  // IMU                                 -> a state for each sample
  sensors.imu.to(propagate.samples);
  if (options.imu_states) propagate.states.to(log_->states);

  // cameras, IMU                        -> tracked frames
  for (std::size_t c = 0; c < context_.rig.camera_count; ++c) sensors.imagesTo(c, track.frames.images[c]);
  sensors.imu.to(track.samples);

  // tracked frames, IMU                 -> results; fixes and windows back to propagation and tracking
  track.tracked.to(smooth.tracked);
  sensors.imu.to(smooth.samples);
  smooth.fix.to(propagate.fix);
  smooth.window.to(track.window);
  smooth.results.to(log_->results);
  if (observer.wantsImu()) sensors.imu.to(log_->samples);

  // windows, images of camera 0         -> meshes; planes back to the smoother
  if (mesh_) {
    smooth.mesh.to(mesh_->window);
    sensors.imagesTo(0, mesh_->image);
    mesh_->planes.to(smooth.planes);
    mesh_->newest.to(log_->mesh);
    if (options.meshes) mesh_->meshes.to(log_->meshes);
  }

  // keyframes, copies of their images   -> loops, and the odometry's world in the map
  if (loop_) {
    smooth.keyframes.to(loop_->keyframes);
    track.copies.to(loop_->images, pixelsOf(context_.rig));
    loop_->reports.to(log_->loops);
  }

  // frames, copies of their images, depth, labels, corrections -> volume, surface, distance field
  if (map_) {
    smooth.mapped.to(map_->frames);
    track.copies.to(map_->images, pixelsOf(context_.rig));
    sensors.scenesTo(map_->scenes);
    sensors.scene_notes.to(track.scene_notes);
    if (loop_) loop_->worlds.to(map_->worlds);
  }

  // everything that entered, and what each node used for a step -> recording
  if (record_) {
    RecordNode& record = *record_;
    sensors.imu_as_delivered.to(record.samples);
    for (std::size_t c = 0; c < context_.rig.camera_count; ++c) sensors.imagesTo(c, record.images[c]);
    propagate.steps.to(record.propagate);
    track.steps.to(record.track);
    smooth.steps.to(record.smooth);
    if (mesh_) mesh_->steps.to(record.mesh);
    if (loop_) loop_->steps.to(record.loop);
    if (map_) map_->records.to(record.map);
  }
}

void Graph::report(RunObserver& observer) const {
  RunStatistics& statistics = observer.statistics();
  sensors_->report(statistics);
  sensors_->addLosses(statistics.losses);
  for (const Node* node : nodes_) {
    if (node->isLeftBehind()) continue;
    node->report(statistics);
    node->addLosses(statistics.losses);
  }
  if (log_->isLeftBehind()) return;
  if (loop_ && !loop_->isLeftBehind()) observer.keepLoops(loop_->stage());
  if (map_ && !map_->isLeftBehind()) observer.showMap(map_->stage(), map_->tiedEpochs());
  for (std::size_t i = 0; i < statistics.times.size(); ++i) {
    const StageTimes& times = context_.times[i];
    if (times.wall_frames.count() + times.wall_keyframes.count() > 0) statistics.times[i] = times;
  }
}

void Graph::look(FlightFacts& facts) const {
  sensors_->look(facts);
  const SmoothedFrameNews frame = smooth_->newestFrame();
  facts.estimate = {propagate_->stateCount(),
                    propagate_->askHealth(),
                    frame.count,
                    frame.stamp,
                    frame.has_state,
                    frame.health,
                    frame.epoch,
                    frame.track_level,
                    frame.smooth_level,
                    frame.world_up};
  if (!record_) return;
  facts.recorder_running = record_->recorder().running();
  facts.recorder_lost = record_->lost();
}

void Graph::addReservations(MemoryTable& table) const {
  for (const Reserved& row : reserved_) table.add(row.what, std::max<std::int64_t>(row.bytes, 0));
}

}  // namespace swiftlet
