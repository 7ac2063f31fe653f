#include "firmware_host/graph/sensor_node.hpp"

#include <algorithm>

#include "firmware_host/interfaces/packed_copy.hpp"
#include "firmware_host/interfaces/run_listener.hpp"
#include "firmware_host/realtime/memory_lock.hpp"

namespace swiftlet {

namespace {

/// A stamp that was held out does not show where the stream is.
void note(SensorNews& news, Stamp stamp, double host_arrival, bool held_out) {
  if (!held_out) {
    if (news.messages > 0 && stamp <= news.newest) ++news.reversed_stamps;
    news.newest = stamp;
  }
  ++news.messages;
  news.arrival = Stamp{} + Duration::fromSeconds(host_arrival);
}

}  // namespace

SensorNode::SensorNode(const GraphContext& context)
    : Node("sensor", Rank::kSensor),
      context_(context),
      view_(imageFeedOf(context.options.outlets)),
      quotas_{kTrackQuota, kMeshQuota, kRecordQuota, view_ != nullptr ? kViewQuota : 0},
      imu_guard_(context.noise.rate_hz) {
  for (std::size_t c = 0; c < context.rig.camera_count; ++c) {
    camera_[c].pool = std::make_shared<ImagePool>(quotas_);
    if (view_ != nullptr) view_->pool[c] = camera_[c].pool;
    for (std::size_t i = 0; i < ImagePool::slotsFor(quotas_); ++i) {
      camera_[c].pool->slot(i).pixels =
          std::make_unique_for_overwrite<std::uint8_t[]>(pixelsOf(context.rig)[c]);
    }
  }
}

void SensorNode::touchImages() {
  const std::array<std::size_t, kMaxCameras> pixels = pixelsOf(context_.rig);
  for (std::size_t c = 0; c < context_.rig.camera_count; ++c) {
    for (std::size_t i = 0; i < ImagePool::slotsFor(quotas_); ++i)
      touchPages(camera_[c].pool->slot(i).pixels.get(), pixels[c]);
  }
}

void SensorNode::scenesTo(SceneIn& in) {
  scenes_ = std::make_unique<ScenePool>(ScenePool::Quotas{kMapQuota});
  const CameraModel& camera = context_.rig.camera[0];
  for (std::size_t i = 0; i < ScenePool::capacity(); ++i) {
    SceneSlot& slot = scenes_->slot(i);
    if (context_.options.depth_sensor != nullptr) {
      slot.depth.resize(context_.options.depth_sensor->camera.pixels());
    }
    if (context_.settings.map_stage.labels) {
      slot.labels.resize(static_cast<std::size_t>(camera.width() * camera.height()));
    }
  }
  in.lendFrom(*scenes_);
  scene_in_ = &in;
  connect(*this, in);
}

void SensorNode::takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) {
  const bool held_out = imu_guard_.check(sample.stamp) == StampVerdict::kHeld;
  const ImuArrival message{sample, ++counters_.samples, imu_guard_.timeline(), arrival, host};
  imu_as_delivered.send(message);
  if (held_out) {
    ++counters_.samples_held_out;
  } else {
    imu.send(message);
    newest_imu_.store(imu_guard_.time().newest.ns);
    // Written after the sample: an image of a new time line then finds its first sample in the queues.
    imu_time_.write(imu_guard_.time());
  }
  note(imu_sensed_.news, sample.stamp, host.arrival, held_out);
  imu_sensed_.equal = equal_readings_.note(sample);
  imu_news_.write(imu_sensed_);
}

void SensorNode::takeImage(const CameraFrame& image, const HostTimes& host) {
  if (image.image.empty()) return;
  if (image.camera >= context_.rig.camera_count) return;
  Camera& camera = camera_[image.camera];
  const CameraModel& model = context_.rig.camera[image.camera];
  if (image.image.width != model.width() || image.image.height != model.height()) {
    ++counters_.images_wrong_size[image.camera];
    return;
  }
  const SlotHandle handle = camera.pool->tryAcquire();
  if (!handle.valid()) {
    ++counters_.images_lost[image.camera];
    return;
  }
  ImuTime imu_time;
  static_cast<void>(imu_time_.read(imu_time));
  const bool held_out =
      camera.guard.check(image.stamp + context_.rig.camera_to_imu_shift, imu_time) == StampVerdict::kHeld;
  ImageSlot& slot = camera.pool->fill(handle);
  slot.frame = image;
  slot.frame.timeline = imu_time.timeline;
  slot.frame.number = ++counters_.images[image.camera];
  slot.host = host;
  packedCopy(image.image, slot.pixels.get());
  slot.frame.image = {slot.pixels.get(), image.image.width, image.image.height, image.image.width};
  if (camera.record != nullptr) camera.record->hand(handle);
  if (held_out) {
    ++counters_.images_held_out[image.camera];
  } else {
    if (camera.track != nullptr) camera.track->hand(handle);
    if (camera.mesh != nullptr) camera.mesh->hand(handle);
    if (view_ != nullptr) view_->hand(image.camera, handle, image.stamp);
  }
  camera.pool->finish(handle);
  note(camera.sensed, image.stamp, host.arrival, held_out);
  camera.news.write(camera.sensed);
}

void SensorNode::takeScene(const SceneImages& scene) {
  if (scene_in_ == nullptr || scene.empty()) return;
  const SlotHandle handle = scenes_->tryAcquire();
  if (!handle.valid()) {
    scene_in_->miss();
    return;
  }
  SceneSlot& slot = scenes_->fill(handle);
  fillScene(scene, slot);
  if (!slot.images.empty()) {
    scene_in_->hand(handle);
    scene_notes.send({scene.stamp, slot.images.depth.depth != nullptr, !slot.images.labels.empty()});
  }
  scenes_->finish(handle);
}

void SensorNode::fillScene(const SceneImages& from, SceneSlot& slot) {
  slot.images = SceneImages{};
  slot.images.stamp = from.stamp;
  if (from.depth.depth != nullptr && !slot.depth.empty()) {
    if (from.depth.camera.pixels() == slot.depth.size()) {
      std::copy_n(from.depth.depth, slot.depth.size(), slot.depth.begin());
      slot.images.depth = from.depth;
      slot.images.depth.depth = slot.depth.data();
    } else {
      ++counters_.depths_wrong_size;
    }
  }
  if (!from.labels.empty() && !slot.labels.empty()) {
    const CameraModel& camera = context_.rig.camera[0];
    if (from.labels.width == camera.width() && from.labels.height == camera.height()) {
      slot.images.labels = packedCopy(from.labels, slot.labels.data());
    } else {
      ++counters_.labels_wrong_size;
    }
  }
}

void SensorNode::look(FlightFacts& facts) const {
  ImuNews of_imu;
  if (imu_news_.read(of_imu) != 0) {
    facts.imu = of_imu.news;
    facts.equal_samples = of_imu.equal;
  }
  for (std::size_t c = 0; c < kMaxCameras; ++c) static_cast<void>(camera_[c].news.read(facts.camera[c]));
}

void SensorNode::report(RunStatistics& statistics) const {
  statistics.imu_samples = counters_.samples;
  for (const std::uint64_t images : counters_.images) statistics.images += images;
}

void SensorNode::addLosses(std::map<std::string, std::uint64_t>& losses) const {
  const auto note = [&](const std::string& what, std::uint64_t count) {
    if (count > 0) losses[what] += count;
  };
  note("imu_stamps_held_out", counters_.samples_held_out);
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    const std::string camera = "camera_" + std::to_string(c);
    note(camera + "_stamps_held_out", counters_.images_held_out[c]);
    note(camera + "_wrong_size", counters_.images_wrong_size[c]);
    note(camera + "_lost", counters_.images_lost[c]);
  }
  note("labels_wrong_size", counters_.labels_wrong_size);
  note("depths_wrong_size", counters_.depths_wrong_size);
}

}  // namespace swiftlet
