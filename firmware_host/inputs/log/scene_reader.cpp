#include "firmware_host/inputs/log/scene_reader.hpp"

#include "firmware_host/interfaces/packed_copy.hpp"

namespace swiftlet {

SceneReader::SceneReader(const std::string& log, const Calibration& calibration, const Wanted& wanted) {
  const CameraModel& camera = calibration.rig.camera[0];
  if (wanted.depth) depth_.emplace(log, warnings_, calibration.T_body_filebody);
  if (wanted.labels) labels_.emplace(log, ImageSize{camera.width(), camera.height()}, warnings_);
  if (!depth_ || depth_->empty()) return;
  sensor_.emplace();
  sensor_->camera = depth_->sensor().camera;
  sensor_->T_body_camera = depth_->sensor().T_body_camera;
}

SceneImages SceneReader::at(Stamp stamp) {
  Slot& slot = slots_[next_];
  SceneImages scene;
  scene.stamp = stamp;
  if (depth_) {
    scene.depth = depth_->at(stamp);
    if (scene.depth.depth != nullptr) {
      slot.depth.assign(scene.depth.depth, scene.depth.depth + scene.depth.camera.pixels());
      scene.depth.depth = slot.depth.data();
    }
  }
  if (labels_) {
    const ImageView image = labels_->at(stamp);
    if (!image.empty()) {
      slot.labels.resize(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
      scene.labels = packedCopy(image, slot.labels.data());
    }
  }
  if (!scene.empty()) next_ = (next_ + 1) % kSlots;
  return scene;
}

}  // namespace swiftlet
