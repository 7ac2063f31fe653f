#include "drivers/recorded/track_file.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet {
namespace {

using test::anyContains;

std::vector<TrackRecord> readAllTracks(TrackReader& reader) {
  std::vector<TrackRecord> records;
  TrackRecord record;
  while (reader.next(record)) records.push_back(record);
  return records;
}

TEST_CASE("tracks out and in again are the same to the bit", "[track_file]") {
  const test::TempFolder folder;
  const std::string path = (folder.path() / "tracks.csv").string();
  Random random(3);
  std::vector<TrackRecord> truth;
  TrackWriter writer(path);
  for (int f = 0; f < 30; ++f) {
    TrackRecord record;
    record.stamp.ns = 1403636579763555584 + 50'000'000LL * f;
    const std::uint32_t count = f == 4 ? 0 : random.below(20);
    for (std::uint32_t k = 0; k < count; ++k) {
      TrackedFeature feature;
      feature.id = 100U * static_cast<unsigned>(f) + k;
      const std::uint32_t which = random.below(3);
      feature.seen = {which != 1, which != 0};
      for (std::size_t c = 0; c < 2; ++c) {
        if (feature.seen[c])
          feature.pixel[c] = {static_cast<float>(random.uniform(-1, 752)),
                              static_cast<float>(random.uniform(0, 480))};
      }
      record.features.push_back(feature);
    }
    writer.write(record);
    truth.push_back(record);
  }
  writer.close();
  LogCounters counters;
  LogWarnings warnings;
  TrackReader reader(path, counters, warnings);
  const std::vector<TrackRecord> got = readAllTracks(reader);
  REQUIRE(got.size() == truth.size());
  for (std::size_t f = 0; f < got.size(); ++f) {
    CHECK(got[f].stamp == truth[f].stamp);
    REQUIRE(got[f].features.size() == truth[f].features.size());
    for (std::size_t k = 0; k < got[f].features.size(); ++k) {
      const TrackedFeature& a = got[f].features[k];
      const TrackedFeature& b = truth[f].features[k];
      CHECK(a.id == b.id);
      CHECK(a.seen == b.seen);
      for (std::size_t c = 0; c < 2; ++c) {
        if (a.seen[c]) CHECK(a.pixel[c] == b.pixel[c]);
      }
    }
  }
  CHECK(warnings.lines().empty());
}

TEST_CASE("bad rows of track files are skipped, counted and named", "[track_file]") {
  const std::string text =
      "#timestamp [ns],track,u0 [px],v0 [px],u1 [px],v1 [px]\n"
      "100,1,10.5,20.5,,\n"
      "100,1,11.0,21.0,,\n"  // the id again
      "100,2,,,,\n"          // nobody saw it
      "100,-3,1,1,,\n"       // no id
      "100,4,10.0,,,\n"      // half a pixel
      "100,5,,,30.0,40.0\n"
      "90,6,1,1,,\n"  // backwards
      "200,1,12.0,22.0,9.0,22.0\n"
      "200,7,1,1,1,1\n200,8,1,1,1,1\n200,9,1,1,1,1\n200,10,1,1,1,1\n";
  std::string many = text;
  for (int i = 0; i < 60; ++i) many += "300," + std::to_string(i) + ",1,1,1,1\n";
  LogCounters counters;
  LogWarnings warnings;
  TrackReader reader("tracks.csv", many, counters, warnings);
  const std::vector<TrackRecord> got = readAllTracks(reader);
  REQUIRE(got.size() == 3);
  REQUIRE(got[0].features.size() == 2);
  CHECK(got[0].features[0].pixel[0] == Eigen::Vector2f(10.5F, 20.5F));
  CHECK(got[0].features[1].id == 5);
  CHECK(!got[0].features[1].seen[0]);
  CHECK(counters.bad_rows == 5);
  CHECK(anyContains(warnings.lines(), "tracks.csv:3: track: twice in one frame"));
  CHECK(anyContains(warnings.lines(), "tracks.csv:6: v0"));
}

TEST_CASE("another file in a track file's place is refused", "[track_file]") {
  LogCounters counters;
  LogWarnings warnings;
  TrackReader reader("poses.tum", "1.0 0 0 0 0 0 0 1\n2.0 0 0 0 0 0 0 1\n", counters, warnings);
  CHECK(test::errorOf([&] { readAllTracks(reader); }).line == 1);
}

}  // namespace
}  // namespace swiftlet
