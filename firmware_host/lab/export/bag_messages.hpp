#pragma once
// Our estimate as ROS 1 messages of Debian's message packages. Included where bags are written and nowhere
// else.
//
// The generated headers ask an allocator for `rebind`, which C++20 took from std::allocator: BagAllocator
// gives it back. Everything else of the messages is theirs.

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Vector3Stamped.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/Marker.h>

#include <memory>

#include "firmware_host/lab/export/run_folder.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"
#include "firmware_host/outputs/ros2/ros_state.hpp"

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
using BagHeader = std_msgs::Header_<BagAllocator<void>>;
using BagMarker = visualization_msgs::Marker_<BagAllocator<void>>;
using BagOdometry = nav_msgs::Odometry_<BagAllocator<void>>;
using BagPath = nav_msgs::Path_<BagAllocator<void>>;
using BagPose = geometry_msgs::PoseStamped_<BagAllocator<void>>;
using BagTransform = geometry_msgs::TransformStamped_<BagAllocator<void>>;
using BagTransforms = tf2_msgs::TFMessage_<BagAllocator<void>>;
using BagVector = geometry_msgs::Vector3Stamped_<BagAllocator<void>>;

/// The stamp must be one that ros::Time can hold (bagHolds).
ros::Time bagTime(Stamp stamp);
bool bagHolds(Stamp stamp);

BagHeader bagHeader(Stamp stamp, const std::string& frame);
BagPose bagPose(Stamp stamp, const std::string& frame, const SE3& T_frame_body);
BagTransform bagTransform(Stamp stamp, const std::string& frame, const std::string& child,
                          const SE3& T_frame_child);
BagOdometry bagOdometry(const NavState& state, const RosFrames& frames);
/// The header has the stamp of the first pose, from which on the path is shown.
BagPath bagPath(const std::string& frame, const Trajectory& trajectory);
BagVector bagVector(Stamp stamp, const std::string& frame, const Eigen::Vector3d& vector);
/// Three points and colours a face: the label's colour, or the corners' grey values. A mesh without faces
/// takes the marker away.
BagMarker bagMarker(Stamp stamp, const std::string& frame, const std::string& name, const TriangleMesh& mesh);
BagDiagnostics bagDiagnostics(const KeyframeState& keyframe);
/// The event, and the health as it then is.
BagDiagnostics bagDiagnostics(const EventLine& event, const std::string& health);

}  // namespace swiftlet
