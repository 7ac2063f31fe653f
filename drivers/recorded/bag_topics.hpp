#pragma once
// Selects the topics of a bag for IMU, cameras and truth.

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
  std::optional<std::uint32_t> accel;  ///< if the accelerometer has its own topic
};

/// `wanted`: the calibration's topic name, empty for none. A topic whose accelerations are all exactly zero
/// is only a gyroscope, one with zero rates only an accelerometer. InputError if there is none.
[[nodiscard]] BagImuTopics chooseImuTopics(BagFile& bag, const std::string& wanted, LogWarnings& warnings);

/// One topic per camera of the calibration, fewer if the bag has fewer; InputError if it has none.
[[nodiscard]] std::array<std::optional<std::uint32_t>, kMaxCameras> chooseImageTopics(
    BagFile& bag, const Calibration& calibration, LogWarnings& warnings);

/// A topic of nav_msgs/Odometry, PoseStamped or TransformStamped with `truth`, `gt`, `vicon` or `mocap` in
/// its name.
[[nodiscard]] std::optional<std::uint32_t> chooseTruthTopic(const BagFile& bag);

/// Poses in time order. Invalid poses are skipped with a warning.
[[nodiscard]] Trajectory readBagTruth(BagFile& bag, std::optional<std::uint32_t> topic,
                                      LogWarnings& warnings);

}  // namespace swiftlet
