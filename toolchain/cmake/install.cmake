# `cmake --install` gives headers, libraries and a package: find_package(swiftlet) then
# target_link_libraries(app swiftlet::odometry). swiftlet_flags stays private to the build.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

get_property(libraries GLOBAL PROPERTY SWIFTLET_LIBRARIES)
install(TARGETS ${libraries} EXPORT swiftletTargets)
foreach(room estimator mesher mapping drivers)
  install(DIRECTORY ${room} DESTINATION include/swiftlet FILES_MATCHING PATTERN "*.hpp")
endforeach()
install(EXPORT swiftletTargets NAMESPACE swiftlet:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/swiftlet)
configure_package_config_file(toolchain/cmake/swiftletConfig.cmake.in
  ${CMAKE_CURRENT_BINARY_DIR}/swiftletConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/swiftlet)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/swiftletConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/swiftletConfig.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/swiftletConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/swiftlet)
