// Images in, places out, with the shipped vocabulary.

#include <catch2/catch.hpp>
#include <memory>

#include "mapping/place/place_stage.hpp"
#include "tests/mapping/place_images.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

TEST_CASE("A scene seen again, turned and moved, is the first candidate") {
  constexpr int kWidth = 320, kHeight = 240, kScenes = 12;
  PlaceDatabaseSettings settings;
  settings.keyframes = kScenes;
  PlaceStage stage(pinhole(kWidth, kHeight), Vocabulary::shipped(), {}, settings);
  const auto keyframe = std::make_unique<PlaceKeyframe>();
  const auto out = std::make_unique<PlaceStep>();
  const auto tracked = std::make_unique<TrackedFrame>();
  for (int i = 0; i < kScenes; ++i) {
    tracked->index = static_cast<std::uint64_t>(i);
    tracked->stamp = Stamp{i * 1'000'000'000LL};
    const Picture picture = makePicture(kWidth, kHeight, 100 + static_cast<std::uint64_t>(i));
    REQUIRE(stage.step(picture.view(), *tracked, 3, *keyframe, *out).ok());
    CHECK(keyframe->epoch == 3);
    CHECK(stage.database().holds(out->slot, tracked->index, 3));
    CHECK_FALSE(out->forgot);
  }
  for (const int i : {0, 4, 9}) {
    tracked->index = static_cast<std::uint64_t>(100 + i);
    tracked->stamp = Stamp{(100 + i) * 1'000'000'000LL};
    const Picture picture =
        makePicture(kWidth, kHeight, 100 + static_cast<std::uint64_t>(i), 0.3, 8, -5, 1.05, 3);
    REQUIRE(stage.step(picture.view(), *tracked, 3, *keyframe, *out).ok());
    REQUIRE_FALSE(out->query.candidates.empty());
    CHECK(out->query.candidates[0].index == static_cast<std::uint64_t>(i));
    CHECK(out->forgot);
  }
  CHECK(stage.step({}, *tracked, 3, *keyframe, *out).code == StatusCode::kInvalidInput);
  CHECK(stage.database().size() == kScenes);
}
