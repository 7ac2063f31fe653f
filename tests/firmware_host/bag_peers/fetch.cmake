# The other readers of bags in a folder of the build; without them the test is skipped. Arguments: NPM SOURCE WORK
# STAMP.
include(${CMAKE_CURRENT_LIST_DIR}/../../../toolchain/cmake/npm_fetch.cmake)
file(MAKE_DIRECTORY ${WORK})
file(COPY ${SOURCE}/bag_peers.mjs ${SOURCE}/foxglove_run.mjs ${SOURCE}/mcap_reader.mjs DESTINATION ${WORK})
npm_fetch(${NPM} ${SOURCE} ${WORK} "other readers of bags: the test bag_peers is skipped." fetched)
if(fetched)
  file(TOUCH ${STAMP})
endif()
