// What is recorded comes back: bits, order, steps; from scripts and from a real log.

#include <bit>
#include <catch2/catch.hpp>

#include "drivers/recorded/open_log.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"
#include "tests/drivers/recorded/recording_allocations.hpp"
#include "tests/drivers/recorded/recording_fixture.hpp"

namespace swiftlet::test {
namespace {

const fs::path kRealLog = fs::path(SWIFTLET_TEST_DATA) / "euroc_mh01_4s";

/// Writes a log as a recorder beside threads would: each stream in order, the streams one after the other
/// in portions.
void recordInPortions(LogSource& log, RecordingWriter& writer, int portion) {
  std::array<std::vector<Entry>, 3> waiting;
  const auto drain = [&] {
    for (std::vector<Entry>& entries : waiting) {
      for (const Entry& entry : entries) REQUIRE(record(writer, entry).ok());
      entries.clear();
    }
    REQUIRE(writer.flush().ok());
  };
  SensorMessage message;
  for (int i = 1; log.next(message); ++i) {
    Entry entry;
    if (const auto* sample = std::get_if<ImuSample>(&message)) {
      entry.sample = *sample;
      entry.arrival = sample->stamp;
      waiting[2].push_back(std::move(entry));
    } else {
      entry.frame = std::get<CameraFrame>(message);
      entry.kind = imageKind(entry.frame.camera);
      const ImageView& image = entry.frame.image;
      entry.pixels.assign(image.data, image.data + image.height * image.stride);
      entry.frame.image.data = entry.pixels.data();
      waiting[1 - entry.frame.camera].push_back(std::move(entry));
    }
    if (i % portion == 0) drain();
  }
  drain();
  REQUIRE(writer.end().ok());
}

RecordingHeader headerOf(const LogSource& log) {
  RecordingHeader header;
  header.rig = log.rig();
  header.noise = log.imuNoise();
  header.calibration_form = log.calibration().form;
  return header;
}

/// The messages of both, one by one, are the same to the bit.
std::size_t countSame(LogSource& a, LogSource& b) {
  SensorMessage from_a;
  SensorMessage from_b;
  std::size_t count = 0;
  while (a.next(from_a)) {
    REQUIRE(b.next(from_b));
    REQUIRE(from_a.index() == from_b.index());
    if (const auto* sample = std::get_if<ImuSample>(&from_a)) {
      if (!sameBits(*sample, std::get<ImuSample>(from_b))) return count;
    } else if (!sameFrame(std::get<CameraFrame>(from_a), std::get<CameraFrame>(from_b))) {
      return count;
    }
    ++count;
  }
  CHECK_FALSE(b.next(from_b));
  return count;
}

}  // namespace

TEST_CASE("a recording gives back every bit, in one segment and in many") {
  const std::uint64_t seed = GENERATE(1, 2, 3);
  // The last: every record in a segment of its own.
  const std::size_t segment_bytes = GENERATE(std::size_t{1} << 30U, std::size_t{20000}, std::size_t{1});
  const RecordedScript recorded = recordScript(seed, segment_bytes == 1 ? 20 : 400, segment_bytes);
  CHECK((segment_bytes > 100000) == (recorded.segments.size() == 1));
  RecordingSource source(inMemory(recorded.segments), {});
  CHECK(difference(source, recorded.script, recorded.script.size()).empty());
  CHECK(source.cut().reason == nullptr);
  CHECK_FALSE(anyContains(source.warnings(), "byte"));
  CHECK_FALSE(source.complete());  // the script has losses
}

TEST_CASE("the run's header comes back bit for bit") {
  const RecordedScript recorded = recordScript(4, 0, 1U << 20U);
  RecordingSource source(inMemory(recorded.segments), {});
  const RecordingHeader given = wildHeader(RecordOrder::kAsWritten);
  const RecordingHeader& read = source.header();
  CHECK(sameRig(read.rig, given.rig));
  CHECK(sameRig(source.rig(), given.rig));
  const auto same = [](double a, double b) {
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
  };
  CHECK(same(read.noise.gyro_density, given.noise.gyro_density));
  CHECK(same(read.noise.accel_density, given.noise.accel_density));
  CHECK(same(read.noise.gyro_walk, given.noise.gyro_walk));
  CHECK(same(read.noise.accel_walk, given.noise.accel_walk));
  CHECK(same(read.noise.rate_hz, given.noise.rate_hz));
  CHECK(same(read.noise.gravity, given.noise.gravity));
  CHECK(same(read.noise.gyro_saturation, given.noise.gyro_saturation));
  CHECK(same(read.noise.accel_saturation, given.noise.accel_saturation));
  CHECK(read.calibration_form == given.calibration_form);
  CHECK(source.calibration().form == given.calibration_form);
  CHECK(read.settings == given.settings);
  CHECK(read.program_version == given.program_version);
  CHECK(read.order == given.order);
  REQUIRE(read.depth_sensor);
  const std::vector<float> depth(given.depth_sensor->camera.pixels());
  const auto sceneOf = [&](DepthImageView sensor) {
    sensor.depth = depth.data();
    return SceneImages{{}, sensor, {}};
  };
  CHECK(sameScene(sceneOf(*read.depth_sensor), sceneOf(*given.depth_sensor)));
  CHECK(source.complete());
  CHECK_FALSE(source.firstLoss());
  CHECK(source.warnings().empty());
}

TEST_CASE("without a depth sensor the run's header is what it was before there were any") {
  RecordingHeader given = wildHeader(RecordOrder::kAsWritten);
  const std::size_t with = encodeRecordingHeader(given).size();
  given.depth_sensor.reset();
  std::vector<std::uint8_t> bytes = encodeRecordingHeader(given);
  constexpr std::size_t kSensorBytes = 2 * 4 + 11 * 8;
  CHECK(bytes.size() + kSensorBytes == with);
  RecordingHeader read = wildHeader(RecordOrder::kAsWritten);
  REQUIRE(decodeRecordingHeader(bytes, read) == nullptr);
  CHECK_FALSE(read.depth_sensor);
  bytes.resize(bytes.size() + kSensorBytes);  // a sensor of 0x0 pixels
  CHECK(std::string(decodeRecordingHeader(bytes, read)) == "depth sensor");
}

TEST_CASE("a depth image of another size than the sensor's is refused and counted") {
  const TempFolder folder;
  RecordingHeader header = wildHeader(RecordOrder::kAsWritten);
  RecordingWriter writer(folder.path().string(), header);
  SceneImages scene;
  scene.depth = *header.depth_sensor;
  const std::vector<float> depth(2 * scene.depth.camera.pixels());
  scene.depth.depth = depth.data();
  CHECK(writer.mapStep({}, scene).ok());
  scene.depth.camera.width *= 2;
  CHECK(writer.mapStep({}, scene).code == StatusCode::kInvalidInput);
  CHECK(writer.statistics().lost[static_cast<std::size_t>(RecordKind::kMapStep)] == 1);
  CHECK(writer.status().ok());
}

TEST_CASE("a recording of a real log is that log, whatever order its recorder drained the streams in") {
  const int portion = GENERATE(1, 100, 100000);
  const TempFolder run;
  const fs::path folder = run.path() / "recording";
  {
    const auto log = openLog(kRealLog.string());
    RecordingWriter writer(folder.string(), headerOf(*log));
    recordInPortions(*log, writer, portion);
  }
  const auto log = openLog(kRealLog.string());
  const auto recording = openLog(portion == 100 ? folder.string() : run.path().string());
  CHECK(recording->warnings().empty());
  CHECK(recording->imageCount() == log->imageCount());
  CHECK(recording->frameCount() == log->frameCount());
  CHECK(sameRig(recording->rig(), log->rig()));
  const std::size_t count = countSame(*log, *recording);
  CHECK(count > 900);
  CHECK(count == log->counters().imu_samples + log->counters().images[0] + log->counters().images[1]);
  CHECK(recording->counters().imu_samples == log->counters().imu_samples);
  CHECK(recording->counters().images == log->counters().images);
  // From any moment on, forth and back.
  log->seek({});
  SensorMessage message;
  REQUIRE(log->next(message));
  const Stamp first = std::get<ImuSample>(message).stamp;
  for (const double seconds : {2.0, 0.5, 0.0}) {
    CAPTURE(seconds);
    const Stamp from = first + Duration::fromSeconds(seconds);
    log->seek(from);
    recording->seek(from);
    const std::size_t rest = countSame(*log, *recording);
    CHECK(rest > 400);
    CHECK((rest == count) == (from == first));
  }
}

TEST_CASE("mono, no images and another calibration for a recording") {
  const TempFolder run;
  {
    const auto log = openLog(kRealLog.string());
    RecordingWriter writer((run.path() / "recording").string(), headerOf(*log));
    recordInPortions(*log, writer, 50);
  }
  LogOptions options;
  SECTION("mono") {
    options.mono = true;
    const auto log = openLog(kRealLog.string(), options);
    const auto recording = openLog(run.path().string(), options);
    CHECK(recording->rig().camera_count == 1);
    CHECK(recording->imageCount() == log->imageCount());
    countSame(*log, *recording);
    CHECK(recording->counters().images == log->counters().images);
  }
  SECTION("without images") {
    options.without_images = true;
    const auto recording = openLog(run.path().string(), options);
    CHECK(recording->imageCount() == 0);
    SensorMessage message;
    while (recording->next(message)) REQUIRE(std::holds_alternative<ImuSample>(message));
    CHECK(recording->counters().imu_samples > 700);
  }
  SECTION("calibration") {
    options.calibration = (kRealLog / "mav0").string();
    CHECK(sameRig(openLog(run.path().string(), options)->rig(), openLog(kRealLog.string())->rig()));
    const AslFixture other_size;
    options.calibration = other_size.mav0().string();
    const InputError error = errorOf([&] { openLog(run.path().string(), options); });
    CHECK(contains(error.what(), "752x480"));
  }
}

TEST_CASE("messages are merged by arrival: samples first, then camera 0; a stream keeps its own order") {
  const TempFolder folder;
  {
    RecordingWriter writer(folder.path().string(), wildHeader(RecordOrder::kByArrival));
    // Written stream by stream; `sequence` says where each has to come out.
    const auto image = [&](std::uint32_t camera, std::int64_t arrival, std::int64_t stamp,
                           std::uint64_t place) {
      CameraFrame frame;
      frame.camera = camera;
      frame.arrival.ns = arrival;
      frame.stamp.ns = stamp;
      frame.sequence = place;
      REQUIRE(writer.image(frame).ok());
    };
    const auto imu = [&](std::int64_t arrival, std::int64_t stamp, double place) {
      REQUIRE(writer.imu({{stamp}, {place, 0, 0}, {0, 0, 0}}, {arrival}).ok());
    };
    image(1, 10, 10, 2);
    image(1, 30, 10, 6);  // a repeated stamp
    image(0, 10, 10, 1);
    image(0, 29, 5, 5);  // a reversed stamp
    imu(10, 10, 0);
    imu(20, 8, 3);   // a reversed stamp
    imu(15, 16, 4);  // an arrival that falls: stays behind the one before
    imu(31, 31, 7);
    REQUIRE(writer.end().ok());
  }
  const auto source = openRecording(folder.path().string());
  SensorMessage message;
  std::vector<double> places;
  while (source->next(message)) {
    const auto* sample = std::get_if<ImuSample>(&message);
    places.push_back(sample != nullptr ? sample->gyro.x()
                                       : static_cast<double>(std::get<CameraFrame>(message).sequence));
  }
  CHECK(places == std::vector<double>{0, 1, 2, 3, 4, 5, 6, 7});
  CHECK(source->frameCount() == 2);
}

TEST_CASE("numbers count what was lost, and what was lost is said") {
  const TempFolder folder;
  CameraFrame frame;
  {
    RecordingWriter writer(folder.path().string(), wildHeader(RecordOrder::kByArrival));
    REQUIRE(writer.image(frame).ok());
    REQUIRE(writer.loss(RecordKind::kImage0, 3).ok());
    REQUIRE(writer.loss(RecordKind::kImage1, 0).ok());
    frame.sequence = 77;
    REQUIRE(writer.image(frame).ok());
    REQUIRE(writer.loss(RecordKind::kTrackStep, 2).ok());
    REQUIRE(writer.end().ok());
  }
  const auto source = openRecording(folder.path().string());
  CHECK(source->lastImage(0) == 5);
  CHECK(source->lastImage(1) == 0);
  for (const std::uint64_t number : {0, 2, 3, 4, 6}) CHECK_FALSE(source->image(0, number, frame));
  REQUIRE(source->image(0, 5, frame));
  CHECK(frame.sequence == 77);
  CHECK_FALSE(source->image(2, 1, frame));
  REQUIRE(source->losses().size() == 2);
  CHECK(anyContains(source->warnings(), "3 images of camera 0 were lost while recording, after number 1"));
  CHECK(anyContains(source->warnings(), "2 tracking steps were lost"));
  CHECK_FALSE(source->complete());
  const auto loss = source->firstLoss();
  REQUIRE(loss);
  CHECK(contains(loss->file, "recording_000000.swr"));
  CHECK(contains(loss->field, "byte "));
  CHECK(contains(loss->message, "3 images of camera 0 were lost while recording, after number 1"));
  CHECK(contains(loss->message, "the first of 2 losses"));
  CHECK_FALSE(loss->remedy.empty());
}

TEST_CASE("pixels stay valid for the promised number of further images") {
  const RecordedScript recorded = recordScript(9, 600, 1U << 30U);
  RecordingSource source(inMemory(recorded.segments), {});
  std::vector<const Entry*> images;
  for (const Entry& entry : recorded.script) {
    if (entry.kind == RecordKind::kImage0) images.push_back(&entry);
  }
  std::vector<CameraFrame> frames;
  SensorMessage message;
  while (source.next(message)) {
    const auto* frame = std::get_if<CameraFrame>(&message);
    if (frame == nullptr || frame->camera != 0) continue;
    frames.push_back(*frame);
    const std::size_t held = std::min(frames.size(), LogSource::kImageSlots);
    for (std::size_t i = frames.size() - held; i < frames.size(); ++i) {
      REQUIRE(sameFrame(frames[i], images[i]->frame));
    }
  }
  CHECK(frames.size() == images.size());
  CHECK(frames.size() > 30);
}

TEST_CASE("once begun the writer allocates nothing, over segments and syncs") {
  const TempFolder folder;
  const std::vector<Entry> script = wildScript(12, 500);
  RecordingOptions options;
  options.segment_bytes = 60'000;
  RecordingWriter writer(folder.path().string(), wildHeader(RecordOrder::kByArrival), options);
  const std::uint64_t before = allocationCount();
  bool good = true;
  for (std::size_t i = 0; i < script.size(); ++i) {
    good = record(writer, script[i]).ok() && good;
    if (i % 50 == 0) good = writer.sync().ok() && good;
  }
  good = writer.end().ok() && good;
  CHECK(allocationCount() == before);
  CHECK(before > 0);
  CHECK(good);
  CHECK(writer.statistics().segments > 5);
}

}  // namespace swiftlet::test
