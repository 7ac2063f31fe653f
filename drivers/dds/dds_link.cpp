#include "drivers/dds/dds_link.hpp"

#include <dds/dds.h>
#include <algorithm>
#include <atomic>
#include <cstring>

#include "drivers/dds/ros_messages.h"  // made by idlc from ros_messages.idl

namespace swiftlet {
namespace {

using Odometry = nav_msgs_msg_dds__Odometry_;
using Header = std_msgs_msg_dds__Header_;

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr int kKept = 16;       ///< diagnostics kept for late or slow subscribers
constexpr int kKeptOut = 4;     ///< images kept for them
constexpr int kTriangles = 11;  ///< visualization_msgs/Marker::TRIANGLE_LIST
constexpr int kAdd = 0;
constexpr int kDelete = 2;
constexpr std::uint8_t kFloat32 = 7;  ///< sensor_msgs/PointField
constexpr std::uint8_t kUint32 = 6;
constexpr std::size_t kFieldBytes = 4;
constexpr std::uint32_t kMaxSide = 16384;

/// C string for a message field. `keep` holds the text while the message is written; C requires non-const.
char* text(std::string_view view, std::string& keep) {
  keep.assign(view);
  return keep.data();
}
char* empty() {
  static char nothing = '\0';
  return &nothing;
}

builtin_interfaces_msg_dds__Time_ timeOf(Stamp stamp) {
  std::int64_t seconds = stamp.ns / kNsPerSecond;
  std::int64_t rest = stamp.ns % kNsPerSecond;
  if (rest < 0) {
    rest += kNsPerSecond;
    --seconds;
  }
  return {static_cast<std::int32_t>(seconds), static_cast<std::uint32_t>(rest)};
}

geometry_msgs_msg_dds__Quaternion_ turned(const Eigen::Quaterniond& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}

template <typename Sequence, typename Item>
void lend(Sequence& sequence, std::vector<Item>& items) {
  sequence._maximum = static_cast<std::uint32_t>(items.size());
  sequence._length = sequence._maximum;
  sequence._buffer = items.data();
  sequence._release = false;
}

/// False: the image does not have 8 bits, or has less data than declared.
bool copyImage(const sensor_msgs_msg_dds__Image_& from, DdsImage& image) {
  const std::string_view encoding = from.encoding;
  const std::uint64_t needed = static_cast<std::uint64_t>(from.step) * from.height;
  if ((encoding != "mono8" && encoding != "8UC1") || from.width == 0 || from.height == 0 ||
      from.width > kMaxSide || from.height > kMaxSide || from.step < from.width ||
      from.data._length < needed) {
    return false;
  }
  image.stamp.ns = from.header.stamp.sec * kNsPerSecond + from.header.stamp.nanosec;
  image.frame = from.header.frame_id;
  image.width = static_cast<int>(from.width);
  image.height = static_cast<int>(from.height);
  image.pixels.resize(static_cast<std::size_t>(from.width) * from.height);
  for (std::size_t y = 0; y < from.height; ++y) {
    std::memcpy(image.pixels.data() + y * from.width, from.data._buffer + y * from.step, from.width);
  }
  return true;
}

}  // namespace

struct DdsLink::Entities {
  std::shared_ptr<DdsDomain> domain;
  std::vector<dds_entity_t> made;  ///< topics before their writers and readers
  dds_entity_t odometry = 0;
  dds_entity_t transforms = 0;
  dds_entity_t mesh = 0;
  dds_entity_t cloud = 0;
  dds_entity_t obstacle = 0;
  dds_entity_t diagnostics = 0;
  dds_entity_t labels = 0;
  dds_entity_t image = 0;
  std::atomic<std::uint64_t> images_came{0};  ///< counted by the library's threads
  std::uint64_t images_seen = 0;

  // Storage of outgoing messages.
  std::array<std::string, 2> texts;
  std::vector<geometry_msgs_msg_dds__TransformStamped_> transform_list;
  std::vector<std::string> names;
  std::vector<geometry_msgs_msg_dds__Point_> points;
  std::vector<std_msgs_msg_dds__ColorRGBA_> colours;
  std::vector<std::uint8_t> bytes;
  std::vector<sensor_msgs_msg_dds__PointField_> fields;
  std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> statuses;
  std::vector<diagnostic_msgs_msg_dds__KeyValue_> values;

  Entities() = default;
  Entities(const Entities&) = delete;
  Entities& operator=(const Entities&) = delete;
  ~Entities() {
    for (auto it = made.rbegin(); it != made.rend(); ++it) dds_delete(*it);
  }

  template <typename Point>
  void take(std::span<const Point> from) {
    bytes.resize(from.size_bytes());
    if (!bytes.empty()) std::memcpy(bytes.data(), from.data(), bytes.size());
  }

  /// ROS topic names begin with a slash, the DDS names with rt before it.
  [[nodiscard]] dds_entity_t topic(const dds_topic_descriptor_t& type, const std::string& name) {
    const dds_entity_t topic =
        dds_create_topic(domain->participant(), &type, ("rt" + name).c_str(), nullptr, nullptr);
    if (topic > 0) made.push_back(topic);
    return topic;
  }
  [[nodiscard]] dds_entity_t writer(const dds_topic_descriptor_t& type, const std::string& name, int kept) {
    dds_qos_t* qos = topicQuality(true, kept);
    const dds_entity_t writer = dds_create_writer(domain->participant(), topic(type, name), qos, nullptr);
    dds_delete_qos(qos);
    if (writer > 0) made.push_back(writer);
    return writer;
  }
  [[nodiscard]] dds_entity_t reader(const dds_topic_descriptor_t& type, const std::string& name) {
    // Best effort matches both kinds of writers, and no writer waits for this reader.
    dds_qos_t* qos = topicQuality(false, kKeptImages);
    dds_listener_t* listener = dds_create_listener(&images_came);
    dds_lset_data_available(listener, [](dds_entity_t, void* came) {
      static_cast<std::atomic<std::uint64_t>*>(came)->fetch_add(1, std::memory_order_relaxed);
    });
    const dds_entity_t reader = dds_create_reader(domain->participant(), topic(type, name), qos, listener);
    dds_delete_listener(listener);
    dds_delete_qos(qos);
    if (reader > 0) made.push_back(reader);
    return reader;
  }
};

DdsLink::DdsLink() = default;
DdsLink::~DdsLink() = default;

bool DdsLink::open(const DdsSettings& settings) {
  entities_ = std::make_unique<Entities>();
  Entities& e = *entities_;
  const auto failed = [this](const std::string& what, std::int32_t result = DDS_RETCODE_OK) {
    error_ = what;
    if (result != DDS_RETCODE_OK) error_ += std::string(" (") + dds_strretcode(result) + ")";
    entities_.reset();
    return false;
  };
  if (settings.prefix.empty() || settings.prefix.front() != '/' ||
      (!settings.label_topic.empty() && settings.label_topic.front() != '/')) {
    return failed("a ROS topic name starts with /");
  }
  e.domain = DdsDomain::open(settings, error_);
  if (!e.domain) {
    entities_.reset();
    return false;
  }
  e.odometry = e.writer(nav_msgs_msg_dds__Odometry__desc, settings.prefix + "/odometry", kKeptStates);
  e.transforms = e.writer(tf2_msgs_msg_dds__TFMessage__desc, "/tf", kKeptStates);
  e.mesh = e.writer(visualization_msgs_msg_dds__Marker__desc, settings.prefix + "/local_mesh", 1);
  e.cloud = e.writer(sensor_msgs_msg_dds__PointCloud2__desc, settings.prefix + "/surface", 1);
  e.obstacle = e.writer(sensor_msgs_msg_dds__PointCloud2__desc, settings.prefix + "/nearest_obstacle", 1);
  e.diagnostics = e.writer(diagnostic_msgs_msg_dds__DiagnosticArray__desc, "/diagnostics", kKept);
  if (!settings.label_topic.empty()) {
    e.labels = e.reader(sensor_msgs_msg_dds__Image__desc, settings.label_topic);
    e.image = e.writer(sensor_msgs_msg_dds__Image__desc, settings.prefix + "/mapped_image", kKeptOut);
  }
  for (const dds_entity_t made :
       {e.odometry, e.transforms, e.mesh, e.cloud, e.obstacle, e.diagnostics, e.labels, e.image}) {
    if (made < 0) return failed("cannot create a DDS topic", made);
  }
  return true;
}

bool DdsLink::wrote(std::int32_t result) {
  if (result < 0) {
    ++counters_.refused;
  } else {
    ++counters_.written;
  }
  return result >= 0;
}

bool DdsLink::publish(const DdsOdometry& odometry) {
  if (!entities_) return false;
  Odometry message{};
  message.header = Header{timeOf(odometry.stamp), text(odometry.frame, entities_->texts[0])};
  message.child_frame_id = text(odometry.child_frame, entities_->texts[1]);
  const Eigen::Vector3d& p = odometry.T_frame_child.translation;
  message.pose.pose = {{p.x(), p.y(), p.z()}, turned(odometry.T_frame_child.rotation)};
  const Eigen::Vector3d& v = odometry.velocity;
  const Eigen::Vector3d& omega = odometry.angular_velocity;
  message.twist.twist = {{v.x(), v.y(), v.z()}, {omega.x(), omega.y(), omega.z()}};
  std::ranges::copy(odometry.pose_covariance, message.pose.covariance);
  std::ranges::copy(odometry.twist_covariance, message.twist.covariance);
  return wrote(dds_write(entities_->odometry, &message));
}

bool DdsLink::publish(std::span<const DdsTransform> transforms) {
  if (!entities_) return false;
  Entities& e = *entities_;
  e.names.resize(2 * transforms.size());
  e.transform_list.resize(transforms.size());
  for (std::size_t i = 0; i < transforms.size(); ++i) {
    const DdsTransform& from = transforms[i];
    auto& to = e.transform_list[i];
    to.header = Header{timeOf(from.stamp), text(from.frame, e.names[2 * i])};
    to.child_frame_id = text(from.child_frame, e.names[2 * i + 1]);
    const Eigen::Vector3d& p = from.T_frame_child.translation;
    to.transform = {{p.x(), p.y(), p.z()}, turned(from.T_frame_child.rotation)};
  }
  tf2_msgs_msg_dds__TFMessage_ message{};
  lend(message.transforms, e.transform_list);
  return wrote(dds_write(e.transforms, &message));
}

bool DdsLink::publish(const DdsMesh& mesh) {
  if (!entities_) return false;
  Entities& e = *entities_;
  e.points.clear();
  for (const Eigen::Vector3f& p : mesh.points) {
    e.points.push_back({static_cast<double>(p.x()), static_cast<double>(p.y()), static_cast<double>(p.z())});
  }
  e.colours.clear();
  for (const Eigen::Vector3f& c : mesh.colours) e.colours.push_back({c.x(), c.y(), c.z(), 1.0F});
  visualization_msgs_msg_dds__Marker_ message{};
  message.header = Header{timeOf(mesh.stamp), text(mesh.frame, e.texts[0])};
  message.ns = text("local_mesh", e.texts[1]);
  message.type = kTriangles;
  message.action = mesh.points.empty() ? kDelete : kAdd;
  message.pose.orientation.w = 1;
  message.scale = {1, 1, 1};
  message.color = {0.5F, 0.5F, 0.5F, 1.0F};
  lend(message.points, e.points);
  lend(message.colors, e.colours);
  message.texture_resource = empty();
  message.texture.header.frame_id = empty();
  message.texture.format = empty();
  message.text = empty();
  message.mesh_resource = empty();
  message.mesh_file.filename = empty();
  return wrote(dds_write(e.mesh, &message));
}

bool DdsLink::publish(const DdsCloud& cloud) {
  if (!entities_) return false;
  // By convention `rgb` holds its bits as a float; viewers expect this.
  constexpr std::array<const char*, 5> kFields = {"x", "y", "z", "rgb", "label"};
  static_assert(sizeof(DdsCloudPoint) == kFields.size() * kFieldBytes);
  entities_->take(cloud.points);
  return publishPoints(entities_->cloud, cloud.stamp, cloud.frame, true, kFields);
}

bool DdsLink::publish(const DdsObstacle& obstacle) {
  if (!entities_) return false;
  // Names as PCL uses them for a point with normal, followed by our own.
  constexpr std::array<const char*, 10> kFields = {"x",        "y",        "z",        "normal_x", "normal_y",
                                                   "normal_z", "distance", "known_to", "age",      "kind"};
  static_assert(sizeof(DdsObstacle::Point) == kFields.size() * kFieldBytes);
  entities_->take(std::span(&obstacle.point, 1));
  return publishPoints(entities_->obstacle, obstacle.stamp, obstacle.frame, obstacle.point.p.allFinite(),
                       kFields);
}

bool DdsLink::publishPoints(std::int32_t writer, Stamp stamp, std::string_view frame, bool dense,
                            std::span<const char* const> fields) {
  Entities& e = *entities_;
  e.names.resize(fields.size());
  e.fields.resize(fields.size());
  for (std::size_t i = 0; i < fields.size(); ++i) {
    e.fields[i] = {text(fields[i], e.names[i]), static_cast<std::uint32_t>(i * kFieldBytes),
                   i + 1 < fields.size() ? kFloat32 : kUint32, 1};
  }
  sensor_msgs_msg_dds__PointCloud2_ message{};
  message.header = Header{timeOf(stamp), text(frame, e.texts[0])};
  message.height = 1;
  message.point_step = static_cast<std::uint32_t>(fields.size() * kFieldBytes);
  message.row_step = static_cast<std::uint32_t>(e.bytes.size());
  message.width = message.row_step / message.point_step;
  lend(message.fields, e.fields);
  lend(message.data, e.bytes);
  message.is_dense = dense;
  return wrote(dds_write(writer, &message));
}

bool DdsLink::publish(Stamp stamp, std::span<const DdsStatus> statuses) {
  if (!entities_) return false;
  Entities& e = *entities_;
  std::size_t values = 0;
  for (const DdsStatus& status : statuses) values += status.values.size();
  e.names.resize(3 * statuses.size() + 2 * values);
  e.values.resize(values);
  e.statuses.resize(statuses.size());
  std::size_t name = 0;
  std::size_t value = 0;
  for (std::size_t i = 0; i < statuses.size(); ++i) {
    const DdsStatus& from = statuses[i];
    auto& to = e.statuses[i];
    to = {};
    to.level = from.level;
    to.name = text(from.name, e.names[name++]);
    to.message = text(from.message, e.names[name++]);
    to.hardware_id = text("swiftlet", e.names[name++]);
    to.values._buffer = e.values.data() + value;
    to.values._maximum = to.values._length = static_cast<std::uint32_t>(from.values.size());
    for (const auto& [key, what] : from.values) {
      e.values[value].key = text(key, e.names[name++]);
      e.values[value++].value = text(what, e.names[name++]);
    }
  }
  diagnostic_msgs_msg_dds__DiagnosticArray_ message{};
  message.header = Header{timeOf(stamp), empty()};
  lend(message.status, e.statuses);
  return wrote(dds_write(e.diagnostics, &message));
}

bool DdsLink::publish(const DdsImageView& view) {
  if (!entities_ || entities_->image <= 0 || view.image.empty()) return false;
  Entities& e = *entities_;
  const ImageView& image = view.image;
  const auto width = static_cast<std::size_t>(image.width);
  e.bytes.resize(width * static_cast<std::size_t>(image.height));
  for (int y = 0; y < image.height; ++y) {
    std::memcpy(e.bytes.data() + static_cast<std::size_t>(y) * width, image.row(y), width);
  }
  sensor_msgs_msg_dds__Image_ message{};
  message.header = Header{timeOf(view.stamp), text(view.frame, e.texts[0])};
  message.width = static_cast<std::uint32_t>(image.width);
  message.height = static_cast<std::uint32_t>(image.height);
  message.encoding = text("mono8", e.texts[1]);
  message.step = message.width;
  lend(message.data, e.bytes);
  return wrote(dds_write(e.image, &message));
}

bool DdsLink::takeLabels(DdsImage& image) {
  if (!entities_ || entities_->labels <= 0) return false;
  void* sample = nullptr;
  dds_sample_info_t info;
  for (int looked = 0; looked < kKeptImages; ++looked) {
    if (dds_take(entities_->labels, &sample, &info, 1, 1) <= 0) return false;
    bool taken = false;
    if (info.valid_data) {
      ++entities_->images_seen;
      taken = copyImage(*static_cast<const sensor_msgs_msg_dds__Image_*>(sample), image);
      ++(taken ? counters_.images : counters_.images_refused);
    }
    dds_return_loan(entities_->labels, &sample, 1);
    sample = nullptr;
    if (taken) return true;
  }
  return false;
}

int DdsLink::labellers() const {
  if (!entities_ || entities_->labels <= 0) return 0;
  dds_subscription_matched_status_t status{};
  if (dds_get_subscription_matched_status(entities_->labels, &status) < 0) return 0;
  return static_cast<int>(status.current_count);
}

DdsCounters DdsLink::counters() const {
  DdsCounters counters = counters_;
  counters.complaints = DdsDomain::complaints();
  if (entities_) {
    const std::uint64_t came = entities_->images_came.load(std::memory_order_relaxed);
    counters.images_skipped = came - std::min(came, entities_->images_seen);
  }
  return counters;
}

int DdsLink::subscribers() const {
  if (!entities_) return 0;
  dds_publication_matched_status_t status{};
  if (dds_get_publication_matched_status(entities_->odometry, &status) < 0) return 0;
  return static_cast<int>(status.current_count);
}

}  // namespace swiftlet
