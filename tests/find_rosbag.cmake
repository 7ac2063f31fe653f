# ROS's own reader and writer of bags, optional: what ours write and read is compared with it. Debian's package files of
# rosbag-storage cannot be used: they pull in pluginlib's, which run a Python module that is not among their
# dependencies. So headers and libraries are looked up. Sets SWIFTLET_ROSBAG_INCLUDES and SWIFTLET_ROSBAG_LIBRARIES,
# which is empty where something is missing.
set(SWIFTLET_ROSBAG_INCLUDES)
set(SWIFTLET_ROSBAG_LIBRARIES)
foreach(header rosbag/bag.h ros/time.h pluginlib/class_loader.hpp class_loader/class_loader.hpp
               rcpputils/filesystem_helper.hpp rcutils/logging.h ament_index_cpp/get_resource.hpp)
  string(MAKE_C_IDENTIFIER ${header} id)
  cmake_path(GET header PARENT_PATH package)
  find_path(SWIFTLET_ROS_${id} ${header} PATH_SUFFIXES ${package})
  mark_as_advanced(SWIFTLET_ROS_${id})
  list(APPEND SWIFTLET_ROSBAG_INCLUDES ${SWIFTLET_ROS_${id}})
endforeach()
foreach(name rosbag_storage rostime cpp_common roscpp_serialization console_bridge)
  find_library(SWIFTLET_ROS_LIB_${name} ${name})
  mark_as_advanced(SWIFTLET_ROS_LIB_${name})
  list(APPEND SWIFTLET_ROSBAG_LIBRARIES ${SWIFTLET_ROS_LIB_${name}})
endforeach()
if("${SWIFTLET_ROSBAG_INCLUDES};${SWIFTLET_ROSBAG_LIBRARIES}" MATCHES "NOTFOUND")
  set(SWIFTLET_ROSBAG_LIBRARIES)
endif()
list(REMOVE_DUPLICATES SWIFTLET_ROSBAG_INCLUDES)
list(REMOVE_ITEM SWIFTLET_ROSBAG_INCLUDES /usr/include)
