# Cross build for 64-bit Arm companion computers: Debian's g++-aarch64-linux-gnu, and Debian's arm64 packages in a
# folder that toolchain/aarch64/make_root.sh makes. What is built runs under qemu-user, tests too.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)

get_filename_component(default_root ${CMAKE_CURRENT_LIST_DIR}/../../build/arm64_root ABSOLUTE)
set(SWIFTLET_ARM64_ROOT ${default_root} CACHE PATH "Folder with unpacked arm64 packages")
# The compiler is tried in a project of its own, which reads this file again.
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES SWIFTLET_ARM64_ROOT)
if(NOT EXISTS ${SWIFTLET_ARM64_ROOT}/packages.txt)
  message(FATAL_ERROR "${SWIFTLET_ARM64_ROOT} has no arm64 packages: run toolchain/aarch64/make_root.sh")
endif()
set(CMAKE_SYSROOT ${SWIFTLET_ARM64_ROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_LIBDIR} ${CMAKE_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})

find_program(SWIFTLET_QEMU NAMES qemu-aarch64-static qemu-aarch64)
mark_as_advanced(SWIFTLET_QEMU)
if(SWIFTLET_QEMU)
  set(CMAKE_CROSSCOMPILING_EMULATOR ${SWIFTLET_QEMU} -L ${CMAKE_SYSROOT})
endif()
