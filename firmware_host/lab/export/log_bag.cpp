#include "firmware_host/lab/export/log_bag.hpp"

#include <fmt/format.h>

#include <limits>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/image_files.hpp"
#include "drivers/recorded/log_messages.hpp"
#include "firmware_host/lab/export/bag_messages.hpp"

namespace swiftlet {
namespace {

constexpr Stamp kNever{std::numeric_limits<std::int64_t>::max()};

}  // namespace

LogBag::LogBag(LogSource& log, const LogBagOptions& options, MessageBag& bag)
    : log_(log), options_(options), bag_(bag) {
  for (std::size_t c = 0; c < log_.rig().camera_count; ++c) info_[c] = cameraInfoOf(log_.rig().camera[c]);
  if (options_.truth) truth_ = log_.groundTruth();
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
  if (options_.transforms && !fixed_) {
    // Written once, with the first sample's stamp, for the whole log.
    fixed_ = true;
    bag_.write("/tf_static", sample.stamp, rosmsg::TFMessage{cameraTransforms(sample.stamp)}, true);
  }
  ImuSample sensed = sample;
  const Calibration& calibration = log_.calibration();
  if (calibration.turnsImu() || calibration.hasImuMatrices()) {
    calibration.imuCorrection().inverse().apply(sensed);
  }
  writeImu(bag_, sensed);
}

void LogBag::writeImage(const CameraFrame& frame) {
  check(frame.stamp);
  rosmsg::CameraInfo& info = info_[frame.camera];
  if (options_.jpeg_quality > 0) {
    const std::vector<std::uint8_t> jpeg = encodeJpeg(frame.image.data, static_cast<int>(info.width),
                                                      static_cast<int>(info.height), options_.jpeg_quality);
    writePicture(bag_, frame.camera, frame.stamp, jpeg, info);
    return;
  }
  const std::span<const std::uint8_t> picture = log_.picture();
  if (!picture.empty() && !options_.raw_images) {
    writePicture(bag_, frame.camera, frame.stamp, picture, info);
    return;
  }
  // A log's images have no padding at the end of rows.
  const std::size_t bytes = static_cast<std::size_t>(info.width) * info.height;
  writePixels(bag_, frame.camera, frame.stamp, {frame.image.data, bytes}, info);
}

void LogBag::writeTruth(const TrajectoryPoint& point) {
  if (!bag_.holds(point.stamp)) return;
  bag_.write("/truth/pose", point.stamp, bagPose(point.stamp, options_.frames.truth, point.T_world_body));
}

}  // namespace swiftlet
