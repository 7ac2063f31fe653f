#pragma once
// The estimate as messages of ROS 1 or 2.

#include <string>

#include "drivers/bag/ros_messages.hpp"
#include "firmware_host/lab/export/run_folder.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"
#include "firmware_host/outputs/ros2/ros_state.hpp"

namespace swiftlet {

rosmsg::PoseStamped bagPose(Stamp stamp, const std::string& frame, const SE3& T_frame_body);
rosmsg::TransformStamped bagTransform(Stamp stamp, const std::string& frame, const std::string& child,
                                      const SE3& T_frame_child);
rosmsg::Odometry bagOdometry(const NavState& state, const RosFrames& frames);
/// The header has the stamp of the first pose, from which on the path is shown.
rosmsg::Path bagPath(const std::string& frame, const Trajectory& trajectory);
rosmsg::Vector3Stamped bagVector(Stamp stamp, const std::string& frame, const Eigen::Vector3d& vector);
/// Three points and colours per face: the label's colour, or the corners' grey values. A mesh without faces
/// removes the marker.
rosmsg::Marker bagMarker(Stamp stamp, const std::string& frame, const std::string& name,
                         const TriangleMesh& mesh);
/// The mesh's vertices: x y z [m], rgb (0x00RRGGBB in the bits of a float, as expected by viewers) and label,
/// as in docs/ros2.md. A vertex has the label of its first labelled face.
rosmsg::PointCloud2 bagPoints(Stamp stamp, const std::string& frame, const TriangleMesh& mesh);
/// Standard deviations from three consecutive diagonal elements of the state's covariance, starting at
/// `first`.
Eigen::Vector3d bagSigma(const NavState& state, int first);
/// 0: good; 1: initializing or degraded; 2: failed.
rosmsg::Float64 bagLevel(Health health);
rosmsg::DiagnosticArray bagDiagnostics(const KeyframeState& keyframe);
/// The event, and the health after it.
rosmsg::DiagnosticArray bagDiagnostics(const EventLine& event, const std::string& health);

}  // namespace swiftlet
