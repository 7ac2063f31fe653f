# Makes the report's page in a folder of the build: npm fetches, esbuild bundles. Without a network nothing is made
# and nothing fails: reports are then plain. Arguments: NPM NODE SOURCE WORK PAGE STAMP.
include(${CMAKE_CURRENT_LIST_DIR}/../../../../toolchain/cmake/npm_fetch.cmake)
file(MAKE_DIRECTORY ${WORK})
file(COPY ${SOURCE}/build.mjs ${SOURCE}/src ${SOURCE}/browser.mjs ${SOURCE}/check_page.mjs ${SOURCE}/check_live.mjs
          ${SOURCE}/check_playback.mjs
     DESTINATION ${WORK})
npm_fetch(${NPM} ${SOURCE} ${WORK} "the report page's libraries: `swiftlet report` makes plain reports." fetched)
if(NOT fetched)
  file(REMOVE ${PAGE})
  return()
endif()
execute_process(COMMAND ${NODE} build.mjs ${PAGE} WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "the report's page does not build")
endif()
file(TOUCH ${STAMP})
