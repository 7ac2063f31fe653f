#pragma once
// Exchanges ROS 2 messages with other processes without ROS: topics `rt/...`, types `...::dds_::..._`, plain
// CDR, over Eclipse Cyclone DDS. docs/ros2.md lists topics, types, frames and qualities of service.
//
// Nothing blocks: every writer keeps only its last messages and never waits (max_blocking_time 0), and the
// library's throttle limit is never reached, so a slow, stopped or killed subscriber loses only its own
// messages. Messages that a writer rejects are counted. One thread calls publish and take. Memory: messages
// not yet acknowledged by subscribers, at most the last kKeptStates odometries and transforms, 16
// diagnostics, 4 images, 1 mesh, 1 surface, 1 obstacle; kKeptImages label images not yet taken; grows to the
// largest message seen. No exceptions.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/dds/dds_domain.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

/// One second at 200 Hz: a subscriber that gets no CPU for less than that loses nothing.
inline constexpr int kKeptStates = 200;
inline constexpr int kKeptImages = 8;

struct DdsSettings : DdsNetwork {
  std::string prefix = "/swiftlet";  ///< of our topics; not used for /tf and /diagnostics
  std::string label_topic;           ///< sensor_msgs/Image to read; empty: none, and no image is sent
};

struct DdsOdometry {
  Stamp stamp;
  std::string_view frame;
  std::string_view child_frame;
  SE3 T_frame_child;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();          ///< m/s, child axes
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< rad/s, child axes
  std::array<double, 36> pose_covariance{};   ///< x y z, rotations about the frame's axes; row by row
  std::array<double, 36> twist_covariance{};  ///< child axes; row by row
};

struct DdsTransform {
  Stamp stamp;
  std::string_view frame;
  std::string_view child_frame;
  SE3 T_frame_child;
};

/// Three points and three colours (r g b, 0 to 1) per triangle. An empty mesh deletes the marker.
struct DdsMesh {
  Stamp stamp;
  std::string_view frame;
  std::span<const Eigen::Vector3f> points;
  std::span<const Eigen::Vector3f> colours;
};

struct DdsCloudPoint {
  float x = 0, y = 0, z = 0;  ///< m
  std::uint32_t rgb = 0;      ///< 0x00RRGGBB
  std::uint32_t label = 0;
};

struct DdsCloud {
  Stamp stamp;
  std::string_view frame;
  std::span<const DdsCloudPoint> points;
};

/// The nearest obstacle, as a cloud of one point.
struct DdsObstacle {
  /// Fields in the order of the wire format.
  struct Point {
    Eigen::Vector3f p = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());  ///< m; NaN: none
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< unit, away from the surface; zero without a point
    float distance = 0;                                ///< m
    float known_to = 0;                                ///< m
    float age = 0;           ///< s, from the newest image that contributed to the stamp
    std::uint32_t kind = 0;  ///< 0: in unknown space, 1: at least `distance` away, 2: `distance` away
  };
  Stamp stamp;
  std::string_view frame;
  Point point;
};

struct DdsStatus {
  std::uint8_t level = 0;  ///< 0 ok, 1 warning, 2 error, 3 stale
  std::string name;
  std::string message;
  std::vector<std::pair<std::string, std::string>> values;
};

/// An outgoing mono8 image.
struct DdsImageView {
  Stamp stamp;
  std::string_view frame;
  ImageView image;
};

/// A received 8-bit image, rows without padding.
struct DdsImage {
  Stamp stamp;
  std::string frame;
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
};

struct DdsCounters {
  std::uint64_t written = 0;
  std::uint64_t refused = 0;         ///< refused by the library because it would have had to wait
  std::uint64_t complaints = 0;      ///< warnings and errors of the library; a too large message gives one
  std::uint64_t images = 0;          ///< images taken
  std::uint64_t images_refused = 0;  ///< not 8 bits, or smaller than declared
  std::uint64_t images_skipped = 0;  ///< overwritten by kKeptImages newer ones before they were taken
};

class DdsLink {
 public:
  DdsLink();
  ~DdsLink();
  DdsLink(const DdsLink&) = delete;
  DdsLink& operator=(const DdsLink&) = delete;

  /// Call once. False, with error() for the user, if the domain cannot be opened.
  [[nodiscard]] bool open(const DdsSettings& settings);
  [[nodiscard]] const std::string& error() const { return error_; }

  /// False: the message was refused; counted.
  bool publish(const DdsOdometry& odometry);
  bool publish(std::span<const DdsTransform> transforms);
  bool publish(const DdsMesh& mesh);
  bool publish(const DdsCloud& cloud);
  bool publish(const DdsObstacle& obstacle);
  bool publish(Stamp stamp, std::span<const DdsStatus> statuses);
  /// Sends camera 0's image to the labeller; only if there is a label topic.
  bool publish(const DdsImageView& image);
  /// The oldest label image not yet taken; examines at most kKeptImages images. False if there is none.
  bool takeLabels(DdsImage& image);
  /// Current number of writers of the label topic.
  [[nodiscard]] int labellers() const;

  /// Current number of subscribers of the odometry.
  [[nodiscard]] int subscribers() const;
  [[nodiscard]] DdsCounters counters() const;

 private:
  struct Entities;
  bool wrote(std::int32_t result);
  /// Publishes the points in Entities::bytes: 32-bit fields with these names, the last one an integer.
  /// `dense`: no point is NaN.
  bool publishPoints(std::int32_t writer, Stamp stamp, std::string_view frame, bool dense,
                     std::span<const char* const> fields);

  std::unique_ptr<Entities> entities_;
  std::string error_;
  DdsCounters counters_;
};

}  // namespace swiftlet
