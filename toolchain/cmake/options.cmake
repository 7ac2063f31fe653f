# Build options and the one set of compile flags that every target of the project shares.
option(SWIFTLET_BUILD_PROGRAM "Build the program and the drivers (needs yaml-cpp, fmt, CLI11, codecs)" ON)
option(SWIFTLET_BUILD_LAB "Commands for away from the vehicle: simulate, evaluate, mesh, fuse, report, export, hil ..." ON)
option(SWIFTLET_BUILD_VEHICLE_PROGRAM "Also install swiftlet_vehicle: the program without SWIFTLET_BUILD_LAB's commands" OFF)
option(SWIFTLET_WITH_CHOLMOD "Full smoothing with SuiteSparse's CHOLMOD (GPL, see docs/licences.md)" ON)
option(SWIFTLET_BUILD_TESTS "Build the tests (needs Catch2, OpenCV)" ON)
option(SWIFTLET_BUILD_BENCHMARKS "Build the benchmarks (needs Google Benchmark, OpenCV, Ceres, OpenGV)" OFF)
option(SWIFTLET_BUILD_FUZZERS "Build the libFuzzer targets (needs clang)" OFF)
option(SWIFTLET_PRECOMPILED_HEADERS "Parse Eigen and the standard library once, not in each unit" ON)
option(SWIFTLET_JOINED_UNITS "Compile files of a library of the program, or of a test program, together" ON)
option(SWIFTLET_WARNINGS_AS_ERRORS "Treat warnings as errors" ON)
set(SWIFTLET_SANITIZE "" CACHE STRING "Sanitizers, as -fsanitize takes them: address,undefined or thread")

# One instruction set for the whole build: units that share Eigen must agree on alignment.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  set(SWIFTLET_CPU "x86-64-v3" CACHE STRING "-march for every unit")
else()
  set(SWIFTLET_CPU "armv8-a" CACHE STRING "-march for every unit")
endif()

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

# Second builds are faster where ccache is installed; nothing depends on it. A build tree that began without
# goes on without: other commands would compile all of it again.
if(NOT DEFINED CACHE{SWIFTLET_CCACHE})
  find_program(SWIFTLET_CCACHE ccache)
endif()
mark_as_advanced(SWIFTLET_CCACHE)
if(SWIFTLET_CCACHE AND NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
  # What ccache asks for where headers are precompiled.
  set(CMAKE_CXX_COMPILER_LAUNCHER
      ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${SWIFTLET_CCACHE})
endif()

# A package that one room finds is known to the tests and programs that link the room.
set(CMAKE_FIND_PACKAGE_TARGETS_GLOBAL ON)

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")

add_library(swiftlet_flags INTERFACE)
target_compile_options(swiftlet_flags INTERFACE
  -march=${SWIFTLET_CPU} -fno-math-errno -fno-trapping-math
  -Wall -Wextra -Wconversion -Wshadow
  $<$<BOOL:${SWIFTLET_WARNINGS_AS_ERRORS}>:-Werror>
  # GCC 12 warns inside Eigen 3.4's fixed-size expressions and, falsely, inside the standard
  # library's string operator+ (GCC bug 105651).
  $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized -Wno-array-bounds -Wno-stringop-overread -Wno-stringop-overflow -Wno-restrict>
  # Its default makes GCC collect garbage so often that a build takes 7 % longer; a unit needs 1.4 GB instead of 1.2.
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1000000>)
target_compile_definitions(swiftlet_flags INTERFACE
  $<$<CONFIG:Debug>:EIGEN_RUNTIME_NO_MALLOC EIGEN_INITIALIZE_MATRICES_BY_NAN>)
# An older processor is refused by the dynamic linker, with a message, before it meets an unknown instruction.
if(SWIFTLET_CPU MATCHES "^x86-64-v[234]$")
  target_link_options(swiftlet_flags INTERFACE -Wl,-z,${SWIFTLET_CPU})
endif()
if(SWIFTLET_SANITIZE)
  target_compile_options(swiftlet_flags INTERFACE -fsanitize=${SWIFTLET_SANITIZE} -fno-omit-frame-pointer)
  if(SWIFTLET_SANITIZE MATCHES "address,undefined")
    # What the address sanitizer finds anyway; on Eigen's code these checks take a third of the build.
    target_compile_options(swiftlet_flags INTERFACE -fno-sanitize=null,alignment,object-size,vptr,pointer-overflow)
  endif()
  target_link_options(swiftlet_flags INTERFACE -fsanitize=${SWIFTLET_SANITIZE})
endif()
