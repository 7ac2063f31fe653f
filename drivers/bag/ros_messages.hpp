#pragma once
// The ROS messages that swiftlet reads and writes, as structures with their fields in order. One visitor each
// encodes and decodes (drivers/bag/message_coder.hpp) and prints the definition
// (drivers/bag/message_text.hpp), for ROS 1 and ROS 2.
//
// Units and frames are those of ROS: rad/s, m/s^2, m. A header's frame is only a name here. Source: the .msg
// files of common_msgs (ROS 1) and common_interfaces (ROS 2 Humble). kMd5: the checksum of a definition in
// ROS 1, which its tools compare.

#include <array>
#include <concepts>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet::rosmsg {

inline constexpr std::int64_t kNsPerSecond = 1'000'000'000;

template <typename T>
concept Message = requires {
  { T::kType } -> std::convertible_to<std::string_view>;
};

/// `byte` of .msg files; the same on the wire as uint8.
struct Byte {
  std::uint8_t value = 0;
};

struct Duration {
  std::int32_t seconds = 0;
  std::uint32_t nanoseconds = 0;
};

struct Header {
  static constexpr const char* kType = "std_msgs/Header";
  std::uint32_t seq = 0;  ///< ROS 1 only
  Stamp stamp;
  std::string frame_id;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    if constexpr (Visit::kRos1) visit("seq", self.seq);
    visit("stamp", self.stamp);
    visit("frame_id", self.frame_id);
  }
};

struct Point {
  static constexpr const char* kType = "geometry_msgs/Point";
  double x = 0, y = 0, z = 0;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("x", self.x);
    visit("y", self.y);
    visit("z", self.z);
  }
};

struct Vector3 : Point {
  static constexpr const char* kType = "geometry_msgs/Vector3";
};

struct Quaternion {
  static constexpr const char* kType = "geometry_msgs/Quaternion";
  double x = 0, y = 0, z = 0, w = 1;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("x", self.x);
    visit("y", self.y);
    visit("z", self.z);
    visit("w", self.w);
  }
};

struct Pose {
  static constexpr const char* kType = "geometry_msgs/Pose";
  Point position;
  Quaternion orientation;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("position", self.position);
    visit("orientation", self.orientation);
  }
};

struct PoseStamped {
  static constexpr const char* kType = "geometry_msgs/PoseStamped";
  static constexpr const char* kMd5 = "d3812c3cbc69362b77dc0b19b345f8f5";
  Header header;
  Pose pose;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("pose", self.pose);
  }
};

struct PoseWithCovariance {
  static constexpr const char* kType = "geometry_msgs/PoseWithCovariance";
  Pose pose;
  std::array<double, 36> covariance = {};

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("pose", self.pose);
    visit("covariance", self.covariance);
  }
};

struct Twist {
  static constexpr const char* kType = "geometry_msgs/Twist";
  Vector3 linear;
  Vector3 angular;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("linear", self.linear);
    visit("angular", self.angular);
  }
};

struct TwistWithCovariance {
  static constexpr const char* kType = "geometry_msgs/TwistWithCovariance";
  Twist twist;
  std::array<double, 36> covariance = {};

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("twist", self.twist);
    visit("covariance", self.covariance);
  }
};

struct Vector3Stamped {
  static constexpr const char* kType = "geometry_msgs/Vector3Stamped";
  static constexpr const char* kMd5 = "7b324c7325e683bf02a9b14b01090ec7";
  Header header;
  Vector3 vector;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("vector", self.vector);
  }
};

struct Transform {
  static constexpr const char* kType = "geometry_msgs/Transform";
  Vector3 translation;
  Quaternion rotation;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("translation", self.translation);
    visit("rotation", self.rotation);
  }
};

struct TransformStamped {
  static constexpr const char* kType = "geometry_msgs/TransformStamped";
  static constexpr const char* kMd5 = "b5764a33bfeb3588febc2682852579b0";
  Header header;
  std::string child_frame_id;
  Transform transform;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("child_frame_id", self.child_frame_id);
    visit("transform", self.transform);
  }
};

struct TFMessage {
  static constexpr const char* kType = "tf2_msgs/TFMessage";
  static constexpr const char* kMd5 = "94810edda583a504dfda3829e70d7eec";
  std::vector<TransformStamped> transforms;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("transforms", self.transforms);
  }
};

struct Odometry {
  static constexpr const char* kType = "nav_msgs/Odometry";
  static constexpr const char* kMd5 = "cd5e73d190d741a2f92e81eda573aca7";
  Header header;
  std::string child_frame_id;
  PoseWithCovariance pose;
  TwistWithCovariance twist;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("child_frame_id", self.child_frame_id);
    visit("pose", self.pose);
    visit("twist", self.twist);
  }
};

struct Path {
  static constexpr const char* kType = "nav_msgs/Path";
  static constexpr const char* kMd5 = "6227e2b7e9cce15051f669a5e197bbf7";
  Header header;
  std::vector<PoseStamped> poses;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("poses", self.poses);
  }
};

struct Imu {
  static constexpr const char* kType = "sensor_msgs/Imu";
  static constexpr const char* kMd5 = "6a62c6daae103f4ff57a132d6f95cec2";
  Header header;
  Quaternion orientation;
  std::array<double, 9> orientation_covariance = {-1};  ///< first element -1: no orientation
  Vector3 angular_velocity;                             ///< rad/s
  std::array<double, 9> angular_velocity_covariance = {};
  Vector3 linear_acceleration;  ///< m/s^2, specific force: includes the reaction to gravity
  std::array<double, 9> linear_acceleration_covariance = {};

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("orientation", self.orientation);
    visit("orientation_covariance", self.orientation_covariance);
    visit("angular_velocity", self.angular_velocity);
    visit("angular_velocity_covariance", self.angular_velocity_covariance);
    visit("linear_acceleration", self.linear_acceleration);
    visit("linear_acceleration_covariance", self.linear_acceleration_covariance);
  }
};

struct Image {
  static constexpr const char* kType = "sensor_msgs/Image";
  static constexpr const char* kMd5 = "060021388200f6f0f447d0fcd9c64743";
  Header header;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::string encoding;
  std::uint8_t is_bigendian = 0;
  std::uint32_t step = 0;              ///< bytes per row
  std::span<const std::uint8_t> data;  ///< decoded: a view into the body

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("height", self.height);
    visit("width", self.width);
    visit("encoding", self.encoding);
    visit("is_bigendian", self.is_bigendian);
    visit("step", self.step);
    visit("data", self.data);
  }
};

struct CompressedImage {
  static constexpr const char* kType = "sensor_msgs/CompressedImage";
  static constexpr const char* kMd5 = "8f7a12909da2c9d3332d540a0977563f";
  Header header;
  std::string format;
  std::span<const std::uint8_t> data;  ///< decoded: a view into the body

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("format", self.format);
    visit("data", self.data);
  }
};

struct RegionOfInterest {
  static constexpr const char* kType = "sensor_msgs/RegionOfInterest";
  std::uint32_t x_offset = 0, y_offset = 0, height = 0, width = 0;
  bool do_rectify = false;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("x_offset", self.x_offset);
    visit("y_offset", self.y_offset);
    visit("height", self.height);
    visit("width", self.width);
    visit("do_rectify", self.do_rectify);
  }
};

struct CameraInfo {
  static constexpr const char* kType = "sensor_msgs/CameraInfo";
  static constexpr const char* kMd5 = "c9a58c1b0b154e0e6da7578cb991d214";
  Header header;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k = {};
  std::array<double, 9> r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 12> p = {};
  std::uint32_t binning_x = 0;
  std::uint32_t binning_y = 0;
  RegionOfInterest roi;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("height", self.height);
    visit("width", self.width);
    visit("distortion_model", self.distortion_model);
    visit(Visit::kRos1 ? "D" : "d", self.d);
    visit(Visit::kRos1 ? "K" : "k", self.k);
    visit(Visit::kRos1 ? "R" : "r", self.r);
    visit(Visit::kRos1 ? "P" : "p", self.p);
    visit("binning_x", self.binning_x);
    visit("binning_y", self.binning_y);
    visit("roi", self.roi);
  }
};

struct Float64 {
  static constexpr const char* kType = "std_msgs/Float64";
  static constexpr const char* kMd5 = "fdb28210bfa9d7c91146260178d9a584";
  double data = 0;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("data", self.data);
  }
};

struct PointField {
  static constexpr const char* kType = "sensor_msgs/PointField";
  static constexpr std::uint8_t kUint32 = 6, kFloat32 = 7;
  std::string name;
  std::uint32_t offset = 0;  ///< bytes from the start of a point
  std::uint8_t datatype = 0;
  std::uint32_t count = 1;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("name", self.name);
    visit("offset", self.offset);
    visit("datatype", self.datatype);
    visit("count", self.count);
  }
  template <typename Visit>
  static void constants(Visit& visit) {
    int value = 1;
    for (const char* name : {"INT8", "UINT8", "INT16", "UINT16", "INT32", "UINT32", "FLOAT32", "FLOAT64"}) {
      visit.constant("uint8", name, value++);
    }
  }
};

struct PointCloud2 {
  static constexpr const char* kType = "sensor_msgs/PointCloud2";
  static constexpr const char* kMd5 = "1158d486dd51d683ce2f1be655c3c181";
  Header header;
  std::uint32_t height = 1;
  std::uint32_t width = 0;
  std::vector<PointField> point_fields;
  bool is_bigendian = false;
  std::uint32_t point_step = 0;  ///< bytes per point
  std::uint32_t row_step = 0;
  std::vector<std::uint8_t> data;
  bool is_dense = true;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("height", self.height);
    visit("width", self.width);
    visit("fields", self.point_fields);
    visit("is_bigendian", self.is_bigendian);
    visit("point_step", self.point_step);
    visit("row_step", self.row_step);
    visit("data", self.data);
    visit("is_dense", self.is_dense);
  }
};

struct ColorRGBA {
  static constexpr const char* kType = "std_msgs/ColorRGBA";
  float r = 0, g = 0, b = 0, a = 0;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("r", self.r);
    visit("g", self.g);
    visit("b", self.b);
    visit("a", self.a);
  }
};

struct UVCoordinate {
  static constexpr const char* kType = "visualization_msgs/UVCoordinate";
  float u = 0, v = 0;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("u", self.u);
    visit("v", self.v);
  }
};

struct MeshFile {
  static constexpr const char* kType = "visualization_msgs/MeshFile";
  std::string filename;
  std::span<const std::uint8_t> data;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("filename", self.filename);
    visit("data", self.data);
  }
};

struct Marker {
  static constexpr const char* kType = "visualization_msgs/Marker";
  static constexpr const char* kMd5 = "4048c9de2a16f4ae8e0538085ebf1b97";
  static constexpr std::int32_t kTriangleList = 11;
  static constexpr std::int32_t kAdd = 0;
  static constexpr std::int32_t kDelete = 2;
  Header header;
  std::string ns;
  std::int32_t id = 0;
  std::int32_t type = 0;
  std::int32_t action = 0;
  Pose pose;
  Vector3 scale;
  ColorRGBA color;
  Duration lifetime;  ///< zero: forever
  bool frame_locked = false;
  std::vector<Point> points;
  std::vector<ColorRGBA> colors;
  std::string texture_resource;  ///< this and the next ones up to uv_coordinates: ROS 2 only
  CompressedImage texture;
  std::vector<UVCoordinate> uv_coordinates;
  std::string text;
  std::string mesh_resource;
  MeshFile mesh_file;  ///< ROS 2 only
  bool mesh_use_embedded_materials = false;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("ns", self.ns);
    visit("id", self.id);
    visit("type", self.type);
    visit("action", self.action);
    visit("pose", self.pose);
    visit("scale", self.scale);
    visit("color", self.color);
    visit("lifetime", self.lifetime);
    visit("frame_locked", self.frame_locked);
    visit("points", self.points);
    visit("colors", self.colors);
    if constexpr (!Visit::kRos1) {
      visit("texture_resource", self.texture_resource);
      visit("texture", self.texture);
      visit("uv_coordinates", self.uv_coordinates);
    }
    visit("text", self.text);
    visit("mesh_resource", self.mesh_resource);
    if constexpr (!Visit::kRos1) visit("mesh_file", self.mesh_file);
    visit("mesh_use_embedded_materials", self.mesh_use_embedded_materials);
  }
  template <typename Visit>
  static void constants(Visit& visit) {
    const char* type = Visit::kRos1 ? "uint8" : "int32";
    int value = 0;
    for (const char* name : {"ARROW", "CUBE", "SPHERE", "CYLINDER", "LINE_STRIP", "LINE_LIST", "CUBE_LIST",
                             "SPHERE_LIST", "POINTS", "TEXT_VIEW_FACING", "MESH_RESOURCE", "TRIANGLE_LIST"}) {
      visit.constant(type, name, value++);
    }
    visit.constant(type, "ADD", 0);
    visit.constant(type, "MODIFY", 0);
    visit.constant(type, "DELETE", 2);
    visit.constant(type, "DELETEALL", 3);
  }
};

struct KeyValue {
  static constexpr const char* kType = "diagnostic_msgs/KeyValue";
  std::string key;
  std::string value;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("key", self.key);
    visit("value", self.value);
  }
};

struct DiagnosticStatus {
  static constexpr const char* kType = "diagnostic_msgs/DiagnosticStatus";
  static constexpr std::uint8_t kOk = 0, kWarn = 1, kError = 2;
  Byte level;
  std::string name;
  std::string message;
  std::string hardware_id;
  std::vector<KeyValue> values;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("level", self.level);
    visit("name", self.name);
    visit("message", self.message);
    visit("hardware_id", self.hardware_id);
    visit("values", self.values);
  }
  template <typename Visit>
  static void constants(Visit& visit) {
    visit.constant("byte", "OK", 0);
    visit.constant("byte", "WARN", 1);
    visit.constant("byte", "ERROR", 2);
    visit.constant("byte", "STALE", 3);
  }
};

struct DiagnosticArray {
  static constexpr const char* kType = "diagnostic_msgs/DiagnosticArray";
  static constexpr const char* kMd5 = "60810da900de1dd6ddd437c3503511da";
  Header header;
  std::vector<DiagnosticStatus> status;

  template <typename Self, typename Visit>
  static void fields(Self& self, Visit& visit) {
    visit("header", self.header);
    visit("status", self.status);
  }
};

}  // namespace swiftlet::rosmsg
