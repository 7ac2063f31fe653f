// Recordings cut off, overwritten and mixed up: what comes back is exactly what lies before the damage, or
// a refusal that says where it is.

#include <algorithm>
#include <catch2/catch.hpp>
#include <span>

#include "drivers/device/byte_fields.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"
#include "tests/drivers/recorded/recording_fixture.hpp"
#include "tests/support/long_run.hpp"

namespace swiftlet::test {
namespace {

/// The segments up to byte `at`; the rest does not exist.
std::vector<Bytes> truncated(const RecordedScript& recorded, std::uint64_t at) {
  std::vector<Bytes> segments;
  for (std::size_t i = 0; i < recorded.segments.size() && recorded.begin(i) < at; ++i) {
    const std::uint64_t room = at - recorded.begin(i);
    segments.push_back(recorded.segments[i]);
    if (room < segments.back().size()) segments.back().resize(static_cast<std::size_t>(room));
  }
  return segments;
}

/// Opens them and compares with the first `whole` records (the run's header and the end mark counted).
std::string outcome(const RecordedScript& recorded, std::vector<Bytes> segments, std::size_t whole) {
  RecordingSource source(inMemory(segments), {});
  const std::size_t entries = std::min(whole - 1, recorded.script.size());
  const std::string found = difference(source, recorded.script, entries);
  if (!found.empty()) return found;
  if (source.cut().reason != nullptr) {
    // Behind the last whole record, or behind the header of a segment that holds no whole one.
    const std::uint64_t segment = recorded.begin(source.cut().segment);
    const std::uint64_t end = recorded.ends[whole - 1];
    const bool at_end = segment + source.cut().offset == end;
    const bool behind_header = segment == end && source.cut().offset == kSegmentHeaderBytes;
    if (!at_end && !behind_header) return "cut at another byte";
  }
  const bool told = anyContains(source.warnings(), "byte ");
  return told == (whole < recorded.ends.size() || source.cut().reason != nullptr)
             ? ""
             : "said nothing, or too much";
}

InputError refusal(const std::vector<Bytes>& segments) {
  return errorOf([&] { RecordingSource(inMemory(segments), {}); });
}

/// A segment's header again, with a sound checksum.
void changeHeader(Bytes& segment, void (*change)(SegmentHeader&)) {
  const std::span<std::uint8_t, kSegmentHeaderBytes> bytes(segment.data(), kSegmentHeaderBytes);
  SegmentHeader header;
  (void)decode(bytes, header);
  change(header);
  encode(header, bytes);
}

}  // namespace

TEST_CASE("a recording cut off at any byte gives every record before it") {
  const RecordedScript recorded = recordScript(21, 60, 1500);
  REQUIRE(recorded.segments.size() > 3);
  std::size_t refused = 0;
  for (std::uint64_t at = 0; at < recorded.size(); ++at) {
    INFO("cut at byte " << at);
    const std::size_t whole = recorded.wholeBefore(at);
    if (whole == 0) {
      const std::vector<Bytes> segments = at == 0 ? std::vector<Bytes>(1) : truncated(recorded, at);
      const InputError error = refusal(segments);
      if (contains(error.what(), "recording_000000.swr: byte ") && !error.remedy.empty()) ++refused;
      continue;
    }
    const std::string found = outcome(recorded, truncated(recorded, at), whole);
    if (!found.empty()) FAIL(found);
  }
  CHECK(refused == recorded.ends.front());
  CHECK(outcome(recorded, recorded.segments, recorded.ends.size()).empty());
}

TEST_CASE("a recording that is only cut off has lost nothing: it can be repeated up to the cut") {
  const TempFolder folder;
  const bool loses = GENERATE(false, true);
  {
    RecordingWriter writer(folder.path().string(), wildHeader(RecordOrder::kAsWritten));
    REQUIRE(writer.imu({{7}, {}, {}}, {}).ok());
    if (loses) REQUIRE(writer.loss(RecordKind::kMapStep, 4).ok());
    for (int i = 0; i < 3; ++i) REQUIRE(writer.mapStep({}, {}).ok());
    // No end: as after a kill.
  }
  std::vector<Bytes> segments = readSegments(folder.path());
  segments[0].resize(segments[0].size() - 5);
  RecordingSource source(inMemory(segments), {});
  CHECK(source.steps().map.size() == 2);
  CHECK(anyContains(source.warnings(), "the recording ends here"));
  const auto loss = source.firstLoss();
  CHECK(loss.has_value() == loses);
  if (loss)
    CHECK(contains(loss->message, "4 mapping steps were lost while recording, after number 0, at stamp 7"));
}

TEST_CASE("a mapping step whose pixels are not what it says is refused with the place") {
  const TempFolder folder;
  const RecordingHeader header = wildHeader(RecordOrder::kAsWritten);
  const std::vector<float> depth(header.depth_sensor->camera.pixels());
  {
    RecordingWriter writer(folder.path().string(), header);
    SceneImages scene;
    scene.depth = *header.depth_sensor;
    scene.depth.depth = depth.data();
    REQUIRE(writer.mapStep({}, scene).ok());
    REQUIRE(writer.end().ok());
  }
  const Bytes sound = readSegments(folder.path())[0];
  SegmentHeader segment;
  (void)decode(std::span(sound).first<kSegmentHeaderBytes>(), segment);
  const std::uint32_t run = runChecksum(segment.run);
  std::size_t at = kSegmentHeaderBytes;
  RecordHeader record;
  REQUIRE(decode(std::span(sound).subspan(at).first<kRecordHeaderBytes>(), run, record));
  at += kRecordHeaderBytes + paddedSize(record.length);
  REQUIRE(decode(std::span(sound).subspan(at).first<kRecordHeaderBytes>(), run, record));
  REQUIRE(record.kind == RecordKind::kMapStep);
  struct Change {
    std::size_t at;  ///< byte of the step
    std::int32_t value;
  };
  // Depth of another width, of a negative and of an enormous size, labels that are not there, an end of 2.
  for (const auto& [byte, value] :
       {Change{64, 15}, Change{64, -16}, Change{68, 1 << 30}, Change{72, 1}, Change{76, -1}, Change{40, 2}}) {
    Bytes bytes = sound;
    const std::size_t payload = at + kRecordHeaderBytes;
    LittleFieldWriter(std::span(bytes).subspan(payload + byte)).i32(value);
    record.payload_crc = crc32c(run, std::span(bytes).subspan(payload, paddedSize(record.length)));
    encode(record, run, std::span<std::uint8_t, kRecordHeaderBytes>(bytes.data() + at, kRecordHeaderBytes));
    const InputError error = refusal({bytes});
    INFO("byte " << byte << ": " << error.what());
    CHECK(error.field == "byte " + std::to_string(at));
    CHECK(contains(error.message, "a mapping step with depth of"));
  }
}

TEST_CASE("a tail of zeros or of pages that were half written is cut off") {
  const RecordedScript recorded = recordScript(22, 60, GENERATE(std::size_t{1500}, std::size_t{1} << 30U));
  Random random(5);
  constexpr std::uint64_t kPage = 512;
  for (int round = 0; round < 600; ++round) {
    std::uint64_t from =
        recorded.ends[0] + random.below(static_cast<std::uint32_t>(recorded.size() - recorded.ends[0]));
    // A segment's header lies within one page.
    for (std::size_t i = 0; i < recorded.segments.size(); ++i) {
      if (from > recorded.begin(i) && from < recorded.begin(i) + kSegmentHeaderBytes)
        from = recorded.begin(i);
    }
    const bool all = round % 3 == 0;
    RecordedScript damaged;
    damaged.segments = recorded.segments;
    std::uint64_t first_changed = recorded.size();
    bool zero = true;
    std::size_t segment = 0;
    for (std::uint64_t at = from; at < recorded.size(); ++at) {
      while (at >= recorded.begin(segment + 1)) ++segment;
      if ((at - recorded.begin(segment)) % kPage == 0 && !all) zero = random.below(2) == 0;
      if (!zero || damaged.byte(at) == 0) continue;
      damaged.byte(at) = 0;
      first_changed = std::min(first_changed, at);
    }
    INFO("round " << round << ", from byte " << from << ", changed at " << first_changed);
    const std::string found = outcome(recorded, damaged.segments, recorded.wholeBefore(first_changed));
    if (!found.empty()) FAIL(found);
  }
}

TEST_CASE("a flipped bit ends the recording where it is, and the records behind it are counted", "[long]") {
  RecordedScript recorded = recordScript(23, 50, GENERATE(std::size_t{4000}, std::size_t{1} << 30U));
  std::vector<bool> in_header(recorded.size(), false);
  for (std::size_t i = 0; i < recorded.segments.size(); ++i) {
    std::fill_n(in_header.begin() + static_cast<std::ptrdiff_t>(recorded.begin(i)), kSegmentHeaderBytes,
                true);
  }
  Random random(6);
  const std::uint32_t most = longOr(3U, 15U);  // bytes from one flip to the next
  for (std::uint64_t at = 0; at < recorded.size(); at += 1 + random.below(most)) {
    const auto bit = static_cast<std::uint8_t>(1U << random.below(8));
    recorded.byte(at) ^= bit;
    const std::size_t whole = recorded.wholeBefore(at);
    INFO("flipped in byte " << at);
    std::string found;
    try {
      RecordingSource source(inMemory(recorded.segments), {});
      found = outcome(recorded, recorded.segments, whole);
      // The damaged record itself is none of them; a damaged segment header damages no record.
      const std::size_t behind = recorded.ends.size() - whole - (in_header[at] ? 0 : 1);
      if (source.cut().sound_records != behind) found += " other count of sound records";
      if (behind > 0 && !anyContains(source.warnings(), std::to_string(behind) + " intact records")) {
        found += " count not said";
      }
    } catch (const InputError& error) {
      // Only where nothing can be replayed, or where it looks like a file of something else.
      if (whole > 0 && !in_header[at]) found = error.what();
      if (!contains(error.what(), "byte ")) found = error.what();
    }
    recorded.byte(at) ^= bit;
    if (!found.empty()) FAIL(found);
  }
}

TEST_CASE("wild damage never gives anything but a beginning of what was recorded") {
  const RecordedScript recorded = recordScript(24, 40, 2500);
  Random random(8);
  std::size_t opened = 0;
  for (int round = 0; round < 1500; ++round) {
    std::vector<Bytes> segments = recorded.segments;
    for (std::uint32_t edits = 1 + random.below(4); edits > 0; --edits) {
      Bytes& bytes = segments[random.below(static_cast<std::uint32_t>(segments.size()))];
      const std::size_t at = bytes.empty() ? 0 : random.below(static_cast<std::uint32_t>(bytes.size()));
      const std::size_t length = std::min<std::size_t>(random.below(200), bytes.size() - at);
      const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(at);
      const Bytes part(begin, begin + static_cast<std::ptrdiff_t>(length));
      switch (random.below(4)) {
        case 0:
          for (std::size_t i = 0; i < length; ++i)
            bytes[at + i] = static_cast<std::uint8_t>(random.below(256));
          break;
        case 1:
          bytes.erase(begin, begin + static_cast<std::ptrdiff_t>(length));
          break;
        case 2:
          bytes.insert(begin, part.begin(), part.end());
          break;
        default:
          bytes.resize(at);
      }
    }
    try {
      RecordingSource source(inMemory(segments), {});
      ++opened;
      const std::size_t entries = indexRecording(inMemory(segments)).records - 1;
      const std::string found =
          difference(source, recorded.script, std::min(entries, recorded.script.size()));
      if (!found.empty()) FAIL("round " << round << ": " << found);
    } catch (const InputError& error) {
      if (!contains(error.what(), "byte ")) FAIL(error.what());
    }
  }
  CHECK(opened > 500);
}

TEST_CASE("files that do not belong together are refused with name, place and remedy") {
  // Once for all sections.
  static const RecordedScript recorded = recordScript(25, 60, 1500);
  static const RecordedScript other = recordScript(26, 60, 1500);
  std::vector<Bytes> segments = recorded.segments;
  const auto refuses = [&](const char* file, const char* what) {
    const InputError error = refusal(segments);
    INFO(error.what());
    CHECK(contains(error.file, file));
    CHECK(contains(error.field, "byte "));
    CHECK(contains(error.message, what));
    CHECK_FALSE(error.remedy.empty());
  };
  SECTION("a segment of another run") {
    segments[1] = other.segments[1];
    refuses("recording_000001.swr", "another recording");
  }
  SECTION("another version") {
    changeHeader(segments[0], [](SegmentHeader& header) { header.version = 2; });
    refuses("recording_000000.swr", "version 2");
  }
  SECTION("another version later on") {
    changeHeader(segments[2], [](SegmentHeader& header) { header.version = 9; });
    refuses("recording_000002.swr", "version 9");
  }
  SECTION("a renamed segment") {
    std::swap(segments[1], segments[2]);
    refuses("recording_000001.swr", "this is segment 2");
  }
  SECTION("a foreign file first") {
    segments[0].assign(5000, 'x');
    refuses("recording_000000.swr", "not a segment");
  }
  SECTION("a foreign file later on") {
    segments[2].assign(5000, 'x');
    refuses("recording_000002.swr", "not a segment");
  }
  SECTION("an empty first file") {
    segments[0].clear();
    refuses("recording_000000.swr", "header is missing");
  }
}

TEST_CASE("records of another run never pass for this run's") {
  // As where a disk gives back old blocks: same places, same sequence numbers, sound checksums of their run.
  const RecordedScript recorded = recordScript(27, 60, 1U << 30U);
  const RecordedScript other = recordScript(27, 60, 1U << 30U);
  REQUIRE(recorded.ends == other.ends);
  const std::size_t whole = 20;
  std::vector<Bytes> segments = recorded.segments;
  const auto at = static_cast<std::ptrdiff_t>(recorded.ends[whole - 1]);
  std::copy(other.segments[0].begin() + at, other.segments[0].end(), segments[0].begin() + at);
  CHECK(outcome(recorded, segments, whole).empty());
  RecordingSource source(inMemory(segments), {});
  CHECK(source.cut().sound_records == 0);
}

TEST_CASE("a record that is gone and one that is there twice end the recording") {
  const RecordedScript recorded = recordScript(28, 60, 1U << 30U);
  std::vector<Bytes> segments = recorded.segments;
  const auto begin = static_cast<std::ptrdiff_t>(recorded.ends[30]);
  const auto end = static_cast<std::ptrdiff_t>(recorded.ends[31]);
  SECTION("gone") {
    segments[0].erase(segments[0].begin() + begin, segments[0].begin() + end);
    CHECK(outcome(recorded, segments, 31).empty());
    CHECK(RecordingSource(inMemory(segments), {}).cut().sound_records == recorded.ends.size() - 32);
  }
  SECTION("twice") {
    const Bytes twice(segments[0].begin() + begin, segments[0].begin() + end);
    segments[0].insert(segments[0].begin() + end, twice.begin(), twice.end());
    CHECK(outcome(recorded, segments, 32).empty());
  }
}

TEST_CASE("an end of a segment that is missing ends the recording there") {
  const RecordedScript recorded = recordScript(29, 60, 1500);
  std::vector<Bytes> segments = recorded.segments;
  std::size_t last = 1;
  while (recorded.wholeBefore(recorded.begin(last + 1)) < recorded.wholeBefore(recorded.begin(last)) + 2)
    ++last;
  const std::size_t whole = recorded.wholeBefore(recorded.begin(last + 1)) - 1;
  segments[last].resize(static_cast<std::size_t>(recorded.ends[whole - 1] - recorded.begin(last)));
  RecordingSource source(inMemory(segments), {});
  CHECK(difference(source, recorded.script, whole - 1).empty());
  CHECK(source.cut().segment == last + 1);
  CHECK(source.cut().offset == 0);
  CHECK(source.cut().sound_records == recorded.ends.size() - whole - 1);
}

TEST_CASE("a missing segment and a folder without any are named") {
  const TempFolder folder;
  const auto write = [&](std::uint32_t number) {
    writeText(folder.path() / segmentName(number).data(), "x");
  };
  CHECK_FALSE(isRecording(folder.path().string()));
  CHECK(contains(errorOf([&] { openRecording(folder.path().string()); }).message, "contains no"));
  write(0);
  write(2);
  CHECK(isRecording(folder.path().string()));
  const InputError error = errorOf([&] { openLog(folder.path().string()); });
  CHECK(contains(error.file, "recording_000001.swr"));
  CHECK(contains(error.remedy, "remove the later segments"));
  fs::remove(folder.path() / segmentName(0).data());
  CHECK(contains(errorOf([&] { openLog(folder.path().string()); }).file, "recording_000000.swr"));
}

TEST_CASE("an image that changes on the disk after opening is refused, never delivered") {
  const TempFolder folder;
  const std::string path = folder.path().string();
  const std::vector<std::uint8_t> pixels(64, 7);
  {
    RecordingWriter writer(path, wildHeader(RecordOrder::kAsWritten));
    CameraFrame frame;
    frame.image = {pixels.data(), 8, 8, 8};
    REQUIRE(writer.image(frame).ok());
    REQUIRE(writer.end().ok());
  }
  const auto source = openRecording(path);
  CameraFrame frame;
  REQUIRE(source->image(0, 1, frame));
  const fs::path file = folder.path() / segmentName(0).data();
  std::string text = readText(file);
  text[text.find(std::string(64, '\7')) + 10] = '\6';
  writeText(file, text);
  const InputError error = errorOf([&] { source->image(0, 1, frame); });
  CHECK(contains(error.message, "damaged now"));
}

}  // namespace swiftlet::test
