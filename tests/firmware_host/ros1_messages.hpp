#pragma once
// Messages of ROS 1 out of Debian's message packages, to read bags with.
//
// The generated headers ask an allocator for `rebind`, which C++20 took from std::allocator: BagAllocator
// gives it back. Everything else of the messages is theirs.

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Vector3Stamped.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Float64.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/Marker.h>

#include <memory>

namespace swiftlet {

template <typename T>
struct BagAllocator : std::allocator<T> {
  template <typename U>
  struct rebind {
    using other = BagAllocator<U>;
  };
  BagAllocator() = default;
  template <typename U>
  BagAllocator(const BagAllocator<U>&) {}  // NOLINT(google-explicit-constructor): what an allocator must have
};

using BagStatus = diagnostic_msgs::DiagnosticStatus_<BagAllocator<void>>;
using BagDiagnostics = diagnostic_msgs::DiagnosticArray_<BagAllocator<void>>;
using BagField = sensor_msgs::PointField_<BagAllocator<void>>;
using BagHeader = std_msgs::Header_<BagAllocator<void>>;
using BagMarker = visualization_msgs::Marker_<BagAllocator<void>>;
using BagNumber = std_msgs::Float64_<BagAllocator<void>>;
using BagOdometry = nav_msgs::Odometry_<BagAllocator<void>>;
using BagPath = nav_msgs::Path_<BagAllocator<void>>;
using BagPoints = sensor_msgs::PointCloud2_<BagAllocator<void>>;
using BagPose = geometry_msgs::PoseStamped_<BagAllocator<void>>;
using BagTransform = geometry_msgs::TransformStamped_<BagAllocator<void>>;
using BagTransforms = tf2_msgs::TFMessage_<BagAllocator<void>>;
using BagVector = geometry_msgs::Vector3Stamped_<BagAllocator<void>>;

}  // namespace swiftlet
