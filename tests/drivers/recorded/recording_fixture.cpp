#include "tests/drivers/recorded/recording_fixture.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "estimator/core/random.hpp"
#include "tests/drivers/recorded/asl_fixture.hpp"

namespace swiftlet::test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double wildNumber(Random& random) {
  switch (random.below(8)) {
    case 0:
      // A NaN with a payload, which only a copy of the bits brings back.
      return std::bit_cast<double>(0x7FF8'0000'0000'0000ULL | random.below(1U << 30U));
    case 1:
      return random.below(2) == 0 ? kInfinity : -kInfinity;
    case 2:
      return std::numeric_limits<double>::denorm_min() * random.below(1000);
    case 3:
      return -0.0;
    default:
      return random.uniform(-1e3, 1e3);
  }
}

Stamp wildStamp(Random& random) {
  switch (random.below(6)) {
    case 0:
      return {std::numeric_limits<std::int64_t>::max() - random.below(3)};
    case 1:
      return {std::numeric_limits<std::int64_t>::min() + random.below(3)};
    default:
      return {1'403'636'579'763'555'584 + random.below(1000)};
  }
}

std::uint64_t wildCount(Random& random) {
  return random.below(5) == 0 ? std::numeric_limits<std::uint64_t>::max() : random.below(100000);
}

Effort wildEffort(Random& random) {
  return {static_cast<int>(random.below(10)), -static_cast<int>(random.below(400)),
          std::numeric_limits<int>::max() - static_cast<int>(random.below(9))};
}

void wildImage(Random& random, Entry& entry) {
  CameraFrame& frame = entry.frame;
  frame.stamp = wildStamp(random);
  frame.arrival = wildStamp(random);
  frame.clock = random.below(2) == 0 ? Clock::kMonotonic : Clock::kLog;
  frame.camera = entry.kind == RecordKind::kImage0 ? 0 : 1;
  frame.sequence = wildCount(random);
  const std::uint32_t size = random.below(12);
  // No image, small ones, and now and then one that goes to the kernel without a copy.
  int width = 1 + static_cast<int>(random.below(40));
  int height = 1 + static_cast<int>(random.below(20));
  if (size == 0) height = 0;
  if (size == 1) {
    width = 240 + static_cast<int>(random.below(8));
    height = 180;
  }
  const int stride = width + (random.below(2) == 0 ? 0 : static_cast<int>(random.below(9)));
  entry.pixels.resize(static_cast<std::size_t>(stride) * static_cast<std::size_t>(height));
  for (std::uint8_t& pixel : entry.pixels) pixel = static_cast<std::uint8_t>(random.below(256));
  frame.image = {entry.pixels.empty() ? nullptr : entry.pixels.data(), width, height, stride};
}

/// Depth, labels, both or none; small ones, and now and then labels that go to the kernel without a copy.
void wildScene(Random& random, Entry& entry) {
  const std::uint32_t what = random.below(4);
  SceneImages& scene = entry.scene;
  scene.stamp = wildStamp(random);
  if (what % 2 == 1) {
    scene.depth = *wildHeader(RecordOrder::kAsWritten).depth_sensor;
    scene.depth.stamp = wildStamp(random);
    entry.depth.resize(scene.depth.camera.pixels());
    for (float& depth : entry.depth) {
      depth = random.below(9) == 0 ? std::bit_cast<float>(0x7FC0'0000U | random.below(1U << 20U))
                                   : static_cast<float>(random.uniform(0, 10));
    }
    scene.depth.depth = entry.depth.data();
  }
  if (what < 2) return;
  const int width = 1 + static_cast<int>(random.below(40));
  const int height = random.below(8) == 0 ? 1200 : 1 + static_cast<int>(random.below(20));
  const int stride = width + static_cast<int>(random.below(3));
  entry.pixels.resize(static_cast<std::size_t>(stride) * static_cast<std::size_t>(height));
  for (std::uint8_t& pixel : entry.pixels) pixel = static_cast<std::uint8_t>(random.below(256));
  scene.labels = {entry.pixels.data(), width, height, stride};
}

bool sameNumber(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

template <typename Values>
bool sameNumbers(const Values& a, const Values& b) {
  for (int i = 0; i < a.size(); ++i) {
    if (!sameNumber(a[i], b[i])) return false;
  }
  return true;
}

}  // namespace

Status record(RecordingWriter& writer, const Entry& entry) {
  switch (entry.kind) {
    case RecordKind::kImu:
      return writer.imu(entry.sample, entry.arrival);
    case RecordKind::kImage0:
    case RecordKind::kImage1:
      return writer.image(entry.frame);
    case RecordKind::kPropagateStep:
      return writer.propagateStep(entry.propagate);
    case RecordKind::kTrackStep:
      return writer.trackStep(entry.track);
    case RecordKind::kSmoothStep:
      return writer.smoothStep(entry.smooth);
    case RecordKind::kMeshStep:
      return writer.meshStep(entry.mesh);
    case RecordKind::kLoopStep:
      return writer.loopStep(entry.loop);
    case RecordKind::kMapStep:
      return writer.mapStep(entry.map, entry.scene);
    default:
      return writer.loss(entry.loss.kind, entry.loss.count);
  }
}

Entry wildEntry(std::uint64_t seed, std::uint64_t i) {
  Random random(seed, i);
  constexpr std::array<RecordKind, 14> kMix{
      RecordKind::kImu,           RecordKind::kImu,       RecordKind::kImu,        RecordKind::kImu,
      RecordKind::kImage0,        RecordKind::kImage1,    RecordKind::kImage1,     RecordKind::kMeshStep,
      RecordKind::kPropagateStep, RecordKind::kTrackStep, RecordKind::kSmoothStep, RecordKind::kLoss,
      RecordKind::kLoopStep,      RecordKind::kMapStep};
  constexpr std::array<RecordKind, 9> kLost{
      RecordKind::kImu,           RecordKind::kImage0,    RecordKind::kImage1,
      RecordKind::kPropagateStep, RecordKind::kTrackStep, RecordKind::kSmoothStep,
      RecordKind::kMeshStep,      RecordKind::kLoopStep,  RecordKind::kMapStep};
  Entry entry;
  entry.kind = kMix[random.below(static_cast<std::uint32_t>(kMix.size()))];
  entry.sample.stamp = wildStamp(random);
  entry.arrival = wildStamp(random);
  for (int k = 0; k < 3; ++k) entry.sample.gyro[k] = wildNumber(random);
  for (int k = 0; k < 3; ++k) entry.sample.accel[k] = wildNumber(random);
  entry.propagate = {wildCount(random), wildCount(random)};
  entry.track = {wildCount(random), wildStamp(random), {wildCount(random), wildCount(random)},
                 wildCount(random), wildCount(random), wildEffort(random)};
  entry.smooth = {wildCount(random), wildCount(random), wildEffort(random), wildCount(random)};
  entry.mesh = {wildCount(random), wildCount(random), wildCount(random)};
  entry.loop = {wildCount(random), wildCount(random), {wildCount(random), wildCount(random)}};
  entry.map = {wildCount(random),
               wildCount(random),
               wildCount(random),
               {wildCount(random), wildCount(random)},
               random.below(9) == 0};
  entry.loss.kind = kLost[random.below(static_cast<std::uint32_t>(kLost.size()))];
  entry.loss.count = 1 + random.below(1000);
  if (entry.kind == RecordKind::kImage0 || entry.kind == RecordKind::kImage1) wildImage(random, entry);
  if (entry.kind == RecordKind::kMapStep) wildScene(random, entry);
  return entry;
}

std::vector<Entry> wildScript(std::uint64_t seed, std::size_t count) {
  std::vector<Entry> script;
  for (std::size_t i = 0; i < count; ++i) script.push_back(wildEntry(seed, i));
  return script;
}

RecordingHeader wildHeader(RecordOrder order) {
  RecordingHeader header;
  header.order = order;
  header.rig.camera_count = 2;
  header.rig.camera_to_imu_shift.ns = -1234567891;
  header.rig.readout.ns = 19'999'999;
  const double third = 1.0 / 3.0;
  header.rig.camera[0] =
      CameraModel(CameraKind::kPinholeRadtan, 40, 20, {400.1 * third, 401 * third, 20.3, 10},
                  {-0.28 * third, 0.07, std::nextafter(2e-4, 1), -1e-300});
  header.rig.camera[1] = CameraModel(CameraKind::kEquidistant, 40, 20, {190.9, 190.8, 20, 10 * third},
                                     {1e-3 * third, 0, -0.0, 4e-5});
  // Not of unit norm to the last bit: a constructor that normalizes again would show.
  header.rig.T_body_cam[0].rotation.coeffs() << third, 0.3, std::nextafter(0.5, 1), 0.7;
  header.rig.T_body_cam[0].translation << -0.021 * third, 5e-324, 1e-9;
  header.rig.T_body_cam[1].rotation.coeffs() << -third, 0.4, 0.4, 0.7;
  header.rig.T_body_cam[1].translation << 0.11 * third, -0.0, 7;
  header.noise.gyro_density = 1e-4 * third;
  header.noise.accel_saturation = kInfinity;
  header.noise.gravity = std::nextafter(9.81, 10);
  DepthImageView& sensor = header.depth_sensor.emplace();
  sensor.camera = {50 * third, std::nextafter(16.5, 17), 7.9, -0.0, 16, 12};
  sensor.T_body_camera.rotation.coeffs() << 0.1, -third, 0.3, 0.7;
  sensor.T_body_camera.translation << -0.0, 0.05 * third, 5e-324;
  header.calibration_form = "EuRoC";
  header.settings = "smoother:\n  window: 12  # \xC3\xBC\n" + std::string(3, '\0');
  header.program_version = "1.2.3-4-gabcdef";
  return header;
}

bool sameBits(const ImuSample& a, const ImuSample& b) {
  return a.stamp == b.stamp && sameNumbers(a.gyro, b.gyro) && sameNumbers(a.accel, b.accel);
}

bool sameFrame(const CameraFrame& a, const CameraFrame& b) {
  if (a.stamp != b.stamp || a.arrival != b.arrival || a.clock != b.clock || a.camera != b.camera)
    return false;
  if (a.sequence != b.sequence || a.image.width != b.image.width || a.image.height != b.image.height)
    return false;
  if (a.image.empty() || b.image.empty()) return a.image.empty() == b.image.empty();
  for (int y = 0; y < a.image.height; ++y) {
    if (std::memcmp(a.image.row(y), b.image.row(y), static_cast<std::size_t>(a.image.width)) != 0)
      return false;
  }
  return true;
}

bool sameScene(const SceneImages& a, const SceneImages& b) {
  const auto has_depth = [](const SceneImages& scene) { return scene.depth.depth != nullptr; };
  if (has_depth(a) != has_depth(b) || a.labels.empty() != b.labels.empty()) return false;
  if (!a.empty() && a.stamp != b.stamp) return false;
  if (has_depth(a)) {
    const PinholeIntrinsics& p = a.depth.camera;
    const PinholeIntrinsics& q = b.depth.camera;
    const bool same =
        p.width == q.width && p.height == q.height && sameNumber(p.fx, q.fx) && sameNumber(p.fy, q.fy) &&
        sameNumber(p.cx, q.cx) && sameNumber(p.cy, q.cy) && a.depth.stamp == b.depth.stamp &&
        sameNumbers(a.depth.T_body_camera.rotation.coeffs(), b.depth.T_body_camera.rotation.coeffs()) &&
        sameNumbers(a.depth.T_body_camera.translation, b.depth.T_body_camera.translation);
    if (!same || std::memcmp(a.depth.depth, b.depth.depth, p.pixels() * sizeof(float)) != 0) return false;
  }
  if (a.labels.empty()) return true;
  if (a.labels.width != b.labels.width || a.labels.height != b.labels.height) return false;
  for (int y = 0; y < a.labels.height; ++y) {
    if (std::memcmp(a.labels.row(y), b.labels.row(y), static_cast<std::size_t>(a.labels.width)) != 0)
      return false;
  }
  return true;
}

bool sameRig(const Rig& a, const Rig& b) {
  bool same = a.camera_count == b.camera_count && a.camera_to_imu_shift == b.camera_to_imu_shift &&
              a.readout == b.readout;
  for (std::size_t i = 0; same && i < a.camera_count; ++i) {
    const CameraModel& p = a.camera[i];
    const CameraModel& q = b.camera[i];
    same = p.kind() == q.kind() && p.width() == q.width() && p.height() == q.height() &&
           sameNumber(p.maxTheta(), q.maxTheta()) && sameNumbers(p.intrinsics(), q.intrinsics()) &&
           sameNumbers(p.distortion(), q.distortion()) &&
           sameNumbers(a.T_body_cam[i].rotation.coeffs(), b.T_body_cam[i].rotation.coeffs()) &&
           sameNumbers(a.T_body_cam[i].translation, b.T_body_cam[i].translation);
  }
  return same;
}

std::string difference(RecordingSource& source, const std::vector<Entry>& script, std::size_t count) {
  RecordedSteps steps;
  std::vector<RecordingLoss> losses;
  std::array<std::uint64_t, kRecordKinds> number{};
  SensorMessage message;
  std::size_t samples = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Entry& entry = script[i];
    const std::string where = "entry " + std::to_string(i) + ": ";
    std::uint64_t& last = number[static_cast<std::size_t>(entry.kind)];
    switch (entry.kind) {
      case RecordKind::kImu:
        ++last;
        if (!source.next(message) || !std::holds_alternative<ImuSample>(message)) return where + "no sample";
        if (!sameBits(std::get<ImuSample>(message), entry.sample)) return where + "another sample";
        if (source.imu(samples).arrival != entry.arrival) return where + "another arrival";
        if (source.imuNumber(samples++) != last) return where + "another number";
        break;
      case RecordKind::kImage0:
      case RecordKind::kImage1: {
        ++last;
        if (!source.next(message) || !std::holds_alternative<CameraFrame>(message)) return where + "no image";
        if (!sameFrame(std::get<CameraFrame>(message), entry.frame)) return where + "another image";
        CameraFrame again;
        if (!source.image(entry.frame.camera, last, again)) return where + "no image of this number";
        if (!sameFrame(again, entry.frame)) return where + "another image of this number";
        break;
      }
      case RecordKind::kPropagateStep:
        steps.propagate.push_back(entry.propagate);
        break;
      case RecordKind::kTrackStep:
        steps.track.push_back(entry.track);
        break;
      case RecordKind::kSmoothStep:
        steps.smooth.push_back(entry.smooth);
        break;
      case RecordKind::kMeshStep:
        steps.mesh.push_back(entry.mesh);
        break;
      case RecordKind::kLoopStep:
        steps.loop.push_back(entry.loop);
        break;
      case RecordKind::kMapStep: {
        SceneImages scene;
        const bool any = source.mapScene(steps.map.size(), scene);
        if (any == entry.scene.empty() || !sameScene(scene, entry.scene)) return where + "another scene";
        steps.map.push_back(entry.map);
        break;
      }
      default: {
        std::uint64_t& of_kind = number[static_cast<std::size_t>(entry.loss.kind)];
        losses.push_back({entry.loss.kind, of_kind, entry.loss.count, {}, 0, 0});
        of_kind += entry.loss.count;
      }
    }
    if (entry.kind == RecordKind::kPropagateStep || entry.kind == RecordKind::kTrackStep ||
        entry.kind == RecordKind::kSmoothStep || entry.kind == RecordKind::kMeshStep ||
        entry.kind == RecordKind::kLoopStep || entry.kind == RecordKind::kMapStep) {
      ++last;
    }
  }
  if (source.next(message)) return "more messages than there should be";
  if (source.imuCount() != samples) return "another number of samples";
  if (source.steps().propagate != steps.propagate) return "other propagation steps";
  if (source.steps().track != steps.track) return "other tracking steps";
  if (source.steps().smooth != steps.smooth) return "other smoothing steps";
  if (source.steps().mesh != steps.mesh) return "other mesh steps";
  if (source.steps().loop != steps.loop) return "other steps of loop closure";
  if (source.steps().map != steps.map) return "other mapping steps";
  const auto same_loss = [](const RecordingLoss& a, const RecordingLoss& b) {
    return a.kind == b.kind && a.after == b.after && a.count == b.count;
  };
  if (!std::equal(losses.begin(), losses.end(), source.losses().begin(), source.losses().end(), same_loss)) {
    return "other losses";
  }
  return {};
}

std::size_t MemoryFile::read(std::uint64_t offset, std::span<std::uint8_t> out) const {
  if (offset >= bytes_.size()) return 0;
  const std::size_t count = std::min(out.size(), bytes_.size() - static_cast<std::size_t>(offset));
  std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), count, out.begin());
  return count;
}

RecordingFiles inMemory(const std::vector<Bytes>& segments) {
  RecordingFiles files;
  files.folder = "memory";
  for (const Bytes& bytes : segments) {
    const SegmentName name = segmentName(static_cast<std::uint32_t>(files.segments.size()));
    files.segments.push_back(std::make_unique<MemoryFile>(name.data(), bytes));
  }
  return files;
}

std::vector<Bytes> readSegments(const fs::path& folder) {
  std::vector<Bytes> segments;
  for (std::uint32_t i = 0;; ++i) {
    const fs::path file = folder / segmentName(i).data();
    if (!fs::exists(file)) return segments;
    const std::string text = readText(file);
    segments.emplace_back(text.begin(), text.end());
  }
}

std::uint64_t RecordedScript::begin(std::size_t segment) const {
  std::uint64_t at = 0;
  for (std::size_t i = 0; i < segment; ++i) at += segments[i].size();
  return at;
}

std::uint8_t& RecordedScript::byte(std::uint64_t at) {
  std::size_t segment = 0;
  while (at >= segments[segment].size()) at -= segments[segment++].size();
  return segments[segment][static_cast<std::size_t>(at)];
}

std::size_t RecordedScript::wholeBefore(std::uint64_t at) const {
  return static_cast<std::size_t>(std::upper_bound(ends.begin(), ends.end(), at) - ends.begin());
}

RecordedScript recordScript(std::uint64_t seed, std::size_t count, std::size_t segment_bytes) {
  const TempFolder folder;
  RecordedScript recorded;
  recorded.script = wildScript(seed, count);
  RecordingOptions options;
  options.segment_bytes = segment_bytes;
  RecordingWriter writer((folder.path() / "recording").string(), wildHeader(RecordOrder::kAsWritten),
                         options);
  recorded.ends.push_back(writer.statistics().bytes);
  for (const Entry& entry : recorded.script) {
    REQUIRE(record(writer, entry).ok());
    recorded.ends.push_back(writer.statistics().bytes);
  }
  REQUIRE(writer.end().ok());
  recorded.ends.push_back(writer.statistics().bytes);
  recorded.segments = readSegments(folder.path() / "recording");
  REQUIRE(recorded.size() == recorded.ends.back());
  return recorded;
}

}  // namespace swiftlet::test
