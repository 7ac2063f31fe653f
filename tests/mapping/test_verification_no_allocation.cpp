// Matching, depths and verification allocate nothing after construction: malloc is counted.
#include <catch2/catch.hpp>
#include <cstddef>
#include <memory>
#include <vector>

#include "mapping/place/feature_depth.hpp"
#include "mapping/place/loop_verification.hpp"
#include "tests/mapping/loop_scene.hpp"
#include "tests/support/counted_malloc.hpp"

#ifdef SWIFTLET_COUNTS_MALLOC

using namespace swiftlet;              // NOLINT(google-build-using-namespace)
using namespace swiftlet::loop_scene;  // NOLINT(google-build-using-namespace)

TEST_CASE("verification of a loop does not allocate") {
  REQUIRE(test::mallocIsCounted());

  const Rig rig = makeRig();
  LoopVerificationSettings settings;
  const auto verifier = std::make_unique<LoopVerifier>(rig, settings);
  StereoDepth depth(rig);
  std::vector<std::uint8_t> pixels(752 * 480);
  Random random(1);
  for (std::uint8_t& p : pixels) p = static_cast<std::uint8_t>(random.below(256));
  const ImageView image{pixels.data(), 752, 480, 752};
  for (const double twins : {0.3, 1.0}) {
    SceneSettings scene_settings;
    scene_settings.twins = twins;
    // The second has no true match: every consensus is tried.
    scene_settings.common = twins < 1 ? 120 : 0;
    Scene scene = makeScene(scene_settings, 5);
    const auto result = std::make_unique<LoopVerification>();
    LoopPrior prior;
    prior.R_old_new = scene.T_old_new.rotation;
    std::size_t found = 0;
    const long before = test::malloc_calls;
    const Status verified = verifier->verify(scene.old_keyframe, scene.new_keyframe, prior, 1.0, *result);
    const Status filled = depth.fill(image, image, scene.old_keyframe, found);
    const long after = test::malloc_calls;
    CHECK(verified.ok());
    CHECK(filled.ok());
    CHECK(result->accepted() == (twins < 1));
    CHECK(after == before);
  }
}

#endif
