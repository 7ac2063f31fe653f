// A subscriber of another make: eProsima Fast DDS with the types that its own generator made, ROS 2's topics
// and qualities of service. Takes what the link publishes until its standard input ends or SECONDS have gone
// by, checks every message, publishes label images, and prints one line a topic: received, lost, torn,
// repeated. usage: dds_subscriber SECONDS DOMAIN [DEPTH]   (messages of a topic that it keeps, 10)

#include <poll.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

#include "tests/drivers/dds/fast_peer.hpp"
#include "tests/drivers/dds/test_messages.hpp"

using swiftlet::test::listener;
using swiftlet::test::Peer;
using swiftlet::test::pointsOf;
namespace fast = swiftlet::test::fast;

namespace {

struct Tally {
  std::atomic<std::uint64_t> received{0}, lost{0}, torn{0}, repeated{0};
  std::uint64_t last = 0;

  void note(std::uint64_t n, bool whole) {
    ++received;
    if (!whole) {
      ++torn;
      return;
    }
    if (last != 0 && n <= last) ++repeated;
    if (last != 0 && n > last + 1) lost += n - last - 1;
    if (n > last) last = n;
  }
};

std::uint64_t numberOf(const std_msgs::msg::dds_::Header_& header) {
  // Stamps are n milliseconds.
  return static_cast<std::uint64_t>(header.stamp().sec()) * 1000 + header.stamp().nanosec() / 1'000'000;
}

void check(const nav_msgs::msg::dds_::Odometry_& m, Tally& tally) {
  const std::uint64_t n = numberOf(m.header());
  const auto v = static_cast<double>(n);
  bool whole = m.header().frame_id() == "odom" && m.child_frame_id() == "base_link" &&
               m.pose().pose().position().x() == v && m.pose().pose().position().y() == 0.5 * v &&
               m.pose().pose().position().z() == -v && m.pose().pose().orientation().w() == 1 &&
               m.twist().twist().linear().x() == -v && m.twist().twist().angular().x() == 0 &&
               m.twist().twist().angular().z() == 2 * v;
  for (std::size_t i = 0; i < 36; ++i) {
    whole = whole && m.pose().covariance()[i] == v + static_cast<double>(i) &&
            m.twist().covariance()[i] == v - static_cast<double>(i);
  }
  tally.note(n, whole);
}

void check(const tf2_msgs::msg::dds_::TFMessage_& m, Tally& tally) {
  if (m.transforms().size() != 2) return tally.note(0, false);
  const std::uint64_t n = numberOf(m.transforms()[0].header());
  const auto v = static_cast<double>(n);
  tally.note(n, numberOf(m.transforms()[1].header()) == n && m.transforms()[0].header().frame_id() == "map" &&
                    m.transforms()[0].child_frame_id() == "odom" &&
                    m.transforms()[1].header().frame_id() == "odom" &&
                    m.transforms()[1].child_frame_id() == "base_link" &&
                    m.transforms()[0].transform().translation().x() == -v &&
                    m.transforms()[1].transform().translation().x() == v &&
                    m.transforms()[1].transform().rotation().w() == 1);
}

void check(const visualization_msgs::msg::dds_::Marker_& m, Tally& tally) {
  const std::uint64_t n = numberOf(m.header());
  const auto points = static_cast<std::size_t>(pointsOf(n));
  bool whole = m.points().size() == points && m.colors().size() == points && m.type() == 11 &&
               m.action() == (points == 0 ? 2 : 0) && m.ns() == "local_mesh" && m.scale().y() == 1 &&
               m.pose().orientation().w() == 1 && !m.mesh_use_embedded_materials() && m.text().empty();
  for (std::size_t i = 0; whole && i < points; ++i) {
    whole = m.points()[i].x() == static_cast<float>(n) && m.points()[i].z() == static_cast<double>(i) &&
            m.colors()[i].g() == 0.25F && m.colors()[i].a() == 1;
  }
  tally.note(n, whole);
}

/// One point with ten fields.
void checkObstacle(const sensor_msgs::msg::dds_::PointCloud2_& m, Tally& tally) {
  const std::uint64_t n = numberOf(m.header());
  const auto v = static_cast<float>(n);
  bool whole = m.header().frame_id() == "base_link" && m.height() == 1 && m.width() == 1 && m.is_dense() &&
               m.point_step() == 40 && m.row_step() == 40 && m.data().size() == 40 &&
               m.fields().size() == 10 && m.fields()[3].name() == "normal_x" &&
               m.fields()[9].name() == "kind" && m.fields()[9].offset() == 36 &&
               m.fields()[9].datatype() == 6;
  if (whole) {
    const std::array<float, 9> expected = {v, -v, 0.5F, 0, 0, -1, v, 2 * v, 3 * v};
    const auto kind = static_cast<std::uint32_t>(n % 3);
    whole = std::memcmp(m.data().data(), expected.data(), 36) == 0 &&
            std::memcmp(m.data().data() + 36, &kind, 4) == 0;
  }
  tally.note(n, whole);
}

void check(const sensor_msgs::msg::dds_::PointCloud2_& m, Tally& tally) {
  const std::uint64_t n = numberOf(m.header());
  const auto points = static_cast<std::size_t>(pointsOf(n));
  bool whole = m.height() == 1 && m.width() == points && m.point_step() == 20 &&
               m.row_step() == 20 * points && m.data().size() == 20 * points && m.fields().size() == 5 &&
               m.is_dense() && !m.is_bigendian() && m.fields()[3].name() == "rgb" &&
               m.fields()[4].offset() == 16 && m.fields()[4].datatype() == 6;
  for (std::size_t i = 0; whole && i < points; ++i) {
    float z = 0;
    std::uint32_t label = 0;
    std::memcpy(&z, m.data().data() + 20 * i + 8, 4);
    std::memcpy(&label, m.data().data() + 20 * i + 16, 4);
    whole = z == static_cast<float>(i) && label == n % 32;
  }
  tally.note(n, whole);
}

void check(const diagnostic_msgs::msg::dds_::DiagnosticArray_& m, Tally& tally) {
  const std::uint64_t n = numberOf(m.header());
  const std::string text = std::to_string(n);
  bool whole = m.status().size() == 2;
  for (std::size_t i = 0; whole && i < 2; ++i) {
    const auto& status = m.status()[i];
    whole = status.level() == i && status.message() == text && status.hardware_id() == "swiftlet" &&
            status.values().size() == i + 1 && status.values()[i].key() == "n" &&
            status.values()[i].value() == text;
  }
  tally.note(n, whole);
}

void print(const char* topic, const Tally& tally) {
  std::printf("%s %llu %llu %llu %llu\n", topic, static_cast<unsigned long long>(tally.received),
              static_cast<unsigned long long>(tally.lost), static_cast<unsigned long long>(tally.torn),
              static_cast<unsigned long long>(tally.repeated));
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 10;
  const auto domain = static_cast<std::uint32_t>(argc > 2 ? std::atoi(argv[2]) : 0);
  Tally odometry, transforms, mesh, cloud, obstacle, diagnostics;
  const auto checks = [](auto& tally) { return [&tally](const auto& message) { check(message, tally); }; };
  auto on_odometry = listener<nav_msgs::msg::dds_::Odometry_>(checks(odometry));
  auto on_transforms = listener<tf2_msgs::msg::dds_::TFMessage_>(checks(transforms));
  auto on_mesh = listener<visualization_msgs::msg::dds_::Marker_>(checks(mesh));
  auto on_cloud = listener<sensor_msgs::msg::dds_::PointCloud2_>(checks(cloud));
  auto on_obstacle = listener<sensor_msgs::msg::dds_::PointCloud2_>(
      [&](const auto& message) { checkObstacle(message, obstacle); });
  auto on_diagnostics = listener<diagnostic_msgs::msg::dds_::DiagnosticArray_>(checks(diagnostics));
  const std::string prefix = swiftlet::test::kDdsPrefix;
  {
    Peer peer(domain, argc > 3 ? std::atoi(argv[3]) : 10);
    peer.read<nav_msgs::msg::dds_::Odometry_PubSubType>(prefix + "/odometry", on_odometry);
    peer.read<tf2_msgs::msg::dds_::TFMessage_PubSubType>("/tf", on_transforms);
    peer.read<visualization_msgs::msg::dds_::Marker_PubSubType>(prefix + "/local_mesh", on_mesh);
    peer.read<sensor_msgs::msg::dds_::PointCloud2_PubSubType>(prefix + "/surface", on_cloud);
    peer.read<sensor_msgs::msg::dds_::PointCloud2_PubSubType>(prefix + "/nearest_obstacle", on_obstacle);
    peer.read<diagnostic_msgs::msg::dds_::DiagnosticArray_PubSubType>("/diagnostics", on_diagnostics);
    fast::DataWriter* labels =
        peer.writer<sensor_msgs::msg::dds_::Image_PubSubType>(swiftlet::test::kDdsLabelTopic);
    sensor_msgs::msg::dds_::Image_ image;
    image.header().frame_id("cam0");
    image.encoding("mono8");
    image.width(swiftlet::test::kLabelWidth);
    image.height(swiftlet::test::kLabelHeight);
    image.step(swiftlet::test::kLabelWidth + 8);
    image.data().resize(static_cast<std::size_t>(image.step()) * image.height());
    const auto begin = std::chrono::steady_clock::now();
    // No two processes say the same.
    for (std::uint64_t n = 1'000'000 * static_cast<std::uint64_t>(getpid() % 2000) + 1;
         std::chrono::steady_clock::now() - begin < std::chrono::duration<double>(seconds); ++n) {
      image.header().stamp().sec(static_cast<std::int32_t>(n / 1000));
      image.header().stamp().nanosec(static_cast<std::uint32_t>(n % 1000) * 1'000'000);
      for (std::size_t i = 0; i < image.data().size(); ++i) image.data()[i] = swiftlet::test::pixelOf(n, i);
      labels->write(&image);
      pollfd input{STDIN_FILENO, POLLIN, 0};
      if (::poll(&input, 1, 50) > 0 && (input.revents & (POLLHUP | POLLIN)) != 0) {
        // What was on its way when the publisher ended still comes.
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
        break;
      }
    }
  }
  print("odometry", odometry);
  print("tf", transforms);
  print("local_mesh", mesh);
  print("surface", cloud);
  print("nearest_obstacle", obstacle);
  print("diagnostics", diagnostics);
  return 0;
}
