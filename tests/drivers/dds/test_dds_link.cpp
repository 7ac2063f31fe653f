// The link against a subscriber of another make in processes of its own, some of which are stopped and
// killed. SWIFTLET_DDS_SECONDS: how long (8).

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <set>
#include <sstream>
#include <thread>

#include "drivers/dds/dds_link.hpp"
#include "tests/drivers/dds/peer_process.hpp"
#include "tests/drivers/dds/test_messages.hpp"

namespace swiftlet {
namespace {

using Clock = std::chrono::steady_clock;
using test::ownDomain;
using test::pointsOf;

struct Received {
  std::uint64_t received = 0, lost = 0, torn = 0, repeated = 0;
};

/// dds_subscriber as a process.
class Subscriber : public test::PeerProcess {
 public:
  Subscriber(double seconds, int depth)
      : PeerProcess(SWIFTLET_DDS_SUBSCRIBER,
                    {std::to_string(seconds), std::to_string(ownDomain()), std::to_string(depth)}) {}
  /// By topic.
  std::map<std::string, Received> counts() {
    std::map<std::string, Received> topics;
    std::istringstream lines(finish());
    std::string topic;
    Received counts;
    while (lines >> topic >> counts.received >> counts.lost >> counts.torn >> counts.repeated)
      topics[topic] = counts;
    return topics;
  }
};

/// Message n of each kind, and how long its publishing took.
class Publisher {
 public:
  explicit Publisher(DdsLink& link) : link_(link) {}

  void odometry() {
    const std::uint64_t n = ++odometries_;
    const auto v = static_cast<double>(n);
    DdsOdometry message;
    message.stamp = stampOf(n);
    message.frame = "odom";
    message.child_frame = "base_link";
    message.T_frame_child.translation = {v, 0.5 * v, -v};
    message.velocity = {-v, 0, 0};
    message.angular_velocity = {0, 0, 2 * v};
    for (std::size_t i = 0; i < 36; ++i) {
      message.pose_covariance[i] = v + static_cast<double>(i);
      message.twist_covariance[i] = v - static_cast<double>(i);
    }
    timed([&] { link_.publish(message); });
    SE3 map;
    map.translation = {-v, 0, 0};
    const std::array<DdsTransform, 2> transforms = {
        DdsTransform{stampOf(n), "map", "odom", map},
        DdsTransform{stampOf(n), "odom", "base_link", message.T_frame_child}};
    timed([&] { link_.publish(transforms); });
  }
  void mesh() {
    const std::uint64_t n = ++meshes_;
    points_.assign(static_cast<std::size_t>(pointsOf(n)), Eigen::Vector3f::Zero());
    for (std::size_t i = 0; i < points_.size(); ++i)
      points_[i] = {static_cast<float>(n), 0, static_cast<float>(i)};
    colours_.assign(points_.size(), {0.5F, 0.25F, 0.125F});
    timed([&] { link_.publish(DdsMesh{stampOf(n), "odom", points_, colours_}); });
    cloud_.assign(static_cast<std::size_t>(pointsOf(n)), {});
    for (std::size_t i = 0; i < cloud_.size(); ++i) {
      cloud_[i].z = static_cast<float>(i);
      cloud_[i].label = static_cast<std::uint32_t>(n % 32);
    }
    timed([&] { link_.publish(DdsCloud{stampOf(n), "map", cloud_}); });
    const auto v = static_cast<float>(n);
    const DdsObstacle::Point point{{v, -v, 0.5F}, {0, 0, -1}, v,
                                   2 * v,         3 * v,      static_cast<std::uint32_t>(n % 3)};
    timed([&] { link_.publish(DdsObstacle{stampOf(n), "base_link", point}); });
  }
  void diagnostics() {
    const std::uint64_t n = ++diagnostics_;
    const std::string text = std::to_string(n);
    const std::array<DdsStatus, 2> statuses = {DdsStatus{0, "a", text, {{"n", text}}},
                                               DdsStatus{1, "b", text, {{"m", ""}, {"n", text}}}};
    timed([&] { link_.publish(stampOf(n), statuses); });
  }
  /// s, of every call since the last asking.
  [[nodiscard]] std::vector<double> times() { return std::exchange(times_, {}); }
  [[nodiscard]] std::uint64_t odometries() const { return odometries_; }

 private:
  static Stamp stampOf(std::uint64_t n) { return {static_cast<std::int64_t>(n) * 1'000'000}; }
  template <typename Work>
  void timed(Work&& work) {
    const auto begin = Clock::now();
    work();
    times_.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
  }

  DdsLink& link_;
  std::uint64_t odometries_ = 0, meshes_ = 0, diagnostics_ = 0;
  std::vector<Eigen::Vector3f> points_, colours_;
  std::vector<DdsCloudPoint> cloud_;
  std::vector<double> times_;
};

std::string spread(const char* what, std::vector<double> times) {
  std::ranges::sort(times);
  std::ostringstream text;
  const auto at = [&](double share) {
    return 1e6 * times[static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))];
  };
  text << what << ": " << times.size() << " calls, p50 " << at(0.5) << " us, p99 " << at(0.99) << " us, max "
       << at(1) << " us";
  return text.str();
}

void checkWhole(const std::map<std::string, Received>& topics) {
  REQUIRE(topics.size() == 6);
  for (const auto& [topic, counts] : topics) {
    INFO(topic << " received " << counts.received << " lost " << counts.lost);
    CHECK(counts.received > 0);
    CHECK(counts.torn == 0);
    CHECK(counts.repeated == 0);
  }
}

TEST_CASE("another implementation receives and decodes everything; its death disturbs nobody", "[dds]") {
  const char* wanted = std::getenv("SWIFTLET_DDS_SECONDS");
  const double seconds = wanted != nullptr ? std::atof(wanted) : 8;
  DdsSettings settings;
  settings.domain = ownDomain();
  settings.label_topic = test::kDdsLabelTopic;
  DdsLink link;
  INFO(link.error());
  REQUIRE(link.open(settings));
  Subscriber stays(10 * seconds + 60, kKeptStates);
  Subscriber dies(10 * seconds + 60, 10);
  Subscriber hangs(10 * seconds + 60, 10);
  for (int i = 0; i < 300 && link.subscribers() < 3; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  REQUIRE(link.subscribers() == 3);
  std::this_thread::sleep_for(std::chrono::seconds(1));  // the other topics' readers

  Publisher publisher(link);
  std::vector<std::string> report;
  DdsImage labels;
  std::uint64_t images = 0;
  std::set<std::int64_t> taken;
  const int steps = static_cast<int>(200 * seconds);
  const auto begin = Clock::now();
  for (int step = 0; step < steps; ++step) {
    std::this_thread::sleep_until(begin + std::chrono::milliseconds(5) * step);
    if (step == steps / 3) report.push_back(spread("all alive", publisher.times()));
    if (step == steps / 3) dies.kill(SIGKILL);
    if (step == steps / 3) hangs.signal(SIGSTOP);
    if (step == 2 * steps / 3) report.push_back(spread("one killed, one stopped", publisher.times()));
    publisher.odometry();
    if (step % 10 == 0) publisher.mesh();
    if (step % 200 == 0) publisher.diagnostics();
    if (!link.takeLabels(labels)) continue;
    ++images;
    CHECK(taken.insert(labels.stamp.ns).second);
    REQUIRE(labels.pixels.size() == std::size_t{test::kLabelWidth} * test::kLabelHeight);
    const auto n = static_cast<std::uint64_t>(labels.stamp.ns / 1'000'000);
    bool whole = labels.frame == "cam0" && labels.width == test::kLabelWidth;
    for (std::size_t i = 0; i < labels.pixels.size(); ++i) {
      const std::size_t row = i / test::kLabelWidth;
      whole = whole &&
              labels.pixels[i] == test::pixelOf(n, row * (test::kLabelWidth + 8) + i % test::kLabelWidth);
    }
    CHECK(whole);
  }
  const double took = std::chrono::duration<double>(Clock::now() - begin).count();
  report.push_back(spread("after that", publisher.times()));
  const auto topics = stays.counts();
  hangs.signal(SIGCONT);
  for (const std::string& line : report) std::printf("%s\n", line.c_str());
  for (const auto& [topic, counts] : topics) {
    std::printf("%s: received %llu, lost %llu, torn %llu, repeated %llu\n", topic.c_str(),
                static_cast<unsigned long long>(counts.received),
                static_cast<unsigned long long>(counts.lost), static_cast<unsigned long long>(counts.torn),
                static_cast<unsigned long long>(counts.repeated));
  }
  checkWhole(topics);
  // A subscriber that gets no CPU for longer than both keep, a second, loses what is oldest; nothing else
  // goes.
  const Received& odometry = topics.at("odometry");
  CHECK(odometry.received + odometry.lost <= publisher.odometries());
  CHECK(odometry.received * 100 >= publisher.odometries() * 99);
  CHECK(link.counters().refused == 0);
  CHECK(images > 0);
  CHECK(link.counters().images_refused == 0);
  CHECK(took < seconds + 1);  // no call waited
}

TEST_CASE("what cannot be opened is said", "[dds]") {
  DdsLink link;
  DdsSettings settings;
  settings.domain = ownDomain() + 1;
  settings.interface = "no_such_interface";
  CHECK_FALSE(link.open(settings));
  CHECK(link.error().find("no_such_interface") != std::string::npos);
  CHECK_FALSE(link.publish(DdsOdometry{}));
  DdsImage image;
  CHECK_FALSE(link.takeLabels(image));
  settings.prefix = "swiftlet";
  CHECK_FALSE(DdsLink().open(settings));
}

}  // namespace
}  // namespace swiftlet
