# Eigen and the standard library are most of what the compiler reads in a unit: parsed once, the
# whole build takes half the time. A unit still includes what it uses: the headers are checked
# without this (headers_alone), the aarch64 preset is built without it.
set(SWIFTLET_COMMON_HEADERS
  <Eigen/Cholesky> <Eigen/Core> <Eigen/Geometry> <Eigen/LU>
  <algorithm> <array> <atomic> <bit> <chrono> <cmath> <cstdint> <cstdio> <cstdlib> <cstring> <filesystem>
  <fstream> <functional> <limits> <map> <memory> <numbers> <optional> <set> <span> <sstream> <string>
  <string_view> <thread> <utility> <vector>)

# swiftlet_headers_owner(<name> HEADERS <a> ...): the target that precompiles them for others, by
# swiftlet_use_headers(<target> <name>). Only targets with the same flags can share.
function(swiftlet_headers_owner name)
  cmake_parse_arguments(arg "" "" "HEADERS;DEPENDS" ${ARGN})
  set(unit ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
  file(CONFIGURE OUTPUT ${unit} CONTENT "")
  add_library(${name} STATIC EXCLUDE_FROM_ALL ${unit})
  target_link_libraries(${name} PRIVATE swiftlet_flags Eigen3::Eigen ${arg_DEPENDS})
  target_compile_features(${name} PRIVATE cxx_std_20)
  if(SWIFTLET_PRECOMPILED_HEADERS)
    target_precompile_headers(${name} PRIVATE ${arg_HEADERS})
  endif()
endfunction()

function(swiftlet_use_headers target name)
  if(SWIFTLET_PRECOMPILED_HEADERS)
    target_precompile_headers(${target} REUSE_FROM ${name})
  endif()
endfunction()

# swiftlet_join_units(<target> [<alone>...]): the rooms of logs, program and tests are many short files that include the
# same headers; joined, they are parsed once in twenty, of tests, which are longer, once in eight: no unit takes much
# more than a minute. The files that compute results (estimator, mapping, simulation) stay alone: what is inlined
# where could change a last bit, and does in simulated samples. So do the files <alone>.
function(swiftlet_join_units target)
  file(RELATIVE_PATH room ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  if(SWIFTLET_JOINED_UNITS AND room MATCHES "^(drivers/(bag|calibration|dds|input|recorded|v4l2)|firmware_host|tests)(/|$)")
    set(batch 20)
    if(room MATCHES "^tests/")
      set(batch 8)
    endif()
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${batch})
    set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  endif()
endfunction()
