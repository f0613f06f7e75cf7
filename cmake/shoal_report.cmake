# What report pages are made of, embedded in the program: theme and script of ours (bins/report), and the plotting library
# that bins/report/package-lock.json pins, fetched by npm, which checks its hash. Without npm or a network the build goes
# on, and report pages say in the plots' place what they are missing.
option(SHOAL_REPORT_PLOTS "Embed the plotting library of report pages, fetched by npm" ON)

set(report_source ${CMAKE_SOURCE_DIR}/bins/report)
set(report_folder ${CMAKE_BINARY_DIR}/report)
set(report_library ${report_folder}/node_modules/uplot)
file(SHA256 ${report_source}/package-lock.json report_lock)

# Fetched once a build folder and lock file.
if(SHOAL_REPORT_PLOTS AND NOT EXISTS ${report_folder}/${report_lock}.fetched)
  find_program(SHOAL_NPM npm)
  set(report_reason "npm is not there")
  if(SHOAL_NPM)
    file(MAKE_DIRECTORY ${report_folder})
    file(COPY ${report_source}/package.json ${report_source}/package-lock.json DESTINATION ${report_folder})
    execute_process(
      COMMAND ${SHOAL_NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=1 --fetch-timeout=20000
      WORKING_DIRECTORY ${report_folder} TIMEOUT 120 RESULT_VARIABLE report_failed OUTPUT_QUIET ERROR_VARIABLE report_reason)
    if(report_failed STREQUAL "0")
      file(TOUCH ${report_folder}/${report_lock}.fetched)
    endif()
  endif()
  if(NOT EXISTS ${report_folder}/${report_lock}.fetched)
    message(WARNING "Report pages will show tables, but no plots: their library could not be fetched (${report_reason}). "
      "With npm and a network, configure again; -DSHOAL_REPORT_PLOTS=OFF builds without plots and without this warning.")
  endif()
endif()

file(READ ${report_source}/theme.css SHOAL_REPORT_THEME)
set(SHOAL_REPORT_SCRIPT "")
foreach(script page bars plots heat)  # in the order in which they run
  file(READ ${report_source}/${script}.js text)
  string(APPEND SHOAL_REPORT_SCRIPT "${text}")
endforeach()
set(SHOAL_PLOT_STYLE "")
set(SHOAL_PLOT_SCRIPT "")
set(SHOAL_PLOT_LICENSE "")
if(SHOAL_REPORT_PLOTS AND EXISTS ${report_folder}/${report_lock}.fetched)
  file(READ ${report_library}/dist/uPlot.min.css SHOAL_PLOT_STYLE)
  file(READ ${report_library}/dist/uPlot.iife.min.js SHOAL_PLOT_SCRIPT)
  file(READ ${report_library}/LICENSE SHOAL_PLOT_LICENSE)
endif()
set_property(DIRECTORY ${CMAKE_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS
  ${report_source}/theme.css ${report_source}/page.js ${report_source}/bars.js ${report_source}/plots.js
  ${report_source}/heat.js ${report_source}/package-lock.json)
configure_file(${report_source}/assets.cpp.in ${CMAKE_BINARY_DIR}/report/assets.cpp @ONLY)

add_library(shoal_report_assets STATIC ${CMAKE_BINARY_DIR}/report/assets.cpp)
target_link_libraries(shoal_report_assets PRIVATE shoal_flags)
