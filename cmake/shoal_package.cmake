# Debian packages: `cpack -G DEB` in the build folder makes shoal, libshoal0.1 and libshoal-dev. Paths are those of a
# build configured with -DCMAKE_INSTALL_PREFIX=/usr (scripts/package).
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME shoal)
set(CPACK_PACKAGE_VENDOR "Shoal developers")
set(CPACK_PACKAGE_CONTACT "Shoal developers")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
# What each executable needs is asked of dpkg-shlibdeps: libtbb12 (>= 2021.4), libopenexr-3-1-30 and so on.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENTS_ALL program library development)

set(abi ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set(about "Shoal is a path tracer for glTF scenes that do not fit in memory: it cuts the
scene into treelets on disk, lets rays wait for the treelet they need, and
loads each one for the many rays that wait for it, under a cap on memory.")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME shoal)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libshoal${abi})
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libshoal-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libshoal${abi} (= ${PROJECT_VERSION}-1)")
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "render glTF scenes bigger than memory\n${about}")
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION "rays through scenes bigger than memory (shared library)\n${about}\n\nThis package has the library that other programs trace rays with.")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
  "rays through scenes bigger than memory (headers)\n${about}\n\nThis package has what programs are built with that use the library.")

# Debian wants these of every package: who may do what with it, and what changed.
find_program(GZIP_PROGRAM gzip REQUIRED)
string(TIMESTAMP SHOAL_PACKAGE_DATE "%a, %d %b %Y %H:%M:%S +0000" UTC)
set(SHOAL_PLOT_COPYRIGHT "")
if(SHOAL_PLOT_LICENSE)  # of the library that report pages bring along
  string(REGEX MATCH "Copyright[^\n]*" holder "${SHOAL_PLOT_LICENSE}")
  string(REGEX REPLACE "\n\n+" "\n .\n" text "${SHOAL_PLOT_LICENSE}")
  string(STRIP "${text}" text)
  string(REGEX REPLACE "\n([^ ])" "\n \\1" text "${text}")
  string(REGEX REPLACE "^Copyright \\([cC]\\) " "" holder "${holder}")
  set(SHOAL_PLOT_COPYRIGHT
    "\nFiles: report/node_modules/uplot/*\nCopyright: ${holder}\nLicense: Expat\n ${text}\nComment: embedded in bin/shoal, for the pages that it writes\n")
endif()
configure_file(${CMAKE_SOURCE_DIR}/cmake/debian_copyright.in ${pages}/copyright @ONLY)
configure_file(${CMAKE_SOURCE_DIR}/cmake/debian_changelog.in ${pages}/changelog.Debian @ONLY)
configure_file(${CMAKE_SOURCE_DIR}/CHANGELOG.md ${pages}/changelog COPYONLY)
foreach(name changelog changelog.Debian)
  execute_process(COMMAND ${GZIP_PROGRAM} -9 -n -f -k ${pages}/${name} COMMAND_ERROR_IS_FATAL ANY)
endforeach()
foreach(component program library development)
  string(TOUPPER ${component} upper)
  set(folder ${CMAKE_INSTALL_DATADIR}/doc/${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  install(FILES ${pages}/copyright ${pages}/changelog.gz DESTINATION ${folder} COMPONENT ${component})
  install(CODE "
    if(CMAKE_INSTALL_PREFIX MATCHES \"/usr$\")
      file(INSTALL \"${pages}/changelog.Debian.gz\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${folder}\")
    endif()" COMPONENT ${component})
endforeach()
include(CPack)
