# Makes the report's page in a folder of the build: npm fetches what package-lock.json names, esbuild bundles.
# Without a network nothing is made and nothing fails: reports are then plain. Arguments: NPM NODE SOURCE WORK
# PAGE STAMP.
file(MAKE_DIRECTORY ${WORK})
file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json ${SOURCE}/build.mjs ${SOURCE}/src ${SOURCE}/browser.mjs
     ${SOURCE}/check_page.mjs ${SOURCE}/check_live.mjs DESTINATION ${WORK})
file(SHA256 ${SOURCE}/package-lock.json lock)
set(fetched "")
if(EXISTS ${WORK}/fetched)
  file(READ ${WORK}/fetched fetched)
endif()
if(NOT fetched STREQUAL lock)
  execute_process(COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=1
                  WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_QUIET ERROR_VARIABLE said)
  if(failed)
    message(WARNING "npm could not fetch the report page's libraries: `swiftlet report` makes plain reports.\n${said}")
    file(REMOVE ${PAGE})
    return()
  endif()
  file(WRITE ${WORK}/fetched ${lock})
endif()
execute_process(COMMAND ${NODE} build.mjs ${PAGE} WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "the report's page does not build")
endif()
file(TOUCH ${STAMP})
