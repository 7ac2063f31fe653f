#pragma once
// Which topics of a bag are the IMU, the cameras and the truth.

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "drivers/bag/bag_file.hpp"
#include "drivers/calibration/calibration.hpp"
#include "drivers/recorded/log_warnings.hpp"
#include "drivers/recorded/trajectory_file.hpp"

namespace swiftlet {

struct BagImuTopics {
  std::uint32_t gyro = 0;
  std::optional<std::uint32_t> accel;  ///< where the accelerometer has a topic of its own
};

/// `wanted`: the calibration's topic name, empty for none. A topic whose accelerations are all exactly zero
/// is a gyroscope only, and the other way round. InputError if there is none.
[[nodiscard]] BagImuTopics chooseImuTopics(BagFile& bag, const std::string& wanted, LogWarnings& warnings);

/// One for each camera of the calibration, fewer where the bag has fewer; InputError if it has none.
[[nodiscard]] std::array<std::optional<std::uint32_t>, kMaxCameras> chooseImageTopics(
    BagFile& bag, const Calibration& calibration, LogWarnings& warnings);

/// A topic of nav_msgs/Odometry, PoseStamped or TransformStamped with `truth`, `gt`, `vicon` or `mocap` in
/// its name.
[[nodiscard]] std::optional<std::uint32_t> chooseTruthTopic(const BagFile& bag);

/// Poses in time order; those that are no poses are left out, which `warnings` says.
[[nodiscard]] Trajectory readBagTruth(BagFile& bag, std::optional<std::uint32_t> topic,
                                      LogWarnings& warnings);

}  // namespace swiftlet
