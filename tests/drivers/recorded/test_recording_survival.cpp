// Recorders that are killed, run out of disk or meet another program.

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <limits>

#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <csignal>
#include <ctime>
#include <new>
#include <numeric>

#include "estimator/core/random.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"
#include "tests/drivers/recorded/recording_fixture.hpp"

namespace swiftlet::test {
namespace {

/// What the child tells: written into memory that both processes see, so that no kill takes it away.
struct Shared {
  std::atomic<std::uint64_t> flushed{0};
  std::atomic<bool> done{false};
  RecordingStatistics statistics;
  StatusCode code = StatusCode::kOk;
  std::uint64_t calls = 0;
};

class SharedMemory {
 public:
  SharedMemory() {
    void* memory = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    REQUIRE(memory != MAP_FAILED);
    shared_ = new (memory) Shared;
  }
  ~SharedMemory() { ::munmap(shared_, sizeof(Shared)); }
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;
  Shared* operator->() { return shared_; }
  Shared& operator*() { return *shared_; }

 private:
  Shared* shared_ = nullptr;
};

void sleepFor(long microseconds) {
  const timespec pause{0, microseconds * 1000};
  ::nanosleep(&pause, nullptr);
}

/// A flight a hundred times as fast: portions of records every 0.2 ms, synced every 5 ms. Without pauses
/// the kill meets the writing itself more often.
[[noreturn]] void recordForever(const std::string& folder, std::uint64_t seed, bool pauses, Shared& shared) {
  RecordingOptions options;
  options.segment_bytes = 1U << 20U;
  RecordingWriter writer(folder, wildHeader(RecordOrder::kAsWritten), options);
  Random random(seed);
  std::uint64_t i = 0;
  for (int portion = 1;; ++portion) {
    for (std::uint32_t left = random.below(12); left > 0; --left) (void)record(writer, wildEntry(seed, i++));
    (void)writer.flush();
    shared.flushed.store(i);
    if (portion % 25 == 0) (void)writer.sync();
    if (pauses) sleepFor(200);
  }
}

}  // namespace

TEST_CASE("killed at 20 random moments, a recording has everything that was flushed") {
  Random random(31);
  std::uint64_t total = 0;
  for (std::uint64_t round = 0; round < 20; ++round) {
    const TempFolder folder;
    const std::string path = folder.path().string();
    SharedMemory shared;
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) recordForever(path, round, round % 2 == 0, *shared);
    while (shared->flushed.load() == 0) sleepFor(100);
    sleepFor(500 + static_cast<long>(random.below(40'000)));
    REQUIRE(::kill(child, SIGKILL) == 0);
    int how = 0;
    REQUIRE(::waitpid(child, &how, 0) == child);
    REQUIRE(WIFSIGNALED(how));
    const std::uint64_t flushed = shared->flushed.load();

    const auto source = openRecording(path);
    // Records of the portion that the kill met may be there too.
    const std::uint64_t records = indexRecording(listRecordingFiles(path)).records - 1;
    INFO("round " << round << ": " << flushed << " flushed, " << records << " found");
    CHECK(records >= flushed);
    CHECK(records <= flushed + 12);
    CHECK(difference(*source, wildScript(round, records), records).empty());
    CHECK(anyContains(source->warnings(), "byte "));
    CHECK(source->cut().sound_records == 0);
    CHECK_FALSE(source->complete());
    total += flushed;
  }
  CHECK(total > 200);
}

TEST_CASE("a full disk ends the recording, loses nothing before it and counts all after it") {
  Random random(32);
  constexpr std::uint64_t kEntries = 1200;
  constexpr std::uint64_t kFlushEvery = 7;
  for (std::uint64_t round = 0; round < 16; ++round) {
    const TempFolder folder;
    const std::string path = folder.path().string();
    const RecordedScript whole = recordScript(round, kEntries, std::size_t{1} << 30U);
    const std::vector<Entry>& script = whole.script;
    // Far less than the script takes; every other one full to the byte when a record ends.
    rlim_t limit = 2000 + random.below(300'000);
    if (round % 2 == 0) {
      // Record i ends there and i + 1 is in the buffer with it.
      std::size_t i = whole.wholeBefore(limit);
      while (i % kFlushEvery == 0 || script[i].pixels.size() > 1000 || script[i + 1].pixels.size() > 1000)
        ++i;
      limit = whole.ends[i + 1];
    }
    SharedMemory shared;
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      std::signal(SIGXFSZ, SIG_IGN);
      const rlimit most{limit, limit};
      ::setrlimit(RLIMIT_FSIZE, &most);
      RecordingWriter writer(path, wildHeader(RecordOrder::kAsWritten));
      for (const Entry& entry : script) {
        (void)record(writer, entry);
        if (shared->calls++ % kFlushEvery == 0) (void)writer.flush();
      }
      (void)writer.end();
      shared->statistics = writer.statistics();
      shared->code = writer.status().code;
      shared->done = true;
      ::_exit(0);
    }
    int how = 0;
    REQUIRE(::waitpid(child, &how, 0) == child);
    REQUIRE(shared->done);
    INFO("round " << round << ", limit " << limit);
    const auto source = openRecording(path);
    const RecordingStatistics& statistics = shared->statistics;
    const std::uint64_t lost =
        std::accumulate(statistics.lost.begin(), statistics.lost.end(), std::uint64_t{0});
    CHECK(shared->code == StatusCode::kFailed);
    CHECK(statistics.lost[static_cast<std::size_t>(RecordKind::kEnd)] == 1);
    CHECK(statistics.records + lost == kEntries + 2);
    CHECK(statistics.records == indexRecording(listRecordingFiles(path)).records);
    CHECK(difference(*source, script, statistics.records - 1).empty());
    // Every record that had room is there, and nothing is left for the reader to cut.
    CHECK(statistics.bytes == whole.ends[whole.wholeBefore(limit) - 1]);
    CHECK(source->cut().reason == nullptr);
    CHECK(fs::file_size(folder.path() / segmentName(0).data()) == statistics.bytes);
  }
}

TEST_CASE("a next segment that cannot be made ends the recording with a status") {
  const TempFolder folder;
  RecordingOptions options;
  options.segment_bytes = 1000;
  RecordingWriter writer(folder.path().string(), wildHeader(RecordOrder::kAsWritten), options);
  writeText(folder.path() / segmentName(1).data(), "in the way");
  Status status;
  int taken = 0;
  for (; taken < 100 && status.ok(); ++taken) status = writer.imu({}, {});
  CHECK(status.code == StatusCode::kFailed);
  CHECK(std::string(status.what).find("recording stopped") != std::string::npos);
  CHECK(writer.imu({}, {}).code == StatusCode::kFailed);
  CHECK(writer.flush().code == StatusCode::kFailed);
  CHECK(writer.sync().code == StatusCode::kFailed);
  CHECK(writer.statistics().lost[static_cast<std::size_t>(RecordKind::kImu)] == 2);
  CHECK(writer.end().code == StatusCode::kFailed);
  fs::remove(folder.path() / segmentName(1).data());
  CHECK(openRecording(folder.path().string())->imuCount() == static_cast<std::size_t>(taken - 1));
}

TEST_CASE("an earlier recording is replaced whole, other files stay") {
  const TempFolder run;
  const std::string path = (run.path() / "recording").string();
  RecordingOptions options;
  options.segment_bytes = 1000;
  for (const int samples : {50, 5}) {
    RecordingWriter writer(path, wildHeader(RecordOrder::kAsWritten), options);
    for (int i = 0; i < samples; ++i) REQUIRE(writer.imu({}, {i}).ok());
    REQUIRE(writer.end().ok());
    writeText(fs::path(path) / "notes.txt", "kept");
  }
  const auto source = openRecording(path);
  CHECK(source->imuCount() == 5);
  CHECK(source->complete());
  CHECK(readText(fs::path(path) / "notes.txt") == "kept");
}

TEST_CASE("a recording is not read while it is written, nor replaced while it is read") {
  const TempFolder folder;
  const std::string path = folder.path().string();
  const RecordingHeader header = wildHeader(RecordOrder::kAsWritten);
  {
    RecordingWriter writer(path, header);
    CHECK(contains(errorOf([&] { RecordingWriter(path, header); }).message,
                   "writing or reading this recording"));
    CHECK(contains(errorOf([&] { openRecording(path); }).message, "still being written"));
    REQUIRE(writer.imu({}, {}).ok());
    REQUIRE(writer.end().ok());
    CHECK(writer.imu({}, {}).code == StatusCode::kInvalidInput);
    CHECK(writer.statistics().lost[static_cast<std::size_t>(RecordKind::kImu)] == 1);
    CHECK(openRecording(path)->imuCount() == 1);
  }
  {
    const auto source = openRecording(path);
    const auto beside = openRecording(path);
    CHECK(contains(errorOf([&] { RecordingWriter(path, header); }).message,
                   "writing or reading this recording"));
    CHECK(source->imuCount() == 1);
  }
  RecordingWriter writer(path, header);
  CHECK(writer.status().ok());
}

TEST_CASE("a place that cannot be written is refused with a remedy") {
  const TempFolder folder;
  writeText(folder.path() / "file", "x");
  const RecordingHeader header = wildHeader(RecordOrder::kAsWritten);
  for (const char* place : {"file", "file/recording"}) {
    const InputError error = errorOf([&] { RecordingWriter((folder.path() / place).string(), header); });
    CHECK(contains(error.message, "cannot write a recording here"));
    CHECK_FALSE(error.remedy.empty());
  }
  CHECK(contains(errorOf([&] { RecordingWriter("/proc/recording", header); }).file, "/proc/recording"));
  RecordingHeader bad = header;
  bad.rig.T_body_cam[1].translation.x() = std::numeric_limits<double>::quiet_NaN();
  CHECK(errorOf([&] { RecordingWriter((folder.path() / "new").string(), bad); }).field == "camera");
}

TEST_CASE("images that no recording can hold are refused and counted") {
  const TempFolder folder;
  RecordingWriter writer(folder.path().string(), wildHeader(RecordOrder::kAsWritten));
  CameraFrame frame;
  frame.camera = 2;
  CHECK(writer.image(frame).code == StatusCode::kInvalidInput);
  frame.camera = 0;
  const std::uint8_t pixel = 0;
  frame.image = {&pixel, 1 << 15, 1 << 15, 1 << 15};
  CHECK(writer.image(frame).code == StatusCode::kInvalidInput);
  CHECK(writer.status().ok());
  CHECK(writer.statistics().records == 1);
}

}  // namespace swiftlet::test
