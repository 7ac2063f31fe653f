// Kept maps: bit for bit, continued, smaller pools, and what is damaged.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "tests/mapping/volume_scene.hpp"
#include "tests/support/input_error.hpp"

using namespace swiftlet;           // NOLINT(google-build-using-namespace)
using namespace swiftlet::testing;  // NOLINT(google-build-using-namespace)

namespace {

constexpr std::size_t kHead = 96, kRecord = 12;  // docs/formats.md
const Ball kBall{{0.03, -0.02, 0.01}, 0.5};

std::uint32_t word(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

std::span<const std::uint8_t> part(const std::string& bytes, std::size_t at, std::size_t count) {
  return {reinterpret_cast<const std::uint8_t*>(bytes.data()) + at, count};
}

std::vector<std::size_t> recordsOf(const std::string& bytes) {
  std::vector<std::size_t> at;
  for (std::size_t i = kHead; i < bytes.size(); i += kRecord + word(bytes, i + 8)) at.push_back(i);
  return at;
}

/// All checksums right again.
void reseal(std::string& bytes) {
  const std::uint32_t head = crc32c(0, part(bytes, 0, kHead - 4));
  std::memcpy(bytes.data() + kHead - 4, &head, sizeof(head));
  for (const std::size_t at : recordsOf(bytes)) {
    const std::uint32_t crc = crc32c(head, part(bytes, at + 4, kRecord - 4 + word(bytes, at + 8)));
    std::memcpy(bytes.data() + at, &crc, sizeof(crc));
  }
}

struct Place {
  explicit Place(const VolumeSettings& settings = sceneSettings()) : volume(settings) {}
  VoxelVolume volume;
  double least_weight = SurfaceSettings{}.least_weight;
  std::uint32_t epoch = 0;
  Eigen::Vector3d vehicle = Eigen::Vector3d::Zero();

  [[nodiscard]] std::string kept() const {
    std::ostringstream out;
    (void)writeKeptMap("kept", out, {volume, least_weight, epoch, vehicle});
    return out.str();
  }
};

/// A ball in a round room.
double ballInRoom(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  if (const double t = kBall(origin, ray); t > 0) return t;
  constexpr double kRoom = 2;
  const double a = ray.squaredNorm(), b = origin.dot(ray), c = origin.squaredNorm() - kRoom * kRoom;
  return (-b + std::sqrt(b * b - a * c)) / a;
}

/// What `views` of it make.
Place mapped(int views) {
  Place place;
  VolumeIntegrator integrator(place.volume, kSceneCamera.pixels());
  VolumeStep fused;
  const std::vector<SE3> poses = viewsAround(kBall, 1.5);
  for (int i = 0; i < views; ++i) {
    const SE3& pose = poses[static_cast<std::size_t>(i)];
    SceneImage image = render(pose, 1 + i, ballInRoom);
    image.labels.assign(image.depth.size(), static_cast<std::uint8_t>(1 + i % 5));
    image.grey.assign(image.depth.size(), static_cast<std::uint8_t>(50 + i));
    (void)integrator.step(image.view(), pose, {}, fused);
    place.vehicle = pose.translation;
  }
  place.volume.beginChange();
  // More than one record has room for, in no order.
  for (std::int32_t i = 0; i < 600; ++i)
    place.volume.addFree({i * 7 % 600, 40, i % 3}, i % 4 == 0 ? kAllParts : std::uint64_t{1} << (i % 64),
                         place.vehicle.cast<float>());
  place.epoch = 3;
  return place;
}

KeptMapReport load(const std::string& bytes, Place& place) {
  std::istringstream in(bytes);
  KeptMapReport report = checkKeptMap("kept", in, place.volume.settings());
  loadKeptMap("kept", in, place.volume, nullptr, report);
  place.epoch = report.epoch;
  place.vehicle = report.p_map_vehicle;
  return report;
}

std::string refusal(const std::string& bytes, const VolumeSettings& settings = sceneSettings()) {
  std::istringstream in(bytes);
  return test::messageOf([&] { (void)checkKeptMap("kept.swm", in, settings); });
}

/// Few blocks, so that every byte can be tried.
std::string smallMap() {
  Place place;
  place.volume.beginChange();
  for (const std::int32_t x : {0, 1}) {
    const std::uint32_t slot = place.volume.obtain({x, 0, 0});
    VoxelBlock& voxels = place.volume.changeVoxels(slot);
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      voxels.distance[i] =
          static_cast<std::int16_t>(3000 * (static_cast<int>(i >> kBlockBits & kBlockMask) - 3) + 700);
      voxels.weight[i] = 256;
      (void)place.volume.changeLabels(slot)->counts[i].add(static_cast<std::uint8_t>(1 + i % 7));
    }
    place.volume.changeHeader(slot).sides = BlockHeader::kInFront | BlockHeader::kBehind;
  }
  for (const std::int32_t x : {4, 5, 6}) place.volume.addFree({x, 0, 0}, kAllParts, Eigen::Vector3f::Zero());
  return place.kept();
}

/// The map as version 1 had it: without parts of free blocks, all of which are free as a whole.
std::string asVersion1(const std::string& bytes) {
  constexpr std::size_t kIndex = 12, kParts = 8;
  constexpr char kFree = 2;
  std::string out = bytes.substr(0, kHead);
  out[8] = 1;
  for (const std::size_t at : recordsOf(bytes)) {
    std::string record = bytes.substr(at, kRecord + word(bytes, at + 8));
    if (record[4] == kFree) {
      std::string entries;
      for (std::size_t i = kRecord; i < record.size(); i += kIndex + kParts)
        entries += record.substr(i, kIndex) + std::string("\5\0\0\0", 4);
      const auto length = static_cast<std::uint32_t>(entries.size());
      std::memcpy(record.data() + 8, &length, sizeof(length));
      record = record.substr(0, kRecord) + entries;
    }
    out += record;
  }
  reseal(out);
  return out;
}

/// A stage with a depth sensor, over the same ball.
struct Flight {
  Flight() {
    rig.camera_count = 1;
    rig.camera[0] =
        CameraModel(CameraKind::kPinholeRadtan, kSceneCamera.width, kSceneCamera.height,
                    {kSceneCamera.fx, kSceneCamera.fy, kSceneCamera.cx, kSceneCamera.cy}, {0, 0, 0, 0});
    sensor.camera = kSceneCamera;
    settings.volume_mib = 8;
    settings.surface_mib = 4;
    map = std::make_unique<MapStage>(rig, settings, &sensor, nullptr, MapPoses::kGiven);
  }
  void fly(int first, int last, std::uint32_t epoch = 0) {
    const std::vector<SE3> poses = viewsAround(kBall, 1.5);
    for (int i = first; i < last; ++i) {
      const SceneImage image = render(poses[static_cast<std::size_t>(i)], 1 + i, ballInRoom);
      const std::vector<std::uint8_t> labels(image.depth.size(), static_cast<std::uint8_t>(1 + i % 5));
      MapInput input;
      input.stamp = image.stamp;
      input.epoch = epoch;
      input.T_map_body = poses[static_cast<std::size_t>(i)];
      input.depth = sensor;
      input.depth.depth = image.depth.data();
      input.labels = {labels.data(), kSceneCamera.width, kSceneCamera.height, kSceneCamera.width};
      MapReport report;
      MapEffort effort;
      effort.surface = kAllSurface;
      REQUIRE(map->step(input, effort, report).ok());
    }
  }
  [[nodiscard]] std::string kept() const {
    std::ostringstream out;
    (void)writeKeptMap("kept", out,
                       {map->volume(), map->surfaceSettings().least_weight, map->epoch(), map->vehicle()});
    return out.str();
  }
  Rig rig;
  DepthImageView sensor;
  MapSettings settings;
  std::unique_ptr<MapStage> map;
};

}  // namespace

TEST_CASE("a map comes back bit by bit", "[kept_map]") {
  const Place place = mapped(12);
  const std::string bytes = place.kept();
  Place again;
  const KeptMapReport report = load(bytes, again);
  CHECK(report.held.blocks == place.volume.blockCount());
  CHECK(report.held.free_blocks == place.volume.freeCount());
  CHECK(report.without_room.blocks + report.without_room.free_blocks == 0);
  REQUIRE(place.volume.freeCount() >= 600);
  CHECK(again.epoch == 3);
  CHECK(again.vehicle == place.vehicle);
  CHECK(again.kept() == bytes);
  // Said apart from the writer.
  for (std::uint32_t slot = 0; slot < place.volume.slots(); ++slot) {
    const BlockHeader& header = place.volume.header(slot);
    if (header.state != BlockState::kVoxels) continue;
    const std::uint32_t other = again.volume.find(header.index);
    REQUIRE(other != VoxelVolume::kNone);
    CHECK(place.volume.voxels(slot)->distance == again.volume.voxels(other)->distance);
    CHECK(place.volume.voxels(slot)->weight == again.volume.voxels(other)->weight);
    CHECK(place.volume.voxels(slot)->grey == again.volume.voxels(other)->grey);
    CHECK(std::memcmp(place.volume.labels(slot), again.volume.labels(other), sizeof(LabelBlock)) == 0);
  }
}

TEST_CASE("a map of version 1 is read, its free blocks as free as a whole", "[kept_map]") {
  const std::string bytes = smallMap(), old = asVersion1(bytes);
  CHECK(old.size() == bytes.size() - 3 * 4);
  Place place;
  CHECK(load(old, place).held.free_blocks == 3);
  CHECK(place.kept() == bytes);
}

TEST_CASE("a map of version 2 is read, its patches of the surface left out", "[kept_map]") {
  const std::string bytes = smallMap();
  std::string old = bytes;
  old[8] = 2;
  old[56] = 1;
  // Kind 3, four bytes of payload, before the end.
  old.insert(old.size() - kRecord, std::string("\0\0\0\0\3\0\0\0\4\0\0\0abcd", 16));
  reseal(old);
  Place place;
  CHECK(load(old, place).held.blocks == 2);
  CHECK(place.kept() == bytes);
}

TEST_CASE("a map that was kept and continued is that of an uninterrupted flight", "[kept_map]") {
  Flight whole, first, second;
  whole.fly(0, 20);
  first.fly(0, 11);
  std::istringstream in(first.kept());
  const KeptMapReport report = readKeptMap("kept", in, *second.map);
  CHECK(report.held.blocks > 20);
  CHECK(second.kept() == first.kept());
  second.fly(11, 20);
  // Blocks, label counts, the drift that decides when a block is drawn.
  CHECK(second.kept() == whole.kept());
  CHECK(second.map->surface().patches() == whole.map->surface().patches());
  // The distance field is made anew from the volume, whose blocks lie in another order.
  for (Flight* flight : {&whole, &second}) {
    MapReport done;
    do {
      flight->map->updateDistance(flight->map->vehicle(), {}, done);
    } while (!done.distance.caught_up);
  }
  for (double x = -0.9; x < 0.9; x += 0.13) {
    const DistanceSample a = whole.map->distance().query({x, 0.2, 0.1});
    const DistanceSample b = second.map->distance().query({x, 0.2, 0.1});
    CHECK(a.kind == b.kind);
    CHECK(a.distance == b.distance);
    CHECK(a.space == b.space);
  }
}

TEST_CASE("a damaged file is refused at the first byte, and the map stays as it was", "[kept_map]") {
  Flight flight;
  flight.fly(0, 3);
  const std::string before = flight.kept();
  Flight other;
  other.fly(3, 6);
  std::string bytes = other.kept();
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 4);
  std::istringstream in(bytes);
  CHECK_THROWS_AS(readKeptMap("kept", in, *flight.map), InputError);
  CHECK(flight.kept() == before);
}

TEST_CASE("cut short at any length a map is refused with the place", "[kept_map]") {
  const std::string bytes = smallMap();
  REQUIRE(refusal(bytes).empty());
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    const std::string message = refusal(bytes.substr(0, length));
    REQUIRE(message.find("the file ends at byte " + std::to_string(length)) != std::string::npos);
    REQUIRE(message.starts_with("kept.swm: byte "));
    REQUIRE(message.find("Nothing was loaded") != std::string::npos);
  }
  CHECK(refusal(bytes + "x").find("byte " + std::to_string(bytes.size())) != std::string::npos);
}

TEST_CASE("with any byte changed a map is refused, and the record named", "[kept_map]") {
  const std::string bytes = smallMap();
  std::vector<std::size_t> begins = recordsOf(bytes);
  begins.insert(begins.begin(), 0);
  begins.push_back(bytes.size());
  for (std::size_t record = 0; record + 1 < begins.size(); ++record) {
    for (std::size_t at = begins[record]; at < begins[record + 1]; ++at) {
      std::string damaged = bytes;
      damaged[at] = static_cast<char>(damaged[at] ^ (1 << (at % 8)));
      const std::string message = refusal(damaged);
      constexpr std::size_t kName = sizeof("kept.swm: byte ") - 1;
      REQUIRE(message.starts_with("kept.swm: byte "));
      const std::size_t named = std::stoul(message.substr(kName));
      REQUIRE(named >= begins[record]);
      REQUIRE(named < begins[record + 1]);
    }
  }
}

TEST_CASE("what no map holds is refused though its checksums are right", "[kept_map]") {
  const std::string good = smallMap();
  const std::vector<std::size_t> at = recordsOf(good);  // two blocks, free ones, end
  REQUIRE(at.size() == 4);
  const auto refused = [&](std::size_t place, std::initializer_list<int> bytes, const char* field) {
    std::string changed = good;
    for (const int byte : bytes) changed[place++] = static_cast<char>(byte);
    reseal(changed);
    CAPTURE(field, refusal(changed));
    CHECK(refusal(changed).find(field) != std::string::npos);
  };
  const std::size_t payload = at[0] + kRecord;
  refused(8, {4}, "version");
  refused(58, {0x80, 0x7F}, "least weight");
  refused(56, {0, 0, 0, 0}, "least weight");
  refused(12, {97}, "head's length");
  refused(22, {0, 0x80}, "settings");
  refused(40, {3}, "flags");
  refused(48, {3}, "end");
  refused(60, {16}, "voxels along a block");
  refused(70, {0xFF, 0x7F}, "vehicle");
  refused(88, {1}, "head");
  refused(at[0] + 4, {9}, "record's kind");
  refused(payload + 3, {0x70}, "block");
  refused(payload + 12, {7}, "sides");
  refused(payload + 16, {0, 0, 0xC0, 0x7F}, "drift");
  refused(payload + 20, {0, 0x80}, "distance");
  refused(payload + 20 + 5 * 512 + 2, {1, 8}, "label counts");
  refused(at[1] + kRecord, {0}, "farther");
  refused(at[2] + kRecord + 12, {0, 0, 0, 0, 0, 0, 0, 0}, "free parts");
}

TEST_CASE("a map of other settings is refused with the setting", "[kept_map]") {
  const std::string bytes = smallMap();
  VolumeSettings other = sceneSettings();
  other.voxel_size = 0.1;
  CHECK(refusal(bytes, other).find("map.voxel_size=0.05") != std::string::npos);
  other = sceneSettings();
  other.labels = false;
  CHECK(refusal(bytes, other).find("map.labels=true") != std::string::npos);
  other = sceneSettings();
  other.truncation = 0.2;
  CHECK(refusal(bytes, other).find("truncation") != std::string::npos);
}

TEST_CASE("a smaller pool takes the nearest and counts the rest", "[kept_map]") {
  const Place place = mapped(20);
  VolumeSettings small = sceneSettings();
  small.memory_bytes = 30 * 8000;
  Place taken(small);
  const KeptMapReport report = load(place.kept(), taken);
  CHECK(taken.volume.blockCount() == taken.volume.blockCapacity());
  CHECK(report.without_room.blocks == place.volume.blockCount() - taken.volume.blockCount());
  REQUIRE(report.without_room.blocks > 10);
  float farthest = 0, nearest = 1e9F;
  const Eigen::Vector3f vehicle = place.vehicle.cast<float>();
  for (std::uint32_t slot = 0; slot < place.volume.slots(); ++slot) {
    const BlockHeader& header = place.volume.header(slot);
    if (header.state != BlockState::kVoxels) continue;
    const float distance = (place.volume.centreOf(header.index) - vehicle).norm();
    if (taken.volume.find(header.index) == VoxelVolume::kNone) {
      nearest = std::min(nearest, distance);
    } else {
      farthest = std::max(farthest, distance);
    }
  }
  // In steps of a block.
  CHECK(farthest < nearest + 2 * place.volume.blockSize());
}
