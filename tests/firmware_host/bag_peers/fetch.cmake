# npm fetches what package-lock.json names into a folder of the build. Without a network nothing is made and nothing
# fails: the test is then skipped. Arguments: NPM SOURCE WORK STAMP.
file(MAKE_DIRECTORY ${WORK})
file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json ${SOURCE}/bag_peers.mjs DESTINATION ${WORK})
file(SHA256 ${SOURCE}/package-lock.json lock)
set(fetched "")
if(EXISTS ${WORK}/fetched)
  file(READ ${WORK}/fetched fetched)
endif()
if(NOT fetched STREQUAL lock)
  execute_process(COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=1
                  WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_QUIET ERROR_VARIABLE said)
  if(failed)
    message(WARNING "npm could not fetch other readers of bags: the test bag_peers is skipped.\n${said}")
    return()
  endif()
  file(WRITE ${WORK}/fetched ${lock})
endif()
file(TOUCH ${STAMP})
