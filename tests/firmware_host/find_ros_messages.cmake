# ROS 1's own message headers (nav, sensor, geometry, tf2, visualization, diagnostic), optional: the test of exported
# bags reads them with these.
set(ros_messages_found FALSE)
if(SWIFTLET_ROSBAG_LIBRARIES)
  set(ros_messages_found TRUE)
  set(ros_message_includes ${SWIFTLET_ROSBAG_INCLUDES})
  foreach(header diagnostic_msgs/DiagnosticArray.h geometry_msgs/PoseStamped.h nav_msgs/Odometry.h
                 sensor_msgs/CameraInfo.h tf2_msgs/TFMessage.h visualization_msgs/Marker.h)
    string(MAKE_C_IDENTIFIER ${header} id)
    find_path(SWIFTLET_ROS_${id} ${header})
    mark_as_advanced(SWIFTLET_ROS_${id})
    list(APPEND ros_message_includes ${SWIFTLET_ROS_${id}})
    if(NOT SWIFTLET_ROS_${id})
      set(ros_messages_found FALSE)
    endif()
  endforeach()
  list(REMOVE_DUPLICATES ros_message_includes)
  list(REMOVE_ITEM ros_message_includes /usr/include)
endif()
