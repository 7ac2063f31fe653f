#pragma once
// Finds the earlier keyframes that may show the same place as a keyframe's image: features, words, query;
// then adds the keyframe to the database.
//
// A low-priority stage: memory fixed by the constructor, no clock, no randomness; the same keyframes give the
// same bytes. Keyframes must come in order of time. The stage does not keep the keyframe itself: the caller
// that verifies candidates keeps it by `slot`, which belongs to the keyframe until the database reuses it.
// Cost: some 4 ms for 752 x 480 and 2000 keyframes (docs/place.md).

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "mapping/place/place_database.hpp"
#include "mapping/place/place_extractor.hpp"
#include "mapping/place/vocabulary.hpp"

namespace swiftlet {

struct PlaceStep {
  PlaceQuery query;
  BagOfWords bag;
  std::uint32_t slot = PlaceDatabase::kNoSlot;
  bool forgot = false;  ///< another keyframe was removed for this one

  void clear() {
    query = {};
    bag.clear();
    slot = PlaceDatabase::kNoSlot;
    forgot = false;
  }
};

class PlaceStage {
 public:
  /// `vocabulary` must outlive the stage.
  PlaceStage(const CameraModel& camera, const Vocabulary& vocabulary,
             const PlaceExtractorSettings& extractor = {}, const PlaceDatabaseSettings& database = {})
      : camera_(camera),
        vocabulary_(vocabulary),
        extractor_(camera.width(), camera.height(), extractor),
        database_(vocabulary.words(), database) {}

  /// `image`: of camera 0. `tracked`: the keyframe's stamp, index and tracks. Not ok, and nothing stored, if
  /// the image has no features or the vocabulary is empty. Ok without candidates.
  [[nodiscard]] Status step(const ImageView& image, const TrackedFrame& tracked, std::uint32_t epoch,
                            PlaceKeyframe& keyframe, PlaceStep& out);

  /// The same for a keyframe whose features are already extracted.
  [[nodiscard]] Status step(const PlaceKeyframe& keyframe, PlaceStep& out);
  /// Stores such a keyframe without a query.
  [[nodiscard]] Status keep(const PlaceKeyframe& keyframe, PlaceStep& out);
  /// Removes the keyframe of a slot.
  void forget(std::uint32_t slot) { static_cast<void>(database_.forget(slot)); }
  [[nodiscard]] const PlaceDatabase& database() const { return database_; }

 private:
  [[nodiscard]] Status store(const PlaceKeyframe& keyframe, PlaceStep& out);

  CameraModel camera_;
  const Vocabulary& vocabulary_;
  PlaceExtractor extractor_;
  PlaceDatabase database_;
};

}  // namespace swiftlet
