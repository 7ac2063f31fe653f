// A run's bag read back with rosbag-storage: every message against the text files of the run folder.

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iomanip>
#include <map>
#include <set>
#include <sstream>
#include <tuple>

#include "drivers/image/image_decoder.hpp"
#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/export/bag_messages.hpp"
#include "firmware_host/lab/export/bag_output.hpp"
#include "firmware_host/lab/export/run_bag.hpp"
#include "firmware_host/outputs/map_files/map_files.hpp"
#include "tests/firmware_host/exported_run.hpp"
#include "tests/firmware_host/ros1_messages.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

using test::contains;
using test::errorOf;
using test::ExportedRun;
using test::run;
using test::textOf;

/// A row of numbers and its stamp as text, read with nothing of ours.
struct Row {
  std::string stamp;  ///< "seconds.nanoseconds"
  std::vector<double> v;
};

std::vector<Row> rowsOf(const std::string& file) {
  std::ifstream in(file);
  std::vector<Row> rows;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    for (char& c : line) c = c == ',' ? ' ' : c;
    std::istringstream columns(line);
    Row row;
    columns >> row.stamp;
    for (double value = 0; columns >> value;) row.v.push_back(value);
    rows.push_back(row);
  }
  return rows;
}

std::string secondsOf(const ros::Time& time) {
  std::ostringstream text;
  text << time.sec << '.' << std::setw(9) << std::setfill('0') << time.nsec;
  return text.str();
}
/// states.csv has nanoseconds.
std::string pointed(const std::string& nanoseconds) {
  std::string text = nanoseconds;
  while (text.size() < 10) text.insert(text.begin(), '0');
  return text.insert(text.size() - 9, ".");
}

/// All of a bag, by topic, in the bag's order.
class ReadBag {
 public:
  explicit ReadBag(const std::string& file) : bag_(file), view_(bag_) {
    for (const rosbag::MessageInstance& message : view_) by_topic_[message.getTopic()].push_back(message);
  }
  [[nodiscard]] std::set<std::string> topics() const {
    std::set<std::string> names;
    for (const auto& [topic, messages] : by_topic_) names.insert(topic);
    return names;
  }
  template <typename Message>
  std::vector<std::pair<std::string, Message>> all(const std::string& topic) {
    std::vector<std::pair<std::string, Message>> messages;
    for (const rosbag::MessageInstance& instance : by_topic_[topic]) {
      const auto message = instance.instantiate<Message>();
      REQUIRE(message);
      messages.emplace_back(secondsOf(instance.getTime()), *message);
    }
    return messages;
  }

 private:
  rosbag::Bag bag_;
  rosbag::View view_;
  std::map<std::string, std::vector<rosbag::MessageInstance>> by_topic_;
};

template <typename Message>
void checkHeader(const std::pair<std::string, Message>& message, const std::string& stamp,
                 const std::string& frame, std::size_t sequence) {
  REQUIRE(message.first == stamp);
  REQUIRE(secondsOf(message.second.header.stamp) == stamp);
  REQUIRE(message.second.header.frame_id == frame.c_str());
  REQUIRE(message.second.header.seq == sequence);
}

template <typename Pose>
void checkPose(const Pose& pose, const std::vector<double>& v) {
  REQUIRE(Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z) ==
          Eigen::Vector3d(v[0], v[1], v[2]));
  const Eigen::Quaterniond q(pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z);
  REQUIRE(q.angularDistance(Eigen::Quaterniond(v[6], v[3], v[4], v[5]).normalized()) < 1e-7);
}

SE3 poseOf(const BagTransform& transform) {
  const auto& t = transform.transform;
  return {Eigen::Quaterniond(t.rotation.w, t.rotation.x, t.rotation.y, t.rotation.z),
          {t.translation.x, t.translation.y, t.translation.z}};
}

struct Fixture : ExportedRun {
  Fixture() : bag(folder.file("run.bag")) { REQUIRE(test::run({"export", run, "--bag", bag}) == kExitDone); }
  std::string bag;
};

TEST_CASE("every pose of the run is in the bag with its stamp and frame", "[export]") {
  const Fixture exported;
  ReadBag bag(exported.bag);
  const std::set<std::string> kTopics = {"/diagnostics",
                                         "/swiftlet/bias_accel",
                                         "/swiftlet/bias_gyro",
                                         "/swiftlet/frame_mesh",
                                         "/swiftlet/health",
                                         "/swiftlet/imu_rate",
                                         "/swiftlet/imu_residual",
                                         "/swiftlet/local_mesh",
                                         "/swiftlet/local_points",
                                         "/swiftlet/map_path",
                                         "/swiftlet/odometry",
                                         "/swiftlet/path",
                                         "/swiftlet/pose",
                                         "/swiftlet/reprojection_rms",
                                         "/swiftlet/sigma_attitude",
                                         "/swiftlet/sigma_position",
                                         "/swiftlet/sigma_velocity",
                                         "/swiftlet/tracks",
                                         "/swiftlet/velocity",
                                         "/tf",
                                         "/tf_static",
                                         "/truth/path",
                                         "/truth/pose"};
  CHECK(bag.topics() == kTopics);
  for (const auto& [topic, name] :
       {std::pair{"/swiftlet/pose", "/odometry.tum"}, {"/swiftlet/imu_rate", "/imu_rate.tum"}}) {
    const std::vector<Row> rows = rowsOf(exported.run + name);
    const auto poses = bag.all<BagPose>(topic);
    REQUIRE(poses.size() == rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      checkHeader(poses[i], rows[i].stamp, "odom", i);
      checkPose(poses[i].second.pose, rows[i].v);
    }
  }
  for (const auto& [topic, name, frame] :
       {std::tuple{"/swiftlet/path", "/odometry.tum", "odom"}, {"/swiftlet/map_path", "/map.tum", "map"}}) {
    const std::vector<Row> rows = rowsOf(exported.run + name);
    const auto paths = bag.all<BagPath>(topic);
    REQUIRE(paths.size() == 1);
    checkHeader(paths[0], rows[0].stamp, frame, 0);
    REQUIRE(paths[0].second.poses.size() == rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const BagPose& pose = paths[0].second.poses[i];
      REQUIRE(secondsOf(pose.header.stamp) == rows[i].stamp);
      REQUIRE(pose.header.frame_id == frame);
      checkPose(pose.pose, rows[i].v);
    }
  }
}

TEST_CASE("the tree of frames gives the odometry and, at its keyframes, the map", "[export]") {
  const Fixture exported;
  ReadBag bag(exported.bag);
  const std::vector<Row> rows = rowsOf(exported.run + "/odometry.tum");
  const auto tf = bag.all<BagTransforms>("/tf");
  REQUIRE(tf.size() == rows.size());
  std::map<std::string, SE3> T_map_body;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    REQUIRE(tf[i].second.transforms.size() == 2);
    const BagTransform& map = tf[i].second.transforms[0];
    const BagTransform& body = tf[i].second.transforms[1];
    REQUIRE(tf[i].first == rows[i].stamp);
    REQUIRE(secondsOf(map.header.stamp) == rows[i].stamp);
    REQUIRE(secondsOf(body.header.stamp) == rows[i].stamp);
    CHECK(map.header.frame_id == "map");
    CHECK(map.child_frame_id == "odom");
    CHECK(body.header.frame_id == "odom");
    CHECK(body.child_frame_id == "base_link");
    CHECK((poseOf(body).translation - Eigen::Vector3d(rows[i].v[0], rows[i].v[1], rows[i].v[2])).norm() == 0);
    T_map_body[rows[i].stamp] = poseOf(map) * poseOf(body);
  }
  std::size_t compared = 0;
  for (const Row& row : rowsOf(exported.run + "/map.tum")) {
    const auto at = T_map_body.find(row.stamp);
    if (at == T_map_body.end()) continue;
    ++compared;
    CHECK((at->second.translation - Eigen::Vector3d(row.v[0], row.v[1], row.v[2])).norm() < 1e-8);
  }
  CHECK(compared > 10);
  const auto fixed = bag.all<BagTransforms>("/tf_static");
  REQUIRE(fixed.size() == 1);
  REQUIRE(fixed[0].second.transforms.size() == 1);
  CHECK(fixed[0].second.transforms[0].header.frame_id == "odom");
  CHECK(fixed[0].second.transforms[0].child_frame_id == "truth");
}

TEST_CASE("the truth in the bag lies beside the odometry", "[export]") {
  const Fixture exported;
  ReadBag bag(exported.bag);
  const SE3 T_odom_truth = poseOf(bag.all<BagTransforms>("/tf_static")[0].second.transforms[0]);
  std::map<std::string, Eigen::Vector3d> truth;
  for (const auto& [stamp, pose] : bag.all<BagPose>("/truth/pose")) {
    REQUIRE(pose.header.frame_id == "truth");
    truth[stamp] =
        T_odom_truth * Eigen::Vector3d(pose.pose.position.x, pose.pose.position.y, pose.pose.position.z);
  }
  double worst = 0;
  std::size_t compared = 0;
  for (const auto& [stamp, pose] : bag.all<BagPose>("/swiftlet/pose")) {
    const auto at = truth.find(stamp);
    if (at == truth.end()) continue;
    const auto& p = pose.pose.position;
    worst = std::max(worst, (at->second - Eigen::Vector3d(p.x, p.y, p.z)).norm());
    ++compared;
  }
  CHECK(compared > 10);
  CHECK(worst < 0.1);
}

TEST_CASE("keyframes are in the bag with velocity, covariance and biases", "[export]") {
  const Fixture exported;
  ReadBag bag(exported.bag);
  // Keyframes stand there in the order in which they left the window.
  std::vector<Row> rows = rowsOf(exported.run + "/states.csv");
  std::ranges::sort(rows, {}, &Row::stamp);
  const auto odometry = bag.all<BagOdometry>("/swiftlet/odometry");
  const auto gyro = bag.all<BagVector>("/swiftlet/bias_gyro");
  const auto accel = bag.all<BagVector>("/swiftlet/bias_accel");
  REQUIRE(odometry.size() == rows.size());
  REQUIRE(gyro.size() == rows.size());
  REQUIRE(accel.size() == rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& v = rows[i].v;
    const std::string stamp = pointed(rows[i].stamp);
    checkHeader(odometry[i], stamp, "odom", i);
    checkHeader(gyro[i], stamp, "base_link", i);
    checkHeader(accel[i], stamp, "base_link", i);
    const BagOdometry& message = odometry[i].second;
    CHECK(message.child_frame_id == "base_link");
    checkPose(message.pose.pose, {v[0], v[1], v[2], v[4], v[5], v[6], v[3]});
    const Eigen::Matrix3d R = Eigen::Quaterniond(v[3], v[4], v[5], v[6]).toRotationMatrix();
    const auto& linear = message.twist.twist.linear;
    CHECK((R * Eigen::Vector3d(linear.x, linear.y, linear.z) - Eigen::Vector3d(v[7], v[8], v[9])).norm() <
          1e-12);
    // Columns: variances from 16 (phi, p, ...); then the upper triangle of (phi, p) without its diagonal.
    CHECK(message.pose.covariance[0] == Approx(v[19]));
    CHECK(message.pose.covariance[7] == Approx(v[20]));
    CHECK(message.pose.covariance[14] == Approx(v[21]));
    CHECK(message.pose.covariance[1] == Approx(v[31 + 12]));
    Eigen::Matrix3d phi;
    phi << v[16], v[31], v[32], v[31], v[17], v[36], v[32], v[36], v[18];
    const Eigen::Matrix3d turned = R * phi * R.transpose();
    CHECK(message.pose.covariance[21] == Approx(turned(0, 0)));
    CHECK(message.pose.covariance[22] == Approx(turned(0, 1)));
    CHECK(message.pose.covariance[35] == Approx(turned(2, 2)));
    CHECK(Eigen::Vector3d(gyro[i].second.vector.x, gyro[i].second.vector.y, gyro[i].second.vector.z) ==
          Eigen::Vector3d(v[10], v[11], v[12]));
    CHECK(Eigen::Vector3d(accel[i].second.vector.x, accel[i].second.vector.y, accel[i].second.vector.z) ==
          Eigen::Vector3d(v[13], v[14], v[15]));
  }
}

TEST_CASE("what is plotted of a keyframe stands in fields of its own", "[export]") {
  const Fixture exported;
  ReadBag bag(exported.bag);
  const RunFolder folder = readRunFolder(exported.run);
  const auto velocity = bag.all<BagVector>("/swiftlet/velocity");
  const auto attitude = bag.all<BagVector>("/swiftlet/sigma_attitude");
  const auto position = bag.all<BagVector>("/swiftlet/sigma_position");
  const auto speed = bag.all<BagVector>("/swiftlet/sigma_velocity");
  const auto health = bag.all<BagNumber>("/swiftlet/health");
  const auto tracks = bag.all<BagNumber>("/swiftlet/tracks");
  REQUIRE(velocity.size() == folder.keyframes.size());
  REQUIRE(health.size() == folder.keyframes.size());
  std::vector<Row> rows = rowsOf(exported.run + "/states.csv");
  std::ranges::sort(rows, {}, &Row::stamp);
  const auto vector = [](const BagVector& v) { return Eigen::Vector3d(v.vector.x, v.vector.y, v.vector.z); };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& v = rows[i].v;
    checkHeader(velocity[i], pointed(rows[i].stamp), "odom", i);
    checkHeader(attitude[i], pointed(rows[i].stamp), "base_link", i);
    CHECK(vector(velocity[i].second) == Eigen::Vector3d(v[7], v[8], v[9]));
    // Variances begin at column 16: phi, p, v.
    for (int k = 0; k < 3; ++k) {
      const auto at = static_cast<std::size_t>(16 + k);
      CHECK(vector(attitude[i].second)[k] == Approx(std::sqrt(v[at])));
      CHECK(vector(position[i].second)[k] == Approx(std::sqrt(v[at + 3])));
      CHECK(vector(speed[i].second)[k] == Approx(std::sqrt(v[at + 6])));
    }
    CHECK(health[i].first == pointed(rows[i].stamp));
    CHECK(health[i].second.data == (folder.keyframes[i].state.health == Health::kGood ? 0 : 1));
    CHECK(tracks[i].second.data == folder.keyframes[i].statistics.tracks);
  }
}

TEST_CASE("the corners of a mesh are points with their label's colour", "[export]") {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 2}};
  mesh.grey = {10, 20, 30, 40};
  mesh.faces = {{0, 1, 2}, {1, 3, 2}};
  mesh.labels = {0, 7};
  const rosmsg::PointCloud2 cloud = bagPoints(Stamp{5}, "map", mesh);
  REQUIRE(cloud.width == 4);
  REQUIRE(cloud.data.size() == 4 * cloud.point_step);
  const auto word = [&cloud](std::size_t point, std::size_t field) {
    std::uint32_t value = 0;
    std::memcpy(&value, cloud.data.data() + point * cloud.point_step + cloud.point_fields[field].offset, 4);
    return value;
  };
  const auto [r, g, b] = labelColour(7);
  const std::uint32_t labelled = std::uint32_t{r} << 16U | std::uint32_t{g} << 8U | b;
  CHECK(word(0, 3) == 0x0A0A0A);
  CHECK(word(0, 4) == 0);
  CHECK(word(1, 3) == labelled);
  CHECK(word(1, 4) == 7);
  CHECK(word(3, 3) == labelled);
  CHECK(std::bit_cast<float>(word(3, 2)) == 2);
  // ROS 1's own packages read it.
  const ScratchFolder folder("points");
  const std::string file = folder.file("points.bag");
  writeBag(BagForm::kRos1, file, [&](MessageBag& bag) { bag.write("/points", Stamp{5}, cloud); });
  ReadBag bag(file);
  const auto read = bag.all<BagPoints>("/points");
  REQUIRE(read.size() == 1);
  CHECK(read[0].second.fields.size() == 5);
  CHECK(read[0].second.fields[4].datatype == BagField::UINT32);
  CHECK(std::ranges::equal(read[0].second.data, cloud.data));
}

TEST_CASE("meshes are triangle lists, events and health are diagnostics", "[export]") {
  const Fixture exported;
  ReadBag bag(exported.bag);
  const RunFolder folder = readRunFolder(exported.run);
  std::size_t expected = 0;
  for (const MeshFrame& frame : folder.meshes) expected += frame.frame_mesh.empty() ? 0 : 1;
  const auto meshes = bag.all<BagMarker>("/swiftlet/frame_mesh");
  REQUIRE(meshes.size() == expected);
  std::size_t triangles = 0;
  for (const auto& [stamp, marker] : meshes) {
    REQUIRE(secondsOf(marker.header.stamp) == stamp);
    CHECK(marker.header.frame_id == "odom");
    CHECK(marker.type == BagMarker::TRIANGLE_LIST);
    CHECK(marker.points.size() % 3 == 0);
    CHECK(marker.colors.size() == marker.points.size());
    CHECK(marker.pose.orientation.w == 1);
    CHECK(marker.scale.x == 1);
    triangles += marker.points.size() / 3;
  }
  CHECK(triangles > 100);
  std::size_t events = 0;
  std::size_t keyframes = 0;
  bool good = false;
  for (const auto& [stamp, diagnostics] : bag.all<BagDiagnostics>("/diagnostics")) {
    REQUIRE(secondsOf(diagnostics.header.stamp) == stamp);
    if (diagnostics.status[0].name == "swiftlet/keyframe") ++keyframes;
    if (diagnostics.status[0].name != "swiftlet/health") continue;
    ++events;
    REQUIRE(diagnostics.status.size() == 2);
    if (diagnostics.status[1].message == "health_changed good") {
      good = diagnostics.status[0].level == BagStatus::OK && diagnostics.status[0].message == "good";
    }
  }
  CHECK(good);
  CHECK(events == folder.events.size());
  CHECK(keyframes == folder.keyframes.size());
}

TEST_CASE("the same run gives the same bytes, and other frames where they are asked for", "[export]") {
  const Fixture exported;
  const std::string again = exported.folder.file("again.bag");
  REQUIRE(run({"export", exported.run, "--bag", again}) == kExitDone);
  CHECK(textOf(exported.bag) == textOf(again));
  REQUIRE(run({"export", exported.run, "--bag", again, "--no-meshes", "--no-truth", "--odom-frame", "world",
               "--body-frame", "imu"}) == kExitDone);
  ReadBag bag(again);
  CHECK_FALSE(bag.topics().contains("/swiftlet/frame_mesh"));
  CHECK_FALSE(bag.topics().contains("/truth/pose"));
  CHECK(bag.all<BagOdometry>("/swiftlet/odometry")[0].second.child_frame_id == "imu");
  CHECK(bag.all<BagPose>("/swiftlet/pose")[0].second.header.frame_id == "world");
}

TEST_CASE("a run without a map stands in the map frame unmoved", "[export]") {
  const ExportedRun exported;
  std::filesystem::remove(exported.run + "/map.tum");
  const std::string file = exported.folder.file("run.bag");
  REQUIRE(run({"export", exported.run, "--bag", file}) == kExitDone);
  ReadBag bag(file);
  const auto fixed = bag.all<BagTransforms>("/tf_static");
  REQUIRE(fixed.size() == 1);
  REQUIRE(fixed[0].second.transforms.size() == 2);
  CHECK(fixed[0].second.transforms[0].child_frame_id == "odom");
  CHECK(poseOf(fixed[0].second.transforms[0]).translation.isZero());
  CHECK(bag.all<BagTransforms>("/tf")[0].second.transforms.size() == 1);
}

TEST_CASE("a bag that cannot be written whole is not left behind", "[export]") {
  const ExportedRun exported;
  const std::string file = exported.folder.file("run.bag");
  CHECK(run({"export", exported.run, "--bag", exported.folder.file("none/run.bag")}) == kExitBadInput);
  const RunFolder folder = readRunFolder(exported.run);
  std::string mesh;
  for (const MeshFrame& frame : folder.meshes) {
    if (!frame.frame_mesh.empty()) mesh = frame.frame_mesh;
  }
  std::filesystem::resize_file(mesh, std::filesystem::file_size(mesh) - 5);
  CHECK(run({"export", exported.run, "--bag", file}) == kExitBadInput);
  CHECK_FALSE(std::filesystem::exists(file));
  std::filesystem::remove(mesh);
  CHECK(run({"export", exported.run, "--bag", file}) == kExitBadInput);
  CHECK(run({"export", exported.run, "--bag", file, "--no-meshes"}) == kExitDone);
  // A bag has no place for times before 1 ns.
  RunFolder early = folder;
  for (TrajectoryPoint& point : early.odometry) point.stamp.ns -= folder.odometry.front().stamp.ns;
  const InputError error = errorOf(
      [&] { writeBag(BagForm::kRos1, file, [&](MessageBag& bag) { writeRunBag(early, {}, {}, bag); }); });
  CHECK(contains(error.file, "odometry.tum"));
  CHECK(error.field == "stamp");
}

TEST_CASE("a log's messages are those of ROS's own packages", "[export]") {
  const ScratchFolder folder("ros1_log");
  const std::string log = std::string(SWIFTLET_TEST_DATA) + "/euroc_mh01_4s";
  const std::string file = folder.file("log.bag");
  REQUIRE(run({"export", log, "--bag", file}) == kExitDone);
  ReadBag bag(file);
  // instantiate() of REQUIRE in all() compares the sums of the definitions.
  CHECK(bag.all<sensor_msgs::Imu_<BagAllocator<void>>>("/imu0").size() > 900);
  CHECK(bag.all<sensor_msgs::CompressedImage_<BagAllocator<void>>>("/cam0/image_raw/compressed").size() ==
        80);
  const auto info = bag.all<sensor_msgs::CameraInfo_<BagAllocator<void>>>("/cam1/camera_info");
  REQUIRE(info.size() == 80);
  CHECK(info[0].second.distortion_model == "plumb_bob");
  CHECK(info[0].second.K[0] == Approx(457.587));
  CHECK(info[0].second.P[2] == Approx(379.999));
  REQUIRE(run({"export", log, "--bag", file, "--raw-images"}) == kExitDone);
  ReadBag raw(file);
  const auto images = raw.all<sensor_msgs::Image_<BagAllocator<void>>>("/cam0/image_raw");
  REQUIRE(images.size() == 80);
  CHECK(images[0].second.data.size() == 752U * 480U);
  REQUIRE(run({"export", log, "--bag", file, "--jpeg", "50"}) == kExitDone);
  ReadBag packed(file);
  const auto jpeg =
      packed.all<sensor_msgs::CompressedImage_<BagAllocator<void>>>("/cam0/image_raw/compressed");
  REQUIRE(jpeg.size() == 80);
  CHECK(jpeg[0].second.format == "jpeg");
  ImageDecoder decoder;
  std::vector<std::uint8_t> grey(752U * 480U);
  ImageSize found;
  REQUIRE(decoder.decode(jpeg[0].second.data, {752, 480}, grey.data(), found) == DecodeResult::kOk);
  double difference = 0;
  for (std::size_t i = 0; i < grey.size(); ++i) {
    difference += std::abs(static_cast<double>(grey[i]) - images[0].second.data[i]);
  }
  CHECK(difference / static_cast<double>(grey.size()) < 5);
}

TEST_CASE("ROS's own tools read the bag", "[export]") {
#ifdef SWIFTLET_ROSBAG_PYTHON
  const Fixture exported;
  const std::string command = std::string(SWIFTLET_ROSBAG_PYTHON " " SWIFTLET_TEST_SOURCE "/read_bag.py ") +
                              exported.bag + " " + exported.run;
  CHECK(std::system(command.c_str()) == 0);
#else
  skipCase("built without python3-rosbag", "toolchain/install.sh optional, then toolchain/test.sh");
#endif
}

}  // namespace
}  // namespace swiftlet
