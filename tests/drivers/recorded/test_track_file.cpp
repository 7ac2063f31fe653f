#include "drivers/recorded/track_file.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

using test::anyContains;
using test::contains;

constexpr const char* kTrackHeader = "#timestamp [ns],id,camera,u [px],v [px],keyframe\n";

std::vector<TrackedFrame> readAllTracks(TrackReader& reader) {
  std::vector<TrackedFrame> frames;
  TrackedFrame frame;
  while (reader.next(frame)) frames.push_back(frame);
  return frames;
}

std::vector<TrackedFrame> readTracksText(const std::string& text) {
  TrackReader reader("tracks.csv", text);
  return readAllTracks(reader);
}

/// Frames with some, none and as many features as fit, seen by one camera or both.
std::vector<TrackedFrame> randomFrames() {
  Random random(3);
  std::vector<TrackedFrame> frames(30);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    TrackedFrame& frame = frames[f];
    frame.stamp.ns = 1403636579763555584 + 50'000'000LL * static_cast<std::int64_t>(f);
    frame.index = f;
    frame.keyframe = random.below(3) == 0;
    const std::uint32_t count = f == 4 ? 0 : f == 5 ? kMaxFeatures : random.below(20);
    for (std::uint32_t k = 0; k < count; ++k) {
      TrackedFeature feature;
      feature.id = 1000U * f + count - k;
      const std::uint32_t which = random.below(3);
      feature.seen = {which != 1, which != 0};
      for (std::size_t c = 0; c < kMaxCameras; ++c) {
        if (!feature.seen[c]) continue;
        feature.pixel[c] = Eigen::Vector2d(random.uniform(-1, 752), random.uniform(0, 480)).cast<float>();
        frame.camera_present[c] = true;
      }
      REQUIRE(frame.features.tryPushBack(feature));
    }
  }
  return frames;
}

TEST_CASE("tracks out and in again are the same to the bit", "[track_file]") {
  const test::TempFolder folder;
  const std::string path = (folder.path() / "tracks.csv").string();
  const std::vector<TrackedFrame> truth = randomFrames();
  TrackWriter writer(path);
  for (const TrackedFrame& frame : truth) writer.write(frame);
  writer.close();
  TrackReader reader(path);
  const std::vector<TrackedFrame> got = readAllTracks(reader);
  CHECK(reader.hasKeyframes());
  CHECK(reader.surplus() == 0);
  CHECK(reader.warnings().empty());
  REQUIRE(got.size() == truth.size());
  for (std::size_t f = 0; f < got.size(); ++f) {
    CHECK(got[f].stamp == truth[f].stamp);
    CHECK(got[f].index == truth[f].index);
    CHECK(got[f].keyframe == truth[f].keyframe);
    CHECK(got[f].camera_present == truth[f].camera_present);
    REQUIRE(got[f].features.size() == truth[f].features.size());
    for (std::size_t k = 0; k < got[f].features.size(); ++k) {
      const TrackedFeature& a = got[f].features[k];
      const TrackedFeature& b = truth[f].features[k];
      CHECK(a.id == b.id);
      CHECK(a.seen == b.seen);
      for (std::size_t c = 0; c < kMaxCameras; ++c) {
        if (a.seen[c]) CHECK(a.pixel[c] == b.pixel[c]);
      }
    }
  }
  const TrackFileFacts facts = surveyTrackFile(path);
  CHECK(facts.frames == truth.size());
  CHECK(facts.cameras == 2);
}

TEST_CASE("both cameras' sightings of a landmark are one feature, in any order of lines", "[track_file]") {
  const auto frames = readTracksText(std::string(kTrackHeader) +
                                     "100,7,1,30,40,1\n100,8,0,1,2,1\n100,7,0,31,41,1\n"
                                     "200,,,,,0\n"
                                     "300,8,0,3,4,0\n");
  REQUIRE(frames.size() == 3);
  REQUIRE(frames[0].features.size() == 2);
  CHECK(frames[0].features[0].id == 7);
  CHECK(frames[0].features[0].pixel[0] == Eigen::Vector2f(31, 41));
  CHECK(frames[0].features[0].pixel[1] == Eigen::Vector2f(30, 40));
  CHECK_FALSE(frames[0].features[1].seen[1]);
  CHECK(frames[0].keyframe);
  CHECK(frames[1].features.empty());
  CHECK_FALSE(frames[1].camera_present[0]);
  CHECK_FALSE(frames[2].camera_present[1]);
}

TEST_CASE("the keyframe column and the units may be left out", "[track_file]") {
  const std::string text = "timestamp, id, camera, u, v\r\n100,1,0,10.5,20.5\r\n200,,,,\r\n";
  TrackReader reader("tracks.csv", text);
  CHECK_FALSE(reader.hasKeyframes());
  const auto frames = readAllTracks(reader);
  REQUIRE(frames.size() == 2);
  CHECK(frames[0].features.size() == 1);
  CHECK(reader.cameras() == 1);
}

TEST_CASE("what is malformed is refused with line, field and remedy", "[track_file]") {
  struct Case {
    const char* rows;
    int line;
    const char* field;
    const char* message;
  };
  const std::vector<Case> cases = {
      {"100,1,0,nan,2,1\n", 2, "u", "`nan` is not finite"},
      {"100,1,0,1,inf,1\n", 2, "v", "`inf` is not finite"},
      {"100,1,0,1,2,1\n200,1,0,1,left,1\n", 3, "v", "`left` is not a number"},
      {"100,1,0,1,,1\n", 2, "v", "`` is not a number"},
      {"100,1,0,1e6,1,1\n", 2, "u", "far outside any image"},
      {"100,1,0,1,2\n", 2, "row", "5 columns, but the header has 6"},
      {"100,1,0,1,2,1,9\n", 2, "row", "7 columns, but the header has 6"},
      {"1.5,1,0,1,2,1\n", 2, "timestamp", "`1.5` is not a whole number"},
      {"-5,1,0,1,2,1\n", 2, "timestamp", "-5 is not within 0"},
      {"200,1,0,1,2,1\n\n100,1,0,1,2,1\n", 4, "timestamp", "100 is earlier than 200"},
      {"100,-1,0,1,2,1\n", 2, "id", "-1 is not within 0"},
      {"100,x,0,1,2,1\n", 2, "id", "`x` is not a whole number"},
      {"100,1,2,1,2,1\n", 2, "camera", "2 is not within 0 and 1"},
      {"100,1,0,1,2,\n", 2, "keyframe", "`` is not a whole number"},
      {"100,1,0,1,2,7\n", 2, "keyframe", "7 is not within 0 and 1"},
      {"100,1,0,1,2,1\n100,2,0,1,2,0\n", 3, "keyframe", "differs"},
      {"100,1,0,1,2,1\n100,1,0,3,4,1\n", 3, "id", "1 appears twice in camera 0"},
      {"", 0, "", "holds no tracks"},
  };
  for (const Case& bad : cases) {
    INFO(bad.rows);
    const InputError error = test::errorOf([&] { readTracksText(std::string(kTrackHeader) + bad.rows); });
    CHECK(error.line == bad.line);
    CHECK(error.field == bad.field);
    CHECK(contains(error.message, bad.message));
    CHECK_FALSE(error.remedy.empty());
    CHECK(contains(error.what(), "tracks.csv"));
  }
  const std::string overlong = std::string(kTrackHeader) + "100,1,0,1," + std::string(5000, '1') + ",1\n";
  CHECK(test::errorOf([&] { readTracksText(overlong); }).line == 2);
}

TEST_CASE("another header, or none, is refused", "[track_file]") {
  const auto headerError = [](const std::string& text) {
    return test::errorOf([&] { readTracksText(text); });
  };
  const InputError poses = headerError("1.0 0 0 0 0 0 0 1\n2.0 0 0 0 0 0 0 1\n");
  CHECK(poses.line == 1);
  CHECK(poses.field == "header");
  CHECK(contains(poses.remedy, "#timestamp [ns],id,camera"));
  CHECK(contains(headerError("#timestamp [s],id,camera,u,v\n1,1,0,1,2\n").message,
                 "column 1 is `timestamp [s]`, not `timestamp [ns]`"));
  CHECK(contains(headerError("\n#timestamp [ns],track,u0 [px],v0 [px],u1 [px],v1 [px]\n").message,
                 "column 2 is `track`, not `id`"));
  CHECK(headerError("\n#timestamp [ns],track\n").line == 2);
  CHECK(contains(headerError("#timestamp,id,camera,u\n1,1,0,1\n").message, "has 4 columns"));
  CHECK(contains(headerError("#timestamp,id,camera,u,v,keyframe,w\n").message, "has 7 columns"));
  CHECK(headerError("").field == "header");
  CHECK_THROWS_AS(TrackReader("no/such/tracks.csv"), InputError);
}

TEST_CASE("tracks beyond what a frame holds are counted and told", "[track_file]") {
  std::string text = kTrackHeader;
  for (const int stamp : {100, 200}) {
    for (std::size_t i = 0; i < kMaxFeatures + 3; ++i) {
      for (const char* camera : {"0", "1"}) {
        text += std::to_string(stamp) + "," + std::to_string(i) + "," + camera + ",1,2,0\n";
      }
    }
  }
  TrackReader reader("tracks.csv", text);
  const auto frames = readAllTracks(reader);
  REQUIRE(frames.size() == 2);
  CHECK(frames[1].features.size() == kMaxFeatures);
  CHECK(frames[1].features.back().seen[1]);
  CHECK(reader.surplus() == 6);
  CHECK(anyContains(reader.warnings(), "frame at 200 has 403 tracks, only the first 400 are used"));
}

TEST_CASE("a folder without images is read with its tracks", "[track_file]") {
  const test::AslFixture fixture(4);
  fs::create_directories(fixture.mav0() / "tracks0");
  const fs::path tracks = fixture.mav0() / "tracks0" / "data.csv";
  test::writeText(tracks, std::string(kTrackHeader) + std::to_string(fixture.stamp(0)) + ",1,0,1,2,1\n");
  CHECK(openLog(fixture.folder.path().string())->trackFile().empty());  // images come first
  LogOptions without;
  without.without_images = true;
  const auto samples_only = openLog(fixture.folder.path().string(), without);
  CHECK(samples_only->imageCount() == 0);
  CHECK(test::readAll(*samples_only).frames.empty());
  for (const char* camera : {"cam0", "cam1"}) {
    fs::remove_all(fixture.mav0() / camera / "data");
    fs::remove(fixture.mav0() / camera / "data.csv");
  }
  const auto log = openLog(fixture.folder.path().string());
  CHECK(log->trackFile() == tracks.string());
  CHECK(log->rig().camera_count == 2);
  CHECK(log->warnings() == samples_only->warnings());
  CHECK(test::readAll(*log).samples.size() > 10);
  fs::remove(tracks);
  const InputError error = test::errorOf([&] { openLog(fixture.folder.path().string()); });
  CHECK(contains(error.remedy, "tracks0/data.csv"));
}

}  // namespace
}  // namespace swiftlet
