# One set of flags for everything of ours. -ffp-contract=off: no fused multiply-add, whatever the target has, so that
# every instruction set gives the same bits.
add_library(shoal_flags INTERFACE)
target_compile_options(shoal_flags INTERFACE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Werror -ffp-contract=off
  -fno-math-errno -fno-trapping-math)
target_compile_definitions(shoal_flags INTERFACE SHOAL_VERSION="${PROJECT_VERSION}")
target_include_directories(shoal_flags INTERFACE ${CMAKE_SOURCE_DIR})
target_link_libraries(shoal_flags INTERFACE glm::glm)
if(SHOAL_SCALAR)
  target_compile_definitions(shoal_flags INTERFACE HWY_COMPILE_ONLY_SCALAR)
endif()
if(SHOAL_SANITIZE)
  target_compile_options(shoal_flags INTERFACE -fsanitize=${SHOAL_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
  target_link_options(shoal_flags INTERFACE -fsanitize=${SHOAL_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # g++ 12 takes members of std::regex, and counters of inlined loops, for uninitialised when the sanitizers are on.
    target_compile_options(shoal_flags INTERFACE -Wno-maybe-uninitialized)
  endif()
  # Fewer instruction sets: with sanitizers a kernel takes minutes to compile for each. (Fuzz targets say which.)
  if(SHOAL_SANITIZE STREQUAL "thread")
    target_compile_definitions(shoal_flags INTERFACE "HWY_DISABLED_TARGETS=(HWY_AVX3_DL | HWY_AVX3 | HWY_SSE4 | HWY_SSSE3)")
  elseif(NOT SHOAL_FUZZ)
    target_compile_definitions(shoal_flags INTERFACE "HWY_DISABLED_TARGETS=(HWY_AVX3_DL | HWY_SSE4 | HWY_SSSE3)")
  endif()
endif()

# shoal_floor(name sources...): the static library of one floor of the house.
function(shoal_floor name)
  add_library(shoal_${name} STATIC ${ARGN})
  target_link_libraries(shoal_${name} PUBLIC shoal_flags)
endfunction()
