# What `cmake --install` puts where, and Debian packages of it (`cpack -G DEB` in the build folder). docs/installing.md.
# Components: program, library, development; and debian, for packages alone.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# ---- pages that the program writes of itself: they cannot differ from it
find_program(GZIP_PROGRAM gzip REQUIRED)
set(pages ${CMAKE_BINARY_DIR}/pages)
add_custom_command(OUTPUT ${pages}/shoal.1.gz ${pages}/shoal ${pages}/_shoal
  COMMAND ${CMAKE_COMMAND} -E make_directory ${pages}
  COMMAND shoal help --man > ${pages}/shoal.1
  COMMAND ${GZIP_PROGRAM} -9 -n -f -k ${pages}/shoal.1
  COMMAND shoal help --completion bash > ${pages}/shoal
  COMMAND shoal help --completion zsh > ${pages}/_shoal
  DEPENDS shoal VERBATIM)
add_custom_target(shoal_pages ALL DEPENDS ${pages}/shoal.1.gz ${pages}/shoal ${pages}/_shoal)

# ---- the program
install(TARGETS shoal RUNTIME COMPONENT program)
install(FILES ${pages}/shoal.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
install(FILES ${pages}/shoal DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT program)
# Debian's zsh looks elsewhere below /usr than below /usr/local.
install(CODE "
  set(folder site-functions)
  if(CMAKE_INSTALL_PREFIX MATCHES \"/usr$\")
    set(folder vendor-completions)
  endif()
  file(INSTALL \"${pages}/_shoal\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}/zsh/\${folder}\")"
  COMPONENT program)

# ---- the library: one shared object that shows what include/shoal declares and nothing else (docs/decisions/0030), so that
# programs that link it need none of the libraries that we stand on. While the version is 0.x each minor one breaks.
add_library(shoal_library SHARED $<TARGET_OBJECTS:shoal_api>)
target_link_libraries(shoal_library PRIVATE shoal_engine)
target_include_directories(shoal_library PUBLIC $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_compile_features(shoal_library INTERFACE cxx_std_20)
set(symbols ${CMAKE_SOURCE_DIR}/cmake/shoal_symbols.map)
target_link_options(shoal_library PRIVATE -Wl,--as-needed -Wl,--version-script=${symbols})
set_target_properties(shoal_library PROPERTIES OUTPUT_NAME shoal EXPORT_NAME shoal LINK_DEPENDS ${symbols}
  VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
install(TARGETS shoal_library EXPORT shoal_targets
  LIBRARY COMPONENT library NAMELINK_COMPONENT development)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/include/shoal DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development
  FILES_MATCHING PATTERN "*.h")
set(config_folder ${CMAKE_INSTALL_LIBDIR}/cmake/shoal)
install(EXPORT shoal_targets NAMESPACE shoal:: FILE shoalTargets.cmake DESTINATION ${config_folder} COMPONENT development)
configure_package_config_file(${CMAKE_SOURCE_DIR}/cmake/shoalConfig.cmake.in ${pages}/shoalConfig.cmake
  INSTALL_DESTINATION ${config_folder} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${pages}/shoalConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${pages}/shoalConfig.cmake ${pages}/shoalConfigVersion.cmake DESTINATION ${config_folder}
  COMPONENT development)
file(RELATIVE_PATH SHOAL_PC_PREFIX /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(${CMAKE_SOURCE_DIR}/cmake/shoal.pc.in ${pages}/shoal.pc @ONLY)
install(FILES ${pages}/shoal.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/docs/examples DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libshoal-dev
  COMPONENT development)

include(shoal_package)
