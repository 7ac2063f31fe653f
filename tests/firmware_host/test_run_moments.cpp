// The moments of a run: which images, poses, features, loop matches and meshes belong to them, and what is
// said where some are missing.

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/open_log.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/lab/report/run_moments.hpp"
#include "firmware_host/outputs/map_files/mesh_files.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/smoothing/map_keeper.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr PictureBounds kLarge = {800, std::size_t{1} << 20U};
constexpr std::size_t kImages = 80;  // of the log, each camera
constexpr std::size_t kLoopAt = 60;  // keyframes are every tenth image
const std::string kLog = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";

struct Flight {
  std::vector<Stamp> stamps;
  Rig rig;
  ImuNoise noise;

  Flight() {
    LogOptions options;
    options.wants_image = [this](Stamp stamp, std::uint32_t camera) {
      if (camera == 0) stamps.push_back(stamp);
      return false;
    };
    const auto log = openLog(kLog, options);
    SensorMessage message;
    while (log->next(message)) {
    }
    rig = log->rig();
    noise = log->imuNoise();
    REQUIRE(stamps.size() == kImages);
  }

  [[nodiscard]] static SE3 pose(std::size_t i) {
    return SE3(Eigen::Quaterniond::Identity(), {0.01 * static_cast<double>(i), 0, 0});
  }

  static TrackedFeature feature(std::size_t image, TrackId id) {
    TrackedFeature made;
    made.id = id;
    made.seen = {true, id % 2 == 0};
    const auto u = static_cast<float>(image + id);
    made.pixel = {Eigen::Vector2f(u, 20.04F), Eigen::Vector2f(u - 5, 20.5F)};
    return made;
  }

  void writeKeyframes(const std::string& folder) const {
    LostFiles lost;
    MapKeeper keeper(folder, rig, noise, OdometrySettings(), lost);
    for (std::size_t i = 0; i < kImages; i += 10) {
      keeper.addImu({stamps[i], {0, 0, 0}, {0, 0, 9.81}});
      TrackedFrame frame;
      frame.stamp = stamps[i];
      for (const TrackId id : {7U, 4U, 2U}) REQUIRE(frame.features.tryPushBack(feature(i, id)));
      NavState state;
      state.T_world_body = pose(i);
      keeper.addKeyframe(frame, state, {0.5, {1, 1}});
    }
    LoopRevisit loop;
    loop.old_stamp = stamps[10];
    loop.new_stamp = stamps[kLoopAt];
    loop.matches.resize(2);
    // One by pixels, one by tracks of the two keyframes.
    loop.matches[0].old_feature = {false, 0, {true, false}, {Eigen::Vector2f(1, 2), Eigen::Vector2f(0, 0)}};
    loop.matches[0].new_feature = {false, 0, {true, false}, {Eigen::Vector2f(3, 4), Eigen::Vector2f(0, 0)}};
    loop.matches[1].old_feature = {true, 4, {}, {}};
    loop.matches[1].new_feature = {true, 2, {}, {}};
    keeper.addRevisit(loop);
    keeper.finish();
    REQUIRE(lost.count() == 0);
  }

  /// A run without its last image's pose.
  void writeRun(const std::string& folder) const {
    fs::create_directories(folder);
    const fs::path path(folder);
    LineFile odometry(path / "odometry.tum");
    for (std::size_t i = 0; i + 1 < kImages; ++i) odometry.write(formatTum(stamps[i], pose(i)));
    writeJson((path / "summary.json").string(), {{"run",
                                                  {{"log", kLog},
                                                   {"cameras", 2},
                                                   {"first_image_ns", stamps.front().ns},
                                                   {"last_image_ns", stamps.back().ns}}}});
    writeKeyframes(folder);
  }
};

TEST_CASE("every image is a moment with its pose, and keyframes have their features") {
  const ScratchFolder folder("moments");
  const Flight flight;
  flight.writeRun(folder.file("run"));
  RunMoments moments(readRunFiles(folder.file("run")), "");
  CHECK(moments.missing().empty());
  REQUIRE(moments.count() == kImages);
  CHECK(moments.camerasJson() ==
        Json::array({{{"width", 752}, {"height", 480}}, {{"width", 752}, {"height", 480}}}));

  // Any order: forth, back, the same again.
  for (const std::size_t i : {50U, 10U, 79U, 79U, 0U}) {
    CAPTURE(i);
    const Json message = moments.message(i, kLarge);
    CHECK(message["t"].get<double>() == Approx((flight.stamps[i] - flight.stamps[0]).seconds()));
    CHECK(message["keyframe"] == (i % 10 == 0));
    REQUIRE(message["cameras"].size() == 2);
    for (const Json& camera : message["cameras"]) {
      CHECK(camera["src"].get<std::string>().starts_with("data:image/jpeg;base64,/9j/"));
      CHECK(camera.contains("tracks") == (i % 10 == 0));
      CHECK_FALSE(camera.contains("mesh"));
    }
  }
  const Json message = moments.message(50, kLarge);
  CHECK(message["cameras"][0]["tracks"] == Json({2, 52.0, 20.0, 0, 4, 54.0, 20.0, 0, 7, 57.0, 20.0, 0}));
  CHECK(message["cameras"][1]["tracks"] == Json({2, 47.0, 20.5, 0, 4, 49.0, 20.5, 0}));
  CHECK(moments.message(10, kLarge)["cameras"][0]["src"] != message["cameras"][0]["src"]);
  CHECK(message["cameras"][0]["src"] != message["cameras"][1]["src"]);

  const Json loop = moments.message(kLoopAt, kLarge)["cameras"][0]["loop"];
  CHECK(loop["text"] == "loop closure with 0.50 s, 2 matches");
  CHECK(loop["matches"] == Json({3.0, 4.0, 1.0, 2.0, 62.0, 20.0, 14.0, 20.0}));
  CHECK_FALSE(moments.message(50, kLarge)["cameras"][0].contains("loop"));

  const Json all = servedMoments(moments, "moment");
  CHECK(all["playback"]["count"] == kImages);
  CHECK(all["playback"]["source"] == "moment");
}

TEST_CASE("a report has a handful of keyframes within the bytes that it is given") {
  const ScratchFolder folder("moments_report");
  const Flight flight;
  flight.writeRun(folder.file("run"));
  RunMoments moments(readRunFiles(folder.file("run")), "");
  for (const std::size_t bytes : {std::size_t{512} * 1024, std::size_t{150} * 1024}) {
    CAPTURE(bytes);
    const Json json = embeddedMoments(moments, bytes);
    const Json& messages = json["playback"]["messages"];
    REQUIRE(messages.size() == 6);
    CHECK(json["playback"]["count"] == 6);
    std::size_t sum = 0;
    for (const Json& message : messages) {
      CHECK(message["keyframe"] == true);
      for (const Json& camera : message["cameras"]) {
        if (!camera.is_null()) sum += camera["src"].get<std::string>().size();
      }
    }
    CHECK(sum <= bytes);
    CHECK(sum > bytes / 10);
  }
}

TEST_CASE("the mesh of an image lies over it where its corners are") {
  const ScratchFolder folder("moments_mesh");
  const Flight flight;
  flight.writeRun(folder.file("run"));
  const std::size_t at = 20;
  {
    MeshSequenceWriter writer(folder.file("run"));
    LocalMesh mesh;
    mesh.stamp = flight.stamps[at];
    // Two triangles 3 m before camera 0, with one edge in common; the last corner is behind it.
    const SE3 T_world_cam = Flight::pose(at) * flight.rig.T_body_cam[0];
    for (const Eigen::Vector3d& corner : {Eigen::Vector3d(0, 0, 3), Eigen::Vector3d(0.5, 0, 3),
                                          Eigen::Vector3d(0, 0.5, 3), Eigen::Vector3d(0, 0, -3)}) {
      MeshVertex vertex;
      vertex.p_world = (T_world_cam * corner).cast<float>();
      REQUIRE(mesh.vertices.tryPushBack(vertex));
    }
    for (const std::uint32_t first : {0U, 1U}) {
      MeshFace face;
      face.vertex = {first, first + 1, first + 2};
      REQUIRE(mesh.faces.tryPushBack(face));
    }
    writer.write(true, mesh, nullptr, {});
  }
  RunMoments moments(readRunFiles(folder.file("run")), "");
  const Json message = moments.message(at, kLarge);
  const Json& mesh = message["cameras"][0]["mesh"];
  REQUIRE(mesh["vertices"].size() == 6);
  Eigen::Vector2d centre;
  REQUIRE(flight.rig.camera[0].project(Eigen::Vector3d(0, 0, 3), centre));
  CHECK(mesh["vertices"][0].get<double>() == Approx(centre.x()).margin(0.06));
  CHECK(mesh["vertices"][1].get<double>() == Approx(centre.y()).margin(0.06));
  CHECK(mesh["edges"] == Json({0, 1, 0, 2, 1, 2}));
  CHECK(message["scene"]["surfaces"][0]["faces"] == 2);
  CHECK_FALSE(moments.message(at + 1, kLarge).contains("scene"));
}

TEST_CASE("without its log a run has its poses, and it is said why there are no images") {
  const ScratchFolder folder("moments_none");
  const Flight flight;
  const std::string run = folder.file("run");
  flight.writeRun(run);
  RunFiles files = readRunFiles(run);
  files.summary["run"]["log"] = folder.file("gone");
  RunMoments moments(files, "");
  CHECK_FALSE(moments.hasImages());
  CHECK(moments.count() == kImages - 1);
  REQUIRE(moments.missing().size() == 1);
  CHECK(moments.missing()[0].what.find("--log") != std::string::npos);
  CHECK(moments.message(3, kLarge)["cameras"].empty());
  CHECK(embeddedMoments(moments, 1000).is_null());
  // As in the folder of another user: the kernel gives another error than "no such file".
  files.summary["run"]["log"] = folder.file(std::string(300, 'x'));
  const RunMoments unreachable(files, "");
  REQUIRE(unreachable.missing().size() == 1);
  CHECK(unreachable.missing()[0].what.find("File name too long. Name the log with --log") !=
        std::string::npos);
  // Named, it is taken; another one is not.
  CHECK(RunMoments(files, kLog).hasImages());
  files.first_image = flight.stamps.back() + Duration::fromSeconds(10);
  files.last_image = files.first_image + Duration::fromSeconds(10);
  CHECK_FALSE(RunMoments(files, kLog).hasImages());
}

TEST_CASE("an image that is gone or damaged is left out, and the others are shown") {
  const ScratchFolder folder("moments_damaged");
  const Flight flight;
  flight.writeRun(folder.file("run"));
  fs::copy(kLog, folder.file("log"), fs::copy_options::recursive);
  RunMoments moments(readRunFiles(folder.file("run")), folder.file("log"));
  std::vector<fs::path> images;
  for (const auto& entry : fs::directory_iterator(folder.file("log") + "/mav0/cam0/data"))
    images.push_back(entry);
  std::sort(images.begin(), images.end());
  REQUIRE(images.size() == kImages);
  fs::remove(images[30]);
  fs::resize_file(images[31], 100);
  for (const std::size_t i : {30U, 31U}) {
    const Json message = moments.message(i, kLarge);
    CHECK(message["cameras"][0].is_null());
    CHECK(message["cameras"][1].contains("src"));
  }
  CHECK(moments.message(32, kLarge)["cameras"][0].contains("src"));
}

}  // namespace
}  // namespace swiftlet
