// keyframes.swk comes back as it was kept; what is cut off or damaged ends at its last sound record, and what
// is no such file is refused with the reason.

#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <string>

#include "drivers/input/input_error.hpp"
#include "drivers/input/stamp_range.hpp"
#include "firmware_host/smoothing/keyframe_reader.hpp"
#include "firmware_host/smoothing/map_keeper.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr int kKeyframes = 4;
constexpr int kSamplesEach = 5;

Rig twoCameras() {
  Rig rig;
  rig.camera_count = 2;
  for (std::size_t c = 0; c < 2; ++c) {
    rig.camera[c] =
        CameraModel(CameraKind::kPinholeRadtan, 160, 120, {100.5, 101.25, 80, 60}, {-0.1, 0.01, 1e-4, 0});
    rig.T_body_cam[c].translation = {0.1 * static_cast<double>(c), 1.0 / 3.0, 0};
  }
  rig.camera_to_imu_shift.ns = -1234567;
  return rig;
}

ImuSample sampleAt(std::int64_t ns) { return {{ns}, {0.1, 1.0 / 3.0, -0.2}, {0.0, 1e-300, 9.81}}; }

NavState stateOf(int k) {
  NavState state;
  state.epoch = static_cast<std::uint32_t>(k / 3);
  state.T_world_body =
      SE3(Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * k, Eigen::Vector3d::UnitZ())), {0.1 * k, 1.0 / 7.0, 0});
  state.v_world_body = {0.5, 0, 1e-9};
  state.bias_gyro = {1e-3, 2e-3, 3e-3};
  state.bias_accel = {-1e-2, 0, 1e-2};
  return state;
}

NoiseInUse noiseOf(int k) { return {0.45 + 0.1 * k, {1 + 1.0 / 3.0, 1.0 + k}}; }

TrackedFrame frameOf(int k) {
  TrackedFrame frame;
  frame.stamp = {kSecond * (k + 1)};
  for (TrackId id = 0; id < static_cast<TrackId>(3 + k); ++id) {
    TrackedFeature feature;
    feature.id = id << 40U;
    feature.seen = {true, id % 2 == 0};
    feature.pixel = {Eigen::Vector2f(10.25F, 0.1F), Eigen::Vector2f(20.5F, 1e-3F)};
    REQUIRE(frame.features.tryPushBack(feature));
  }
  return frame;
}

LoopRevisit revisit() {
  LoopRevisit loop;
  loop.old_stamp = {kSecond};
  loop.new_stamp = {kSecond * kKeyframes};
  loop.T_old_new.translation = {1, 2, 1.0 / 3.0};
  loop.information(2, 5) = 0.125;
  loop.matches.resize(2);
  loop.matches[1].old_feature = {true, 77, {true, false}, {Eigen::Vector2f(1, 2), Eigen::Vector2f(0, 0)}};
  return loop;
}

CalibrationEstimate calibrationOf(int k) {
  CalibrationEstimate calibration;
  calibration.camera_to_imu_shift.ns = -1234567 + k;
  calibration.T_body_cam[0] = stateOf(k).T_world_body;
  calibration.T_body_cam[1].translation = {0.1, 1.0 / 3.0, 1e-3 * k};
  calibration.gyro.matrix(2, 1) = 1e-2 / 3.0 * k;
  return calibration;
}

/// Nothing of the calibration is estimated.
OdometrySettings givenCalibration() {
  OdometrySettings settings;
  settings.estimate_gyro = false;
  return settings;
}

std::string kept(const std::string& folder, bool finished = true,
                 const OdometrySettings& settings = givenCalibration(), const Rig& rig = twoCameras()) {
  LostFiles lost;
  ImuNoise noise;
  noise.rate_hz = 200;
  {
    MapKeeper keeper(folder, rig, noise, settings, lost);
    for (int k = 0; k < kKeyframes; ++k) {
      for (int i = 0; i < kSamplesEach; ++i) keeper.addImu(sampleAt(kSecond * k + 5'000'000 * (i + 1)));
      CalibrationEstimate calibration = calibrationOf(k);
      if (rig.rolls()) calibration.readout.ns = rig.readout.ns + k;
      keeper.addCalibration(calibration);
      keeper.addKeyframe(frameOf(k), stateOf(k), noiseOf(k));
    }
    keeper.addRevisit(revisit());
    if (finished) keeper.finish();
  }
  REQUIRE(lost.count() == 0);
  return test::textOf(folder + "/" + kKeyframeFile);
}

struct Counts {
  int samples = 0, keyframes = 0, revisits = 0, calibrations = 0;
  std::string cut;
};

Counts countsIn(const std::string& bytes) {
  std::istringstream in(bytes);
  KeyframeReader reader("keyframes.swk", in);
  Counts counts;
  for (;;) {
    switch (reader.next()) {
      case KeyframeReader::Next::kSample:
        ++counts.samples;
        break;
      case KeyframeReader::Next::kKeyframe:
        ++counts.keyframes;
        break;
      case KeyframeReader::Next::kRevisit:
        ++counts.revisits;
        break;
      case KeyframeReader::Next::kCalibration:
        ++counts.calibrations;
        break;
      case KeyframeReader::Next::kEnd:
        counts.cut = reader.cut();
        return counts;
    }
  }
}

}  // namespace

TEST_CASE("keyframes, samples and loops come back bit for bit", "[files]") {
  const ScratchFolder folder("keyframes");
  const std::string bytes = kept(folder.path());
  CHECK(bytes == kept(folder.path()));  // and the same run gives the same bytes
  std::istringstream in(bytes);
  KeyframeReader reader("keyframes.swk", in);
  const Rig rig = twoCameras();
  CHECK(reader.rig().camera_count == rig.camera_count);
  CHECK(reader.rig().camera_to_imu_shift == rig.camera_to_imu_shift);
  CHECK(reader.rig().T_body_cam[1].translation == rig.T_body_cam[1].translation);
  CHECK(reader.rig().camera[0].intrinsics() == rig.camera[0].intrinsics());
  for (int k = 0; k < kKeyframes; ++k) {
    for (int i = 0; i < kSamplesEach; ++i) {
      REQUIRE(reader.next() == KeyframeReader::Next::kSample);
      const ImuSample sample = sampleAt(kSecond * k + 5'000'000 * (i + 1));
      CHECK(reader.sample().stamp == sample.stamp);
      CHECK(reader.sample().gyro == sample.gyro);
      CHECK(reader.sample().accel == sample.accel);
    }
    REQUIRE(reader.next() == KeyframeReader::Next::kKeyframe);
    const NavState state = stateOf(k);
    CHECK(reader.state().epoch == state.epoch);
    CHECK(reader.state().T_world_body.rotation.coeffs() == state.T_world_body.rotation.coeffs());
    CHECK(reader.state().T_world_body.translation == state.T_world_body.translation);
    CHECK(reader.state().v_world_body == state.v_world_body);
    CHECK(reader.state().bias_gyro == state.bias_gyro);
    CHECK(reader.state().bias_accel == state.bias_accel);
    CHECK(reader.noiseInUse().pixel_sigma == noiseOf(k).pixel_sigma);
    CHECK(reader.noiseInUse().imu.gyro == noiseOf(k).imu.gyro);
    CHECK(reader.noiseInUse().imu.accel == noiseOf(k).imu.accel);
    const TrackedFrame frame = frameOf(k);
    CHECK(reader.frame().stamp == frame.stamp);
    REQUIRE(reader.frame().features.size() == frame.features.size());
    for (std::size_t f = 0; f < frame.features.size(); ++f) {
      CHECK(reader.frame().features[f].id == frame.features[f].id);
      CHECK(reader.frame().features[f].seen == frame.features[f].seen);
      CHECK(reader.frame().features[f].pixel[0] == frame.features[f].pixel[0]);
      if (frame.features[f].seen[1]) CHECK(reader.frame().features[f].pixel[1] == frame.features[f].pixel[1]);
    }
  }
  REQUIRE(reader.next() == KeyframeReader::Next::kRevisit);
  const LoopRevisit loop = revisit();
  CHECK(reader.revisit().old_stamp == loop.old_stamp);
  CHECK(reader.revisit().new_stamp == loop.new_stamp);
  CHECK(reader.revisit().T_old_new.translation == loop.T_old_new.translation);
  CHECK(reader.revisit().information == loop.information);
  REQUIRE(reader.revisit().matches.size() == 2);
  CHECK(reader.revisit().matches[1].old_feature.track == 77);
  CHECK(reader.revisit().matches[1].old_feature.has_track);
  CHECK_FALSE(reader.revisit().matches[1].new_feature.has_track);
  CHECK(reader.next() == KeyframeReader::Next::kEnd);
  CHECK(reader.cut().empty());
  CHECK(reader.next() == KeyframeReader::Next::kEnd);
}

TEST_CASE("a run with the largest stamps of a log is read whole", "[files]") {
  const ScratchFolder folder("keyframes");
  LostFiles lost;
  ImuNoise noise;
  noise.rate_hz = 200;
  {
    MapKeeper keeper(folder.path(), twoCameras(), noise, givenCalibration(), lost);
    for (int i = 0; i < kSamplesEach; ++i) keeper.addImu(sampleAt(kLargestStamp - kSecond + 5'000'000 * i));
    TrackedFrame frame = frameOf(0);
    frame.stamp.ns = kLargestStamp;
    keeper.addKeyframe(frame, stateOf(0), noiseOf(0));
    keeper.finish();
  }
  const Counts counts = countsIn(test::textOf(folder.file(kKeyframeFile)));
  CHECK(counts.cut.empty());
  CHECK(counts.samples == kSamplesEach);
  CHECK(counts.keyframes == 1);
}

TEST_CASE("the calibration's estimate comes back with each keyframe where there is one", "[files]") {
  const ScratchFolder folder("keyframes");
  CHECK(countsIn(kept(folder.path())).calibrations == 0);
  for (const bool time_offset : {true, false}) {
    OdometrySettings settings = givenCalibration();
    settings.estimate_time_offset = time_offset;
    settings.estimate_extrinsics = !time_offset;
    const std::string bytes = kept(folder.path(), true, settings);
    CHECK(countsIn(bytes).calibrations == kKeyframes);
    std::istringstream in(bytes);
    KeyframeReader reader("keyframes.swk", in);
    for (int k = 0; k < kKeyframes; ++k) {
      KeyframeReader::Next next = reader.next();
      while (next == KeyframeReader::Next::kSample) next = reader.next();
      REQUIRE(next == KeyframeReader::Next::kCalibration);
      const CalibrationEstimate expected = calibrationOf(k);
      CHECK(reader.calibration().camera_to_imu_shift == expected.camera_to_imu_shift);
      for (std::size_t c = 0; c < kMaxCameras; ++c) {
        CHECK(reader.calibration().T_body_cam[c].rotation.coeffs() ==
              expected.T_body_cam[c].rotation.coeffs());
        CHECK(reader.calibration().T_body_cam[c].translation == expected.T_body_cam[c].translation);
      }
      CHECK(reader.calibration().gyro.matrix == expected.gyro.matrix);
      REQUIRE(reader.next() == KeyframeReader::Next::kKeyframe);
    }
  }
}

TEST_CASE("a rolling shutter's readout comes back, as given and as estimated", "[files]") {
  const ScratchFolder folder("keyframes");
  Rig rig = twoCameras();
  rig.readout = Duration::fromMilliseconds(20);
  OdometrySettings settings = givenCalibration();
  settings.estimate_time_offset = true;
  const std::string bytes = kept(folder.path(), true, settings, rig);
  CHECK(countsIn(bytes).calibrations == kKeyframes);
  std::istringstream in(bytes);
  KeyframeReader reader("keyframes.swk", in);
  CHECK(reader.rig().readout == rig.readout);
  KeyframeReader::Next next = reader.next();
  while (next != KeyframeReader::Next::kEnd) {
    if (next == KeyframeReader::Next::kKeyframe) {
      CHECK(reader.calibration().readout.ns == rig.readout.ns + reader.frame().stamp.ns / kSecond - 1);
    }
    next = reader.next();
  }
}

TEST_CASE("cut off anywhere, the file ends at its last sound record", "[files]") {
  const ScratchFolder folder("keyframes");
  const std::string bytes = kept(folder.path());
  int most = 0;
  bool refused = true;
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Counts counts;
    try {
      counts = countsIn(bytes.substr(0, size));
    } catch (const InputError&) {
      REQUIRE(refused);  // in the head, and never again behind it
      continue;
    }
    refused = false;
    const int records = counts.samples + counts.keyframes + counts.revisits;
    REQUIRE(records >= most);
    most = records;
    REQUIRE_FALSE(counts.cut.empty());
  }
  CHECK(most == kKeyframes * (kSamplesEach + 1) + 1);
  CHECK(countsIn(bytes).cut.empty());
}

TEST_CASE("a run that was killed keeps its keyframes, and says that it was cut off", "[files]") {
  const ScratchFolder folder("keyframes");
  const Counts counts = countsIn(kept(folder.path(), false));
  CHECK(counts.keyframes == kKeyframes);
  CHECK_THAT(counts.cut, Catch::Contains("truncated"));
}

TEST_CASE("no damaged byte passes", "[files]") {
  const ScratchFolder folder("keyframes");
  const std::string bytes = kept(folder.path());
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    bool noticed = false;
    try {
      noticed = !countsIn(damaged).cut.empty();
    } catch (const InputError&) {
      noticed = true;
    }
    if (!noticed) FAIL("byte " << at);
  }
}

TEST_CASE("foreign files and other versions are refused with the reason", "[files]") {
  const ScratchFolder folder("keyframes");
  const std::string bytes = kept(folder.path());
  CHECK_THROWS_WITH(countsIn(""), Catch::Contains("is not a file of keyframes"));
  CHECK_THROWS_WITH(countsIn("a text of somebody else's, long enough"),
                    Catch::Contains("is not a file of keyframes"));
  std::string later = bytes;
  later[8] = 3;
  CHECK_THROWS_WITH(countsIn(later), Catch::Contains("version: is 3, this program reads 2"));
  std::string damaged = bytes;
  damaged[30] = static_cast<char>(damaged[30] + 1);
  CHECK_THROWS_WITH(countsIn(damaged), Catch::Contains("the head is damaged"));
}

}  // namespace swiftlet
