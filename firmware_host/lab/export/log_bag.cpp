#include "firmware_host/lab/export/log_bag.hpp"

#include <fmt/format.h>

#include <limits>

#include "drivers/calibration/input_error.hpp"
#include "firmware_host/lab/export/bag_messages.hpp"

namespace swiftlet {
namespace {

constexpr Stamp kNever{std::numeric_limits<std::int64_t>::max()};

std::string cameraName(std::size_t camera) { return fmt::format("cam{}", camera); }

rosmsg::CameraInfo cameraInfo(const CameraModel& model) {
  rosmsg::CameraInfo info;
  info.width = static_cast<std::uint32_t>(model.width());
  info.height = static_cast<std::uint32_t>(model.height());
  const Eigen::Vector4d& d = model.distortion();
  info.d.assign(d.data(), d.data() + d.size());
  info.distortion_model = model.kind() == CameraKind::kEquidistant ? "equidistant" : "plumb_bob";
  if (model.kind() == CameraKind::kPinholeRadtan) info.d.push_back(0);  // plumb_bob has five
  const Eigen::Vector4d& f = model.intrinsics();
  info.k = {f[0], 0, f[2], 0, f[1], f[3], 0, 0, 1};
  info.p = {f[0], 0, f[2], 0, 0, f[1], f[3], 0, 0, 0, 1, 0};
  return info;
}

const char* formatOf(std::span<const std::uint8_t> picture) {
  constexpr std::uint8_t kPng = 0x89;  // JPEG begins with 0xFF
  return picture.front() == kPng ? "png" : "jpeg";
}

}  // namespace

LogBag::LogBag(LogSource& log, const LogBagOptions& options, MessageBag& bag)
    : log_(log), options_(options), bag_(bag) {
  for (std::size_t c = 0; c < log_.rig().camera_count; ++c) info_[c] = cameraInfo(log_.rig().camera[c]);
  if (options_.alone) truth_ = log_.groundTruth();
  pending_ = log_.next(message_);
}

void LogBag::check(Stamp stamp) const {
  if (bag_.holds(stamp)) return;
  throw InputError("the log", 0, "stamp", fmt::format("{} ns has no place in a bag", stamp.ns),
                   "A bag holds times from 1 ns to the year 2106 (ROS 1) or 2038 (ROS 2)");
}

Stamp LogBag::stampOfNext() const {
  if (!pending_) return kNever;
  return std::visit([](const auto& message) { return message.stamp; }, message_);
}

bool LogBag::advance() {
  const Stamp next = stampOfNext();
  if (next_truth_ < truth_.size() && truth_[next_truth_].stamp <= next) {
    writeTruth(truth_[next_truth_++]);
    return true;
  }
  if (!pending_) return false;
  if (const auto* sample = std::get_if<ImuSample>(&message_)) {
    writeSample(*sample);
  } else {
    writeImage(std::get<CameraFrame>(message_));
  }
  pending_ = log_.next(message_);
  return true;
}

void LogBag::writeUntil(Stamp stamp) {
  while ((next_truth_ < truth_.size() && truth_[next_truth_].stamp <= stamp) || stampOfNext() <= stamp) {
    if (!advance()) return;
  }
}

void LogBag::writeRest() {
  while (advance()) {
  }
}

std::vector<rosmsg::TransformStamped> LogBag::cameraTransforms(Stamp stamp) const {
  std::vector<rosmsg::TransformStamped> transforms;
  for (std::size_t c = 0; c < log_.rig().camera_count; ++c) {
    transforms.push_back(bagTransform(stamp, options_.frames.body, cameraName(c), log_.rig().T_body_cam[c]));
  }
  return transforms;
}

void LogBag::writeSample(const ImuSample& sample) {
  check(sample.stamp);
  if (options_.alone && !fixed_) {
    // Once, with the first sample's stamp: they hold for all of the log.
    fixed_ = true;
    bag_.write("/tf_static", sample.stamp, rosmsg::TFMessage{cameraTransforms(sample.stamp)}, true);
  }
  const Calibration& calibration = log_.calibration();
  Eigen::Vector3d gyro = sample.gyro;
  Eigen::Vector3d accel = sample.accel;
  if (calibration.turnsImu()) {
    gyro = calibration.R_body_imu.transpose() * gyro;
    accel = calibration.R_body_imu.transpose() * accel;
  }
  rosmsg::Imu imu;
  imu.header = bagHeader(sample.stamp, "imu0");
  imu.angular_velocity = {gyro.x(), gyro.y(), gyro.z()};
  imu.linear_acceleration = {accel.x(), accel.y(), accel.z()};
  bag_.write("/imu0", sample.stamp, imu);
}

void LogBag::writeImage(const CameraFrame& frame) {
  check(frame.stamp);
  const std::string name = cameraName(frame.camera);
  const std::string topic = "/" + name + "/image_raw";
  const rosmsg::Header header = bagHeader(frame.stamp, name);
  const std::span<const std::uint8_t> picture = log_.picture();
  if (!picture.empty() && !options_.raw_images) {
    rosmsg::CompressedImage image;
    image.header = header;
    image.format = formatOf(picture);
    image.data = picture;
    bag_.write(topic + "/compressed", frame.stamp, image);
  } else {
    rosmsg::Image image;
    image.header = header;
    image.width = static_cast<std::uint32_t>(frame.image.width);
    image.height = static_cast<std::uint32_t>(frame.image.height);
    image.encoding = "mono8";
    image.step = image.width;
    // A log's images have no padding behind their rows.
    image.data = {frame.image.data, static_cast<std::size_t>(image.width) * image.height};
    bag_.write(topic, frame.stamp, image);
  }
  info_[frame.camera].header = header;
  bag_.write("/" + name + "/camera_info", frame.stamp, info_[frame.camera]);
}

void LogBag::writeTruth(const TrajectoryPoint& point) {
  if (!bag_.holds(point.stamp)) return;
  bag_.write("/truth/pose", point.stamp, bagPose(point.stamp, options_.frames.truth, point.T_world_body));
}

}  // namespace swiftlet
