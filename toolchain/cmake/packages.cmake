# Debian packages by `cpack` in the build folder: swiftlet or, without the lab, swiftlet-vehicle (program,
# service), libswiftlet-dev (libraries, headers), swiftlet-doc. One component each; docs/packages.md says what is
# in them.
if(SWIFTLET_BUILD_LAB)
  set(program_package swiftlet)
  set(other_program_package swiftlet-vehicle)
else()
  set(program_package swiftlet-vehicle)
  set(other_program_package swiftlet)
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_PROVIDES swiftlet)
endif()
set(packaging ${PROJECT_SOURCE_DIR}/toolchain/packaging)

# Debian wants text packed, and without a stamp so that the same files give the same package.
find_program(SWIFTLET_GZIP gzip)
mark_as_advanced(SWIFTLET_GZIP)
function(swiftlet_gzip source packed)
  add_custom_command(OUTPUT ${packed} COMMAND ${SWIFTLET_GZIP} -9nc ${source} > ${packed} DEPENDS ${source} VERBATIM)
endfunction()

set(SWIFTLET_PACKAGE_CONTACT "The swiftlet authors <authors@swiftlet.invalid>" CACHE STRING
    "Maintainer of the Debian packages that cpack makes")
# What changed in the packaging, in Debian's form; of SOURCE_DATE_EPOCH's day where that is set.
string(TIMESTAMP day "%a, %d %b %Y 00:00:00 +0000" UTC)
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/changelog.Debian CONTENT
"swiftlet (${PROJECT_VERSION}-1) bookworm; urgency=low

  * Made by cpack; what changed in swiftlet is in changelog.gz.

 -- ${SWIFTLET_PACKAGE_CONTACT}  ${day}
")
set(changelogs "")
set(texts "")
if(SWIFTLET_GZIP)
  set(changelogs ${PROJECT_BINARY_DIR}/changelog.gz ${PROJECT_BINARY_DIR}/changelog.Debian.gz)
  swiftlet_gzip(${PROJECT_SOURCE_DIR}/CHANGELOG.md ${PROJECT_BINARY_DIR}/changelog.gz)
  swiftlet_gzip(${PROJECT_BINARY_DIR}/changelog.Debian ${PROJECT_BINARY_DIR}/changelog.Debian.gz)
  list(APPEND texts ${changelogs})
endif()
function(swiftlet_package_texts package component)
  install(FILES ${packaging}/debian/copyright ${changelogs} DESTINATION share/doc/${package} COMPONENT ${component})
endfunction()

swiftlet_package_texts(libswiftlet-dev development)
swiftlet_package_texts(swiftlet-doc documentation)
install(FILES README.md DESTINATION share/doc/swiftlet COMPONENT documentation)
install(DIRECTORY docs DESTINATION share/doc/swiftlet COMPONENT documentation
        FILES_MATCHING PATTERN "*.md" PATTERN "*.svg" PATTERN "*.jpg")

if(SWIFTLET_BUILD_PROGRAM)
  swiftlet_package_texts(${program_package} program)
  install(FILES ${packaging}/swiftlet.service DESTINATION lib/systemd/system COMPONENT program)
  install(FILES ${packaging}/60-swiftlet.rules DESTINATION lib/udev/rules.d COMPONENT program)
  install(DIRECTORY ${packaging}/vehicle DESTINATION share/swiftlet/examples COMPONENT program)

  # The page is printed by the program: not by one that is built for another machine and has no emulator here,
  # nor by one that is built to find faults.
  set(runs_here ON)
  if(CMAKE_CROSSCOMPILING AND NOT CMAKE_CROSSCOMPILING_EMULATOR OR SWIFTLET_SANITIZE OR NOT SWIFTLET_GZIP)
    set(runs_here OFF)
  endif()
  if(runs_here)
    set(page ${PROJECT_BINARY_DIR}/swiftlet.1)
    add_custom_command(OUTPUT ${page} COMMAND swiftlet man > ${page} DEPENDS swiftlet VERBATIM)
    swiftlet_gzip(${page} ${page}.gz)
    list(APPEND texts ${page}.gz)
    install(FILES ${page}.gz DESTINATION share/man/man1 COMPONENT program)
  endif()
endif()
add_custom_target(swiftlet_texts ALL DEPENDS ${texts})
# All that is installed, without the tests.
add_custom_target(swiftlet_installed DEPENDS ${libraries} swiftlet_texts)

# Which Debian packages the packages that find_package(swiftlet) looks for come from. A file's is asked of dpkg.
set(debian_Eigen3 libeigen3-dev)
set(debian_PNG libpng-dev)
set(debian_JPEG libjpeg62-turbo-dev)
# Its package files also name the files of the other.
set(debian_libjpeg-turbo "libturbojpeg0-dev;libjpeg62-turbo-dev")
set(debian_ZLIB zlib1g-dev)
set(debian_LibLZMA liblzma-dev)
set(debian_LibArchive libarchive-dev)
set(debian_BZip2 libbz2-dev)
set(debian_fmt libfmt-dev)
set(debian_spdlog libspdlog-dev)
set(debian_yaml-cpp libyaml-cpp-dev)
set(debian_CLI11 libcli11-dev)
set(debian_nlohmann_json nlohmann-json3-dev)
set(debian_Threads libc6-dev)
set(debian_OpenMP libgomp1)
set(debian_sqlite3 "libsqlite3-dev;pkg-config")
set(debian_libzstd "libzstd-dev;pkg-config")
set(debian_liblz4 "liblz4-dev;pkg-config")
set(debian_libgpiod "libgpiod-dev;pkg-config")
set(debian_CycloneDDS cyclonedds-dev)
set(debian_apriltag libapriltag-dev)
set(debian_gstreamer-app-1.0 "libgstreamer-plugins-base1.0-dev;pkg-config")
set(debian_gstreamer-video-1.0 "libgstreamer-plugins-base1.0-dev;pkg-config")
set(development_depends "")
foreach(line IN LISTS dependencies)
  # The last name of the line: libgpiod of find_dependency(PkgConfig), pkg_check_modules(libgpiod ...).
  string(REGEX REPLACE "^.*(find_dependency|pkg_check_modules)\\(([^ )]+).*$" "\\2" name "${line}")
  if(NOT debian_${name})
    message(FATAL_ERROR "toolchain/cmake/packages.cmake: say which Debian package gives ${name}")
  endif()
  list(APPEND development_depends ${debian_${name}})
endforeach()
find_program(SWIFTLET_DPKG_QUERY dpkg-query)
mark_as_advanced(SWIFTLET_DPKG_QUERY)
if(SWIFTLET_DPKG_QUERY AND NOT CMAKE_CROSSCOMPILING)
  foreach(file IN LISTS linked_files)
    execute_process(COMMAND ${SWIFTLET_DPKG_QUERY} -S ${file} OUTPUT_VARIABLE owner ERROR_QUIET)
    if(owner MATCHES "^([a-z0-9.+-]+)")
      list(APPEND development_depends ${CMAKE_MATCH_1})
    endif()
  endforeach()
endif()
list(REMOVE_DUPLICATES development_depends)
list(SORT development_depends)
list(JOIN development_depends ", " development_depends)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME swiftlet)
set(CPACK_PACKAGE_VENDOR "The swiftlet authors")
set(CPACK_PACKAGE_CONTACT "${SWIFTLET_PACKAGE_CONTACT}")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL development documentation)
if(SWIFTLET_BUILD_PROGRAM)
  list(PREPEND CPACK_COMPONENTS_ALL program)
endif()
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME ${program_package})
# Both have the same files in the same places: one replaces the other.
set(CPACK_DEBIAN_PROGRAM_PACKAGE_CONFLICTS ${other_program_package})
set(CPACK_DEBIAN_PROGRAM_PACKAGE_REPLACES ${other_program_package})
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS adduser)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "systemd, udev")
if(SWIFTLET_WITH_GSTREAMER)
  # The sink, and videoconvert.
  string(APPEND CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS ", gstreamer1.0-plugins-base")
endif()
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS swiftlet-doc)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_CONTROL_EXTRA
    ${packaging}/debian/postinst ${packaging}/debian/prerm ${packaging}/debian/postrm)
set(program_description
    "The program swiftlet, a service that flies with a vehicle's settings,\nrules for its devices, an example of the settings, and the manual page.")
if(NOT SWIFTLET_BUILD_LAB)
  string(APPEND program_description
         "\nOnly what a vehicle needs: it flies, records, replays and smooths. Commands\nthat simulate, evaluate and show flights are in the package swiftlet.")
endif()
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "${program_description}\nBuilt for ${SWIFTLET_CPU}.")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libswiftlet-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${development_depends}")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_RECOMMENDS "cmake, g++")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS swiftlet-doc)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
    "The static libraries and headers of the estimator, the mesher, the mapping\nand the drivers, for find_package(swiftlet). Built for ${SWIFTLET_CPU}.")

set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_NAME swiftlet-doc)
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_SECTION doc)
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_ARCHITECTURE all)
set(CPACK_COMPONENT_DOCUMENTATION_DESCRIPTION "The user guides, and a page with equations and sources for each part.")
include(CPack)
