# Makes the report's page in a folder of the build. Its libraries are fetched by npm, which brings esbuild too, or
# unpacked from LIBRARIES. esbuild bundles. Where npm has no network nothing is made and nothing fails: reports are
# then plain. Arguments: NPM NODE or LIBRARIES ESBUILD; SOURCE WORK PAGE STAMP.
include(${CMAKE_CURRENT_LIST_DIR}/../../../../toolchain/cmake/npm_fetch.cmake)
file(MAKE_DIRECTORY ${WORK})
file(COPY ${SOURCE}/src ${SOURCE}/browser.mjs ${SOURCE}/check_page.mjs ${SOURCE}/check_live.mjs
          ${SOURCE}/check_playback.mjs
     DESTINATION ${WORK})
if(LIBRARIES)
  file(ARCHIVE_EXTRACT INPUT ${LIBRARIES} DESTINATION ${WORK})
else()
  npm_fetch(${NPM} ${SOURCE} ${WORK} "the report page's libraries: `swiftlet report` makes plain reports." fetched)
  if(NOT fetched)
    file(REMOVE ${PAGE})
    return()
  endif()
  set(ESBUILD ${NODE} node_modules/esbuild/bin/esbuild)
endif()
# Inline comments: the libraries' licences ask that their notices stay.
execute_process(COMMAND ${ESBUILD} src/main.js --bundle --minify --format=iife --target=chrome100,firefox100,safari15
                        --charset=utf8 --legal-comments=inline --log-level=warning --outdir=bundle
                WORKING_DIRECTORY ${WORK} COMMAND_ERROR_IS_FATAL ANY)
file(READ ${WORK}/src/page.html page)
file(READ ${WORK}/bundle/main.css css)
file(READ ${WORK}/bundle/main.js js)
string(REPLACE "</script" "<\\/script" js "${js}")
string(REPLACE "/*css*/" "${css}" page "${page}")
string(REPLACE "/*js*/" "${js}" page "${page}")
file(WRITE ${PAGE} "${page}")
file(TOUCH ${STAMP})
