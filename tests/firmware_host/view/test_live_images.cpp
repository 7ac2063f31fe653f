// Images of the live view and what is drawn over them: from slots as the cameras' threads lend them.

#include <algorithm>
#include <catch2/catch.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "firmware_host/outputs/view/live_images.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kWidth = 320;
constexpr int kHeight = 200;

Rig stereoRig() {
  Rig rig;
  rig.camera_count = 2;
  for (CameraModel& camera : rig.camera)
    camera = CameraModel(CameraKind::kPinholeRadtan, kWidth, kHeight, {200, 200, 159.5, 99.5},
                         Eigen::Vector4d::Zero());
  rig.T_body_cam[1].translation = {0.1, 0, 0};
  return rig;
}

/// The graph's side of a feed.
struct Flight {
  std::unique_ptr<LiveOutlet> outlet = std::make_unique<LiveOutlet>();
  std::vector<std::vector<std::uint8_t>> pixels;
  LiveImages images{stereoRig()};
  std::uint64_t number = 0;
  double now = 10;

  Flight() {
    outlet->images = std::make_unique<ImageFeed>();
    for (auto& pool : outlet->images->pool) {
      pool =
          std::make_shared<ImagePool>(ImagePool::Quotas{kTrackQuota, kMeshQuota, kRecordQuota, kViewQuota});
    }
    pixels.assign(kMaxCameras, std::vector<std::uint8_t>(std::size_t{kWidth} * kHeight, 90));
  }
  void image(std::size_t camera, Stamp stamp) {
    ImagePool& pool = *outlet->images->pool[camera];
    const SlotHandle handle = pool.tryAcquire();
    REQUIRE(handle.valid());
    ImageSlot& slot = pool.fill(handle);
    slot.frame.stamp = stamp;
    slot.frame.camera = static_cast<std::uint32_t>(camera);
    slot.frame.number = number;
    slot.frame.image = {pixels[camera].data(), kWidth, kHeight, kWidth};
    slot.host.open = 0.004;
    outlet->images->hand(camera, handle, stamp);
    pool.finish(handle);
  }
  void pair(Stamp stamp) {
    ++number;
    image(0, stamp);
    image(1, stamp);
  }
  void sight(Stamp stamp) {
    SightNews& news = outlet->images->sight.draft();
    news = SightNews{};
    news.stamp = stamp;
    news.frame = number - 1;
    news.image = {number, number};
    news.features.pushBack({7, {true, true}, {Eigen::Vector2f(10, 20), Eigen::Vector2f(8.04F, 20)}});
    news.features.pushBack({9, {true, false}, {Eigen::Vector2f(30.26F, 40), Eigen::Vector2f::Zero()}});
    news.landmarks.pushBack(9);
    news.lost.pushBack({Eigen::Vector2f(50, 60), 1, SightingLoss::kStereo});
    news.has_pose = true;
    outlet->images->sight.publish();
  }
  bool sample(bool watched = true) {
    now += 0.05;
    return images.sample(*outlet, now, watched);
  }
  [[nodiscard]] std::size_t held() const {
    return outlet->images->pool[0]->inUse() + outlet->images->pool[1]->inUse();
  }
};

Stamp at(double t) { return Stamp{} + Duration::fromSeconds(t); }

TEST_CASE("an instant has the pictures of a frame with its tracks, and gives the slots back") {
  Flight flight;
  CHECK_FALSE(flight.sample());
  flight.pair(at(1));
  CHECK_FALSE(flight.sample());  // its tracks are not there yet
  flight.pair(at(1.05));
  flight.sight(at(1.05));
  flight.pair(at(1.1));
  REQUIRE(flight.sample());
  CHECK(flight.images.stamp() == at(1.05));
  const Json json = flight.images.take(*flight.outlet, 0.05, {160, 70});
  CHECK(json["t"] == 0.05);
  CHECK(json["frame"] == 1);
  REQUIRE(json["cameras"].size() == 2);
  const Json& left = json["cameras"][0];
  CHECK(left["src"].get<std::string>().starts_with("data:image/jpeg;base64,/9j/"));
  CHECK(left["exposure_ms"].get<double>() == Approx(4));
  CHECK(left["tracks"] == Json({7, 10.0, 20.0, 0, 9, 30.3, 40.0, 1}));
  CHECK(left["rejected"].empty());
  const Json& right = json["cameras"][1];
  CHECK(right["tracks"] == Json({7, 8.0, 20.0, 0}));
  CHECK(right["rejected"] == Json({50.0, 60.0, 2}));
  // What is newer stays for its own tracks; what is older has gone back.
  CHECK(flight.held() == 2);
  CHECK_FALSE(flight.sample());
}

TEST_CASE("without tracks for half a second images come alone") {
  Flight flight;
  flight.sample();
  flight.pair(at(1));
  flight.sight(at(1));
  REQUIRE(flight.sample());
  flight.images.skip();
  int shown = 0;
  for (int i = 1; i <= 20; ++i) {
    flight.pair(at(1 + 0.05 * i));
    if (!flight.sample()) continue;
    ++shown;
    const Json json = flight.images.take(*flight.outlet, 0, {320, 70});
    CHECK_FALSE(json["cameras"][0].contains("tracks"));
    CHECK(json["cameras"][1].contains("src"));
  }
  CHECK(shown >= 1);
  CHECK(shown <= 2);
}

TEST_CASE("images of a slow camera wait for their tracks") {
  Flight flight;
  flight.sample();
  for (int i = 1; i <= 5; ++i) {
    flight.now += 2;
    flight.pair(at(2 * i));
    CHECK_FALSE(flight.sample());
    flight.sight(at(2 * i));
    REQUIRE(flight.sample());
    CHECK(flight.images.take(*flight.outlet, 0, {320, 70})["cameras"][0].contains("tracks"));
  }
}

TEST_CASE("while nobody looks no slot is held and nothing is lent") {
  Flight flight;
  flight.sample(false);
  for (int i = 0; i < 100; ++i) {
    flight.pair(at(0.05 * i));
    CHECK(flight.held() == 0);
  }
  flight.sample(true);
  flight.pair(at(6));
  CHECK(flight.held() == 2);
  flight.sample(false);
  CHECK(flight.held() == 0);
}

TEST_CASE("a reader that stands still holds its quota and no more; of a fast camera 30 a second are lent") {
  Flight flight;
  flight.sample(true);
  std::size_t most = 0;
  for (int i = 0; i < 1000; ++i) {
    flight.pair(at(0.005 * i));
    most = std::max(most, flight.held());
  }
  CHECK(most == 2 * kViewQuota);
  // Both cameras lent the same frames.
  ImagePool::Loan left, right;
  std::uint64_t before = 0;
  while (flight.outlet->images->tryPop(0, left)) {
    REQUIRE(flight.outlet->images->tryPop(1, right));
    CHECK(left->frame.number == right->frame.number);
    if (before > 0) CHECK(left->frame.number - before >= 6);
    before = left->frame.number;
  }
}

TEST_CASE("of the mesh the edges in the image are drawn, but not those of a back") {
  Flight flight;
  flight.sample();
  LocalMesh& mesh = flight.outlet->mesh.draft();
  mesh = LocalMesh{};
  // Counter-clockwise for a camera at the origin that looks along z, with y down.
  for (const Eigen::Vector3f& p : {Eigen::Vector3f(0, 0, 4), Eigen::Vector3f(0, -1, 4),
                                   Eigen::Vector3f(1, 0, 4), Eigen::Vector3f(0, 0, -4)}) {
    MeshVertex vertex;
    vertex.p_world = p;
    mesh.vertices.pushBack(vertex);
  }
  mesh.faces.pushBack({{0, 2, 1}, kNoLabel});
  mesh.faces.pushBack({{0, 1, 3}, kNoLabel});  // behind the camera
  flight.outlet->mesh.publish();
  flight.outlet->mesh.refresh();
  const auto edges = [&] {
    flight.pair(at(1 + flight.now));
    flight.sight(at(1 + flight.now));
    REQUIRE(flight.sample());
    return flight.images.take(*flight.outlet, 0, {320, 70})["cameras"][0]["mesh"];
  };
  const Json front = edges();
  CHECK(front["vertices"] == Json({159.5, 99.5, 159.5, 49.5, 209.5, 99.5}));
  CHECK(front["edges"] == Json({0, 1, 0, 2, 1, 2}));
  LocalMesh turned = flight.outlet->mesh.value();
  turned.faces[0].vertex = {0, 1, 2};
  flight.outlet->mesh.write(turned);
  flight.outlet->mesh.refresh();
  CHECK(edges()["edges"].empty());
}

}  // namespace
}  // namespace swiftlet
