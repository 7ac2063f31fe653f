#pragma once
// From a keyframe's image to the earlier keyframes that may show the same place: features, words, query, and
// then the keyframe joins the database.
//
// A stage of the low-priority side: memory fixed by the constructor, no clock, no randomness; the same
// keyframes give the same bytes. Keyframes come in the order of time. The keyframe itself is not kept: who
// verifies candidates keeps it at `slot`, which is its own until the database gives it to another. Cost: some
// 4 ms for 752 x 480 and 2 000 keyframes (docs/place.md).

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
  bool forgot = false;  ///< another keyframe left for this one

  void clear() {
    query = {};
    bag.clear();
    slot = PlaceDatabase::kNoSlot;
    forgot = false;
  }
};

class PlaceStage {
 public:
  /// `vocabulary` outlives the stage.
  PlaceStage(const CameraModel& camera, const Vocabulary& vocabulary,
             const PlaceExtractorSettings& extractor = {}, const PlaceDatabaseSettings& database = {})
      : camera_(camera),
        vocabulary_(vocabulary),
        extractor_(camera.width(), camera.height(), extractor),
        database_(vocabulary.words(), database) {}

  /// `image`: camera 0's; `tracked`: the keyframe's stamp, index and tracks. Not ok where the image gives no
  /// features or the vocabulary is empty: then nothing was stored. Without candidates it is ok.
  [[nodiscard]] Status step(const ImageView& image, const TrackedFrame& tracked, std::uint32_t epoch,
                            PlaceKeyframe& keyframe, PlaceStep& out);

  /// The same for a keyframe whose features were extracted before.
  [[nodiscard]] Status step(const PlaceKeyframe& keyframe, PlaceStep& out);
  /// Stores such a keyframe without a query.
  [[nodiscard]] Status keep(const PlaceKeyframe& keyframe, PlaceStep& out);
  /// The keyframe of a slot is needed no more.
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
