// The system in one screen. Threads in brackets, stages in capitals; ring: every message arrives, in order;
// newest: only the latest matters; slots: images, lent by handle with a quota for each reader.
//
//   [sensor]  IMU -------+--ring--> [propagate] PROPAGATION --ring--> NavState at IMU rate -> [log]
//                        |               ^
//                        |               '--newest-- StateFix <------------------.
//                        +--ring--> [track]                                      |
//   [sensor]  cameras --slots-----> PAIRING, TRACK --ring--> TrackedFrame -> [smooth] SMOOTH --ring-->
//                        |               ^                                       |    FrameResult -> [log]
//                        |               '--newest-- SmoothedWindow <------------+
//                        +--ring--> [smooth]                                     | newest, with its frame
//                        |                         ^-- newest PlaneReport --.    v
//   [sensor]  camera 0 --slots-----------------------------------------------> [mesh] MESH
//                        |                                                       |
//                        |                     newest LocalMesh, ring of all on request --> [log]
//   [track]   keyframes' images, copied --slots--> [loop] LOOP <--ring-- keyframes, with window and link, of
//                        |                           |                   [smooth]
//                        |                           '--newest MapCorrection; ring of reports --> [log]
//                        |                           v
//   [track]   mapped frames' images --slots-----> [map] DEPTH, VOLUME, SURFACE, DISTANCE --> distance field
//   [sensor]  depth, labels --slots----------------^ ^--ring-- frames with their poses, of [smooth]
//                        |     [dds] labels that come later --places of the frames held for them--> [map]
//                        +--ring--> [log] keyframes and IMU, kept for full smoothing after the run -> map.tum
//   everything above, and what each stage took for a step --ring, slots--> [record] flight recorder
//
//   when full: IMU rings refuse and count; camera rings and waiting frames let the oldest go, counted;
//   `track` waits for room in front of `smooth`; `mesh` skips to the newest window, counted; `loop` and
//   `map` miss keyframes, counted; log and recorder lose, counted; no reader can hold another's slots.

#include "firmware_host/pipeline/wiring.hpp"

#include <malloc.h>

#include <algorithm>

#include "drivers/device/monotonic_now.hpp"
#include "firmware_host/pipeline/arming_monitor.hpp"
#include "firmware_host/pipeline/flight_recorder.hpp"
#include "firmware_host/realtime/memory_lock.hpp"

namespace swiftlet {
namespace {

PairingSettings pairingSettings(const Rig& rig, const Settings& settings) {
  PairingSettings result;
  result.cameras = settings.odometry.use_stereo ? rig.camera_count : 1;
  result.tolerance = Duration::fromSeconds(settings.pairing.tolerance_ms * 1e-3);
  result.patience = Duration::fromSeconds(settings.pairing.patience_ms * 1e-3);
  return result;
}

}  // namespace

HeapMark::HeapMark() {
  const struct mallinfo2 info = mallinfo2();
  bytes = static_cast<std::int64_t>(info.uordblks + info.hblkhd);
}

Wiring::Wiring(const Rig& rig, const ImuNoise& noise, const Settings& settings, RunLog& log,
               const Options& options)
    : rig_(rigInUse(rig, settings.odometry)),
      log_(log),
      recorder_(options.recorder),
      arming_(options.arming),
      outlets_(options.outlets),
      full_effort_(settings.effort),
      track_effort_(options.track_effort != nullptr ? options.track_effort : &full_effort_),
      smooth_effort_(options.smooth_effort != nullptr ? options.smooth_effort : &full_effort_),
      sample_patience_(options.sample_patience),
      sample_period_(Duration::fromSeconds(noise.rate_hz > 0 ? 1 / noise.rate_hz : 0)),
      remarks_(options.remarks),
      drag_(options.drag),
      propagation_(noise, settings.odometry),
      pairing_(pairingSettings(rig, settings)),
      track_(rig, noise, settings.odometry),
      smooth_(rig, noise, settings.odometry),
      mesh_(settings.mesh.enabled
                ? std::make_unique<MeshStage>(
                      rig_, HorizonLimits{},
                      MeshPlanes{settings.odometry.regularity_enabled, settings.odometry.plane_point_sigma})
                : nullptr),
      loop_(settings.loop.enabled
                ? std::make_unique<LoopStage>(
                      rig_, settings.loop_stage, LoopLimits{},
                      options.vocabulary != nullptr ? *options.vocabulary : Vocabulary::shipped())
                : nullptr),
      map_(settings.map.enabled
               ? std::make_unique<MapStage>(rig_, settings.map_stage, options.depth_sensor, options.spill)
               : nullptr) {
  if (map_) {
    if (options.confusion) map_->setConfusion(*options.confusion);
    to_map_ = std::make_unique<MapArrows>();
    mapping_.from_sensor = options.depth_sensor != nullptr;
    const auto pixels = static_cast<std::size_t>(rig_.camera[0].width() * rig_.camera[0].height());
    for (std::size_t i = 0; i < ScenePool::capacity(); ++i) {
      SceneSlot& slot = to_map_->scenes.slot(i);
      if (mapping_.from_sensor) slot.depth.resize(options.depth_sensor->camera.pixels());
      if (settings.map_stage.labels) slot.labels.resize(pixels);
    }
    if (options.labels != nullptr && settings.map_stage.labels) {
      std::array<std::size_t, kMaxCameras> sizes{};
      for (std::size_t c = 0; c < rig_.camera_count; ++c) {
        sizes[c] = static_cast<std::size_t>(rig_.camera[c].width() * rig_.camera[c].height());
      }
      held_ = std::make_unique<HeldFrames>(*options.labels, sizes,
                                           mapping_.from_sensor ? options.depth_sensor->camera.pixels() : 0);
    }
  }
  if (loop_ || map_)
    keyframe_images_ = std::make_unique<KeyframePool>(KeyframePool::Quotas{kLoopQuota, kMapQuota});
  if (options.imu_states) states_ = std::make_unique<StateRing>();
  if (loop_) to_loop_ = std::make_unique<LoopArrows>();
  if (options.meshes && mesh_) meshes_ = std::make_unique<MeshRing>();
  if (recorder_ != nullptr) to_recorder_ = std::make_unique<RecorderArrows>();
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    const CameraModel& model = rig_.camera[c];
    for (std::size_t i = 0; i < kImageSlots; ++i) {
      camera_[c].pool.slot(i).pixels.resize(static_cast<std::size_t>(model.width() * model.height()));
    }
    for (std::size_t i = 0; keyframe_images_ && i < KeyframePool::capacity(); ++i) {
      keyframe_images_->slot(i).pixels[c].resize(static_cast<std::size_t>(model.width() * model.height()));
    }
  }
}

// IMU -> propagate, track, smooth, log, record
void Wiring::takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) {
  const ImuArrival message{sample, ++counters_.sensor.imu_samples, arrival, host};
  // Refusals are counted by the rings.
  static_cast<void>(imu_to_propagate_.tryPush(message));
  static_cast<void>(imu_to_track_.tryPush(message));
  static_cast<void>(imu_to_smooth_.tryPush(message));
  if (log_.wantsImu()) static_cast<void>(imu_to_log_.tryPush(message));
  if (to_recorder_) static_cast<void>(to_recorder_->imu.tryPush(message));
  newest_imu_.store(sample.stamp.ns);
  imu_sensed_.note(sample.stamp, host.arrival);
  imu_facts_.write(imu_sensed_);
}

void SensorActivity::note(Stamp stamp, double host_arrival) {
  ++messages;
  if (stamp <= newest) ++reversed_stamps;
  newest = stamp;
  arrival = host_arrival;
}

SensorFacts Wiring::sensorFacts() const {
  SensorFacts facts;
  SensorActivity imu;
  if (imu_facts_.read(imu) != 0) {
    facts.samples = imu.messages;
    facts.reversed_stamps = imu.reversed_stamps;
    facts.newest_sample = imu.newest;
  }
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    SensorActivity camera;
    if (camera_[c].facts.read(camera) == 0) continue;
    facts.reversed_stamps += camera.reversed_stamps;
    facts.newest_image[c] = camera.newest;
    facts.image_arrival[c] = camera.arrival;
  }
  return facts;
}

// IMU, newest fix -> propagation -> state at IMU rate
bool Wiring::propagate() {
  const bool ended = input_ended_.load(std::memory_order_acquire);
  const double cpu = threadCpuSeconds();
  const std::uint64_t fix = fix_.refresh();
  if (fix != propagating_.fix) {
    propagating_.fix = fix;
    if (to_recorder_) static_cast<void>(to_recorder_->propagate.tryPush({counters_.propagate.samples, fix}));
    addTime(times_, StageId::kFix, measured([&] { propagation_.take(fix_.value()); }));
  }
  const ImuArrival* arrival = imu_to_propagate_.front();
  if (arrival == nullptr) {
    if (ended) propagate_done_.store(true, std::memory_order_release);
    return false;
  }
  const Status status =
      propagation_.step(arrival->sample, states_ || !outlets_.empty() ? &propagating_.state : nullptr);
  if (states_ && status.ok()) static_cast<void>(states_->tryPush(propagating_.state));
  if (status.ok() && !outlets_.empty()) {
    const NavState& state = propagating_.state;
    const StateNews news(state, arrival->sample.gyro - state.bias_gyro);
    for (LiveOutlet* outlet : outlets_) outlet->state.write(news);
  }
  addTime(times_, StageId::kImu, {wallSeconds() - arrival->host.arrival, threadCpuSeconds() - cpu});
  imu_to_propagate_.pop();
  ++counters_.propagate.samples;
  if (!status.ok() && status.code != StatusCode::kNotReady) {
    ++counters_.propagate.refused;
    counters_.propagate.faults.add(status);
  }
  return true;
}

// IMU, tracked frames, newest planes -> smooth -> output, fix, window, window with its frame
bool Wiring::smooth() {
  const TrackMessage* message = tracked_ring_.front();
  if (message == nullptr) {
    smoothing_.samples +=
        takeSurplus(imu_to_smooth_, [this](const ImuSample& sample) { smooth_.addImu(sample); });
    return false;
  }
  const bool ended = message->kind == TrackMessage::Kind::kEnd;
  // The end is not to be lost, unless nobody is left to take it.
  if (ended && results_.size() >= ResultRing::capacity() && !log_abandoned_.load(std::memory_order_acquire)) {
    return false;
  }
  FrameResult* result = results_.beginPush();
  FrameResult& out = result != nullptr ? *result : smoothing_.unread;
  out.kind = message->kind;
  out.track_status = message->status;
  out.status = okStatus();
  out.track_step = message->step;
  out.host = message->host;
  out.spent = message->spent;
  out.dropped = message->dropped;
  out.track_level = message->effort_level;
  if (message->kind == TrackMessage::Kind::kFrame) {
    smoothFrame(*message, out);
  } else if (ended) {
    out.output = OdometryOutput{};
    smooth_.finish(out.output);
  }
  out.published = wallSeconds();
  if (result != nullptr) results_.commitPush();
  if (message->kind == TrackMessage::Kind::kFrame) {
    addTime(times_, StageId::kTrim, measured([&] { smooth_.trim(); }), message->tracked.keyframe);
    publishWindow(*message);
  }
  tracked_ring_.pop();
  if (ended) smooth_done_.store(true, std::memory_order_release);
  return true;
}

void Wiring::smoothFrame(const TrackMessage& message, FrameResult& out) {
  const double begin = wallSeconds();
  out.step.frame = message.tracked.index;
  out.step.effort = smooth_effort_->give();
  out.smooth_level = smooth_effort_->level();
  const Spent spent = measured([&] {
    smoothing_.samples += takeSamples(imu_to_smooth_, message.tracked.stamp,
                                      [this](const ImuSample& sample) { smooth_.addImu(sample); });
    out.step.samples = smoothing_.samples;
    out.step.planes = planes_.refresh();
    if (out.step.planes != smoothing_.planes) {
      smoothing_.planes = out.step.planes;
      smooth_.take(planes_.value());
    }
    const double cpu = threadCpuSeconds();
    out.status = smooth_.step(message.tracked, out.step.effort, out.output);
    smooth_.fix(fix_.draft());
    fix_.publish();
    for (LiveOutlet* outlet : outlets_) {
      const OdometryOutput& output = out.output;
      outlet->frame.write({message.tracked.stamp, output.has_state, output.waiting_for, output.state.health,
                           output.state.epoch, output.statistics, wallSeconds() - message.host.arrival});
    }
    if (drag_) drag_(StageId::kSmooth, threadCpuSeconds() - cpu);
  });
  smooth_effort_->took({spent.wall, static_cast<int>(trackedWaiting()) - 1, begin - message.host.arrival});
  out.tracked = message.tracked;
  out.spent += spent;
  addTime(times_, StageId::kSmooth, spent, message.tracked.keyframe);
  if (to_recorder_) static_cast<void>(to_recorder_->smooth.tryPush(out.step));
}

// results, states, meshes, IMU -> log
bool Wiring::log() {
  bool any = false;
  const bool ended = smoothDone() && meshDone() && loopDone() && mapDone() && propagateDone();
  if (remarks_) any = remarks_(log_);
  if (to_loop_) {
    while (const LoopReport* report = to_loop_->reports.front()) {
      log_.onLoop(*report);
      to_loop_->reports.pop();
      any = true;
    }
  }
  if (meshes_) {
    while (const MeshResult* result = meshes_->front()) {
      log_.onMesh(*result);
      meshes_->pop();
      any = true;
    }
  }
  if (states_) {
    while (const NavState* state = states_->front()) {
      log_.onImuState(*state);
      states_->pop();
      any = true;
    }
  }
  const auto keep = [this](const ImuSample& sample) { log_.onImu(sample); };
  if (FrameResult* result = results_.front(); result != nullptr) {
    takeSamples(imu_to_log_, result->track_step.stamp, keep);
    log_.onResult(*result);
    if (arming_ != nullptr && result->kind == TrackMessage::Kind::kFrame) watchArming(*result);
    results_.pop();
    return true;
  }
  takeSurplus(imu_to_log_, keep);
  if (ended && !any && !log_done_) {
    if (local_mesh_.refresh() > 0) log_.onLocalMesh(local_mesh_.value());
    log_done_ = true;
  }
  return any;
}

void Wiring::watchArming(const FrameResult& result) {
  std::uint64_t lost = 0;
  if (recorder_ != nullptr) {
    lost = to_recorder_->imu.refused() + to_recorder_->track.refused() + to_recorder_->smooth.refused() +
           to_recorder_->mesh.refused() + to_recorder_->loop.refused();
    for (const Camera& camera : camera_) lost += camera.pool.refused(kRecordReads);
  }
  const bool running = recorder_ != nullptr && recorder_->running();
  const bool changed = arming_->update(result, sensorFacts(), running, lost, wallSeconds());
  const ArmingVerdict& verdict = arming_->verdict();
  told_.evaluated = monotonicNow();
  told_.health = result.output.state.health;
  told_.arming = verdict;
  if (changed) ++told_.arming_changes;
  for (LiveOutlet* outlet : outlets_) outlet->verdict.write(told_);
  if (!changed) return;
  std::string text = verdict.ready() ? "ready to arm" : "not ready to arm:";
  for (const MissingCondition& missing : verdict.missing) {
    text += std::string(" ") + missing.name() + " (" + missing.text.data() + ")";
  }
  log_.remark(result.track_step.stamp, text);
}

// everything -> recorder
bool Wiring::record() {
  if (recorder_ == nullptr) {
    record_done_ = true;
    return false;
  }
  const bool ended = smoothDone() && meshDone() && loopDone() && mapDone() && propagateDone();
  const bool any = recorder_->drain(*to_recorder_, {&camera_[0].pool, &camera_[1].pool});
  if (ended && !any && !record_done_) {
    recorder_->end(counters_.sensor.imu_samples, counters_.sensor.images);
    record_done_ = true;
  }
  return any;
}

void Wiring::addReservations(MemoryTable& table) const {
  const auto add = [&](const char* what, std::size_t bytes) {
    table.add(what, static_cast<std::int64_t>(bytes));
  };
  const auto between = [](const HeapMark& from, const HeapMark& to) {
    return static_cast<std::size_t>(std::max<std::int64_t>(to.bytes - from.bytes, 0));
  };
  std::size_t images = 0;
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    images += kImageSlots * static_cast<std::size_t>(rig_.camera[c].width() * rig_.camera[c].height());
  }
  add("image slots", images);
  add("propagation", sizeof(propagation_));
  add("tracking", sizeof(track_) + between(before_track_, before_smooth_));
  add("smoother", sizeof(smooth_) + between(before_smooth_, before_mesh_));
  if (mesh_) add("mesh", between(before_mesh_, before_loop_));
  std::size_t keyframe_images = 0;
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    keyframe_images +=
        KeyframePool::capacity() * static_cast<std::size_t>(rig_.camera[c].width() * rig_.camera[c].height());
  }
  std::size_t scenes = 0;
  for (std::size_t i = 0; map_ && i < ScenePool::capacity(); ++i) {
    const SceneSlot& slot = to_map_->scenes.slot(i);
    scenes += slot.depth.size() * sizeof(float) + slot.labels.size();
  }
  if (loop_) {
    add("loop closure", sizeof(LoopArrows) + between(before_loop_, before_map_));
  }
  if (map_) add("map", sizeof(MapArrows) + scenes + between(before_map_, after_map_));
  if (held_) add("frames that wait for labels", static_cast<std::size_t>(held_->bytes()));
  if (keyframe_images_) add("keyframes for loop closure and map", sizeof(KeyframePool) + keyframe_images);
  add("IMU rings", sizeof(ImuRing) * 4);
  add("tracked frames", sizeof(tracked_ring_));
  add("fixes and windows", sizeof(fix_) + sizeof(window_) + sizeof(window_to_mesh_) + sizeof(planes_));
  add("meshes for the log", sizeof(local_mesh_) + (meshes_ ? sizeof(MeshRing) : 0));
  add("results for the log", sizeof(results_) + sizeof(smoothing_) + (states_ ? sizeof(StateRing) : 0));
  if (to_recorder_) add("recorder's rings", sizeof(RecorderArrows));
}

void Wiring::addLosses(std::map<std::string, std::uint64_t>& losses) const {
  const auto note = [&](const char* what, std::uint64_t count) {
    if (count > 0) losses[what] += count;
  };
  note("imu_to_propagate", imu_to_propagate_.refused());
  note("imu_to_track", imu_to_track_.refused());
  note("imu_to_smooth", imu_to_smooth_.refused());
  note("imu_to_log", imu_to_log_.refused());
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    const std::string camera = "camera_" + std::to_string(c);
    note((camera + "_dropped").c_str(), counters_.sensor.images_dropped[c]);
    note((camera + "_wrong_size").c_str(), counters_.sensor.images_wrong_size[c]);
    note((camera + "_lost").c_str(), counters_.sensor.images_lost[c]);
    note((camera + "_unrecorded").c_str(), counters_.sensor.images_unrecorded[c]);
  }
  note("frames_dropped", counters_.track.dropped);
  note("frames_without_samples", counters_.track.without_samples);
  note("results_to_log", results_.refused());
  note("camera_0_unmeshed", counters_.sensor.images_unmeshed);
  if (meshes_) note("meshes_to_log", meshes_->refused());
  if (to_loop_) {
    note("keyframes_to_loop", to_loop_->keyframes.refused());
    note("keyframe_images_to_loop", to_loop_->images_dropped);
    note("loops_to_log", to_loop_->reports.refused());
  }
  if (to_map_) {
    note("frames_to_map", to_map_->frames.refused());
    note("frame_images_to_map", to_map_->images_dropped);
    note("frames_unmapped", counters_.map.without_image);
    note("scenes_to_map", counters_.sensor.scenes_dropped);
    note("scenes_to_track", to_map_->notes.refused());
    note("labels_wrong_size", counters_.sensor.labels_wrong_size);
    note("depths_wrong_size", counters_.sensor.depths_wrong_size);
  }
  if (held_) note("map_frames_without_labels", held_->counters().late + held_->counters().no_room);
  if (states_) note("states_to_log", states_->refused());
  if (to_recorder_) {
    note("imu_to_record", to_recorder_->imu.refused());
    note("propagate_steps_to_record", to_recorder_->propagate.refused());
    note("track_steps_to_record", to_recorder_->track.refused());
    note("smooth_steps_to_record", to_recorder_->smooth.refused());
    note("mesh_steps_to_record", to_recorder_->mesh.refused());
    note("loop_steps_to_record", to_recorder_->loop.refused());
  }
}

}  // namespace swiftlet
