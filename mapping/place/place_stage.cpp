#include "mapping/place/place_stage.hpp"

namespace swiftlet {

Status PlaceStage::step(const ImageView& image, const TrackedFrame& tracked, std::uint32_t epoch,
                        PlaceKeyframe& keyframe, PlaceStep& out) {
  out.query = {};
  out.bag.clear();
  out.slot = PlaceDatabase::kNoSlot;
  out.forgot = false;
  if (const Status status = extractor_.extract(image, camera_, tracked, keyframe); !status.ok())
    return status;
  keyframe.epoch = epoch;
  if (const Status status = vocabulary_.describe(keyframe, out.bag); !status.ok()) return status;
  const Status asked = database_.query(keyframe.stamp, epoch, out.bag, out.query);
  if (!asked.ok() && asked.code != StatusCode::kNotReady) return asked;
  const Status added = database_.add(keyframe.index, keyframe.stamp, epoch, out.bag, out.slot);
  out.forgot = added.code == StatusCode::kCapacityReached;
  return out.forgot ? okStatus() : added;
}

Status PlaceStage::keep(const PlaceKeyframe& keyframe, std::uint32_t& slot) {
  slot = PlaceDatabase::kNoSlot;
  BagOfWords bag;
  const Status described = vocabulary_.describe(keyframe, bag);
  return described.ok() ? database_.add(keyframe.index, keyframe.stamp, keyframe.epoch, bag, slot)
                        : described;
}

}  // namespace swiftlet
