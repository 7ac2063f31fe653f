#include "mapping/place/place_stage.hpp"

namespace swiftlet {

Status PlaceStage::step(const ImageView& image, const TrackedFrame& tracked, std::uint32_t epoch,
                        PlaceKeyframe& keyframe, PlaceStep& out) {
  out.clear();
  if (const Status status = extractor_.extract(image, camera_, tracked, keyframe); !status.ok())
    return status;
  keyframe.epoch = epoch;
  return step(keyframe, out);
}

Status PlaceStage::step(const PlaceKeyframe& keyframe, PlaceStep& out) {
  out.clear();
  if (const Status status = vocabulary_.describe(keyframe, out.bag); !status.ok()) return status;
  const Status asked = database_.query(keyframe.stamp, keyframe.epoch, out.bag, out.query);
  if (!asked.ok() && asked.code != StatusCode::kNotReady) return asked;
  return store(keyframe, out);
}

Status PlaceStage::keep(const PlaceKeyframe& keyframe, PlaceStep& out) {
  out.clear();
  const Status described = vocabulary_.describe(keyframe, out.bag);
  return described.ok() ? store(keyframe, out) : described;
}

Status PlaceStage::store(const PlaceKeyframe& keyframe, PlaceStep& out) {
  const Status added = database_.add(keyframe.index, keyframe.stamp, keyframe.epoch, out.bag, out.slot);
  out.forgot = added.code == StatusCode::kCapacityReached;
  return out.forgot ? okStatus() : added;
}

}  // namespace swiftlet
