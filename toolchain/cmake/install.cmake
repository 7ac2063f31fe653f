# `cmake --install` gives the program, headers, libraries and a package: find_package(swiftlet)
# then target_link_libraries(app swiftlet::odometry). swiftlet_flags stays private to the build.
# debian/*.install share the same files out among Debian's packages.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# Users of the headers must compile for the same instruction set: Eigen's alignment depends on it.
target_compile_options(swiftlet_core INTERFACE $<INSTALL_INTERFACE:-march=${SWIFTLET_CPU}>)

# Nobody knows the program: its libraries stay in the build.
get_property(libraries GLOBAL PROPERTY SWIFTLET_LIBRARIES)
foreach(library ${libraries})
  get_target_property(folder ${library} SOURCE_DIR)
  if(folder MATCHES "^${PROJECT_SOURCE_DIR}/firmware_host")
    list(REMOVE_ITEM libraries ${library})
  endif()
endforeach()
install(TARGETS ${libraries} EXPORT swiftletTargets)
foreach(room estimator mesher mapping drivers)
  if(IS_DIRECTORY ${PROJECT_SOURCE_DIR}/${room})
    install(DIRECTORY ${room} DESTINATION include/swiftlet FILES_MATCHING PATTERN "*.hpp")
  endif()
endforeach()
install(EXPORT swiftletTargets NAMESPACE swiftlet:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/swiftlet)

# What the exported libraries link (a static library's private packages too) has to be found again
# by the user: one line of the package file for each imported target.
function(swiftlet_dependency_line target result)
  if(target MATCHES "^(Eigen3|PNG|JPEG|ZLIB|LibLZMA|LibArchive|BZip2|Threads|OpenMP|fmt|spdlog|yaml-cpp|libjpeg-turbo|CLI11|CycloneDDS|apriltag)(::|$)")
    set(${result} "find_dependency(${CMAKE_MATCH_1})" PARENT_SCOPE)
  elseif(target MATCHES "^nlohmann_json::")
    set(${result} "find_dependency(nlohmann_json)" PARENT_SCOPE)
  elseif(target MATCHES "^PkgConfig::(.+)$")
    set(${result} "find_dependency(PkgConfig)\npkg_check_modules(${CMAKE_MATCH_1} REQUIRED IMPORTED_TARGET ${CMAKE_MATCH_1})"
      PARENT_SCOPE)
  else()
    message(FATAL_ERROR "toolchain/cmake/install.cmake: say which package gives ${target}")
  endif()
endfunction()

set(dependencies "")
foreach(library ${libraries})
  foreach(property LINK_LIBRARIES INTERFACE_LINK_LIBRARIES)
    get_target_property(links ${library} ${property})
    foreach(link IN LISTS links)
      string(REGEX REPLACE "^\\$<LINK_ONLY:(.*)>$" "\\1" link "${link}")
      # Own libraries and build-only flags need no package, nor do library files and plain names.
      # (`if(TARGET)` does not help: a room's packages are known in the room's folder only.)
      if(link MATCHES "^(swiftlet::|swiftlet_|\\$<BUILD_INTERFACE:)" OR NOT link MATCHES "::|^yaml-cpp$")
        continue()
      endif()
      swiftlet_dependency_line(${link} line)
      list(APPEND dependencies "${line}")
    endforeach()
  endforeach()
endforeach()
list(REMOVE_DUPLICATES dependencies)
list(JOIN dependencies "\n" SWIFTLET_DEPENDENCIES)

configure_package_config_file(toolchain/cmake/swiftletConfig.cmake.in
  ${CMAKE_CURRENT_BINARY_DIR}/swiftletConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/swiftlet)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/swiftletConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/swiftletConfig.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/swiftletConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/swiftlet)

install(FILES README.md CHANGELOG.md LICENSE DESTINATION share/doc/swiftlet)
install(DIRECTORY docs DESTINATION share/doc/swiftlet
        FILES_MATCHING PATTERN "*.md" PATTERN "*.svg" PATTERN "*.jpg")

if(SWIFTLET_BUILD_PROGRAM)
  set(packaging toolchain/packaging)
  install(FILES ${packaging}/swiftlet.service DESTINATION lib/systemd/system)
  install(FILES ${packaging}/sysusers.conf RENAME swiftlet.conf DESTINATION lib/sysusers.d)
  install(FILES ${packaging}/60-swiftlet.rules DESTINATION lib/udev/rules.d)
  install(DIRECTORY ${packaging}/vehicle DESTINATION share/swiftlet/examples)

  # A program prints its manual page: not one that is built for another machine and has no emulator here, nor one
  # that is built to find faults.
  if(NOT (CMAKE_CROSSCOMPILING AND NOT CMAKE_CROSSCOMPILING_EMULATOR OR SWIFTLET_SANITIZE))
    set(pages "")
    set(programs swiftlet)
    if(SWIFTLET_BUILD_LAB AND SWIFTLET_BUILD_VEHICLE_PROGRAM)
      list(APPEND programs swiftlet_vehicle)
    endif()
    foreach(program ${programs})
      set(page ${PROJECT_BINARY_DIR}/${program}.1)
      add_custom_command(OUTPUT ${page} COMMAND ${program} man > ${page} DEPENDS ${program} VERBATIM)
      list(APPEND pages ${page})
    endforeach()
    add_custom_target(swiftlet_manual_pages ALL DEPENDS ${pages})
    install(FILES ${pages} DESTINATION share/man/man1)
  endif()
endif()
