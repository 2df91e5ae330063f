# Settings that all targets share: compiler options, where outputs go, and functions that add libraries and tests.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_C_STANDARD 99)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_CXX_VISIBILITY_PRESET hidden)
set(CMAKE_C_VISIBILITY_PRESET hidden)
set(CMAKE_VISIBILITY_INLINES_HIDDEN ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${CCACHE})
endif()

add_library(lumicut_options INTERFACE)
# GCC 12 sees overlaps in std::string that are not there (GCC bug 105329).
target_compile_options(lumicut_options INTERFACE -Wall -Wextra -Wshadow
  $<$<OR:$<C_COMPILER_ID:GNU>,$<CXX_COMPILER_ID:GNU>>:-Wno-restrict>
  $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor -Woverloaded-virtual>)
# Highway compiles the hot loops for a portable fallback, SSE4, AVX2 and AVX-512, and picks one at run time.
set(disabled_targets HWY_SSSE3)
# With sanitizers only AVX2 remains (see the least set in the main CMakeLists.txt).
if(LUMICUT_SANITIZE)
  set(disabled_targets "(HWY_SSSE3|HWY_SSE4|HWY_AVX3)")
endif()
target_compile_definitions(lumicut_options INTERFACE "HWY_DISABLED_TARGETS=${disabled_targets}")
target_include_directories(lumicut_options INTERFACE ${PROJECT_SOURCE_DIR})
if(NOT LUMICUT_EMBREE)
  target_compile_definitions(lumicut_options INTERFACE LUMICUT_WITHOUT_EMBREE)  # tests/support/backends.h
endif()
if(LUMICUT_SANITIZE)
  # A finding of UndefinedBehaviorSanitizer ends the program: a test that goes on would pass. Its checks of null pointers
  # and of dynamic types double the compiler's time and find what ends in a crash anyway.
  set(sanitize -fsanitize=${LUMICUT_SANITIZE})
  if(LUMICUT_SANITIZE MATCHES undefined)
    list(APPEND sanitize -fno-sanitize=null,vptr -fno-sanitize-recover=all)
  endif()
  if(LUMICUT_SANITIZE STREQUAL thread)
    # Wrappers of oneTBB's calls that tell ThreadSanitizer their order.
    list(APPEND sanitize -isystem ${PROJECT_SOURCE_DIR}/tests/tsan
      -fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/tests/tsan/ignored.txt)
  endif()
  target_compile_options(lumicut_options INTERFACE ${sanitize} -fno-omit-frame-pointer)
  target_link_options(lumicut_options INTERFACE ${sanitize})
endif()

# libFuzzer's edge counts, so that one build serves the sanitized tests and the fuzz targets (tests/fuzz/). The
# numerical folders go without: their code does not depend on the form of the input, and counting takes minutes of
# compile time a file.
function(lumicut_count_edges target)
  if(LUMICUT_FUZZ AND NOT target MATCHES "accel|bsdf|clustering|integrators|lights")
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
endfunction()

# lumicut_library(NAME SOURCES... LINK libs...): one folder, one static library, linked into the plug-in.
function(lumicut_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  if(ARG_SOURCES)
    add_library(${name} STATIC ${ARG_SOURCES})
    target_link_libraries(${name} PUBLIC lumicut_options ${ARG_LINK})
    lumicut_count_edges(${name})
  else()
    add_library(${name} INTERFACE)
    target_link_libraries(${name} INTERFACE lumicut_options ${ARG_LINK})
  endif()
endfunction()

# lumicut_test(NAME SOURCES... LINK libs... [ENVIRONMENT ...]): one GoogleTest program, one CTest entry.
function(lumicut_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;LINK;ENVIRONMENT" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE lumicut_options ${ARG_LINK} GTest::gtest GTest::gtest_main)
  if(LUMICUT_SANITIZE)
    target_compile_definitions(${name} PRIVATE LUMICUT_SANITIZED)
    target_compile_options(${name} PRIVATE -O0)  # what is tested is optimised; GoogleTest's macros take the compiler long
  else()
    target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O1>)  # likewise: two thirds of the time that -O3 takes
  endif()
  add_test(NAME ${name} COMMAND ${name})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 600)
    if(LUMICUT_SANITIZE)
      set(ARG_TIMEOUT 1800)
    endif()
  endif()
  set_tests_properties(${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT}
    ENVIRONMENT "LUMICUT_SOURCE_DIR=${PROJECT_SOURCE_DIR};LUMICUT_BINARY_DIR=${PROJECT_BINARY_DIR};${ARG_ENVIRONMENT}")
endfunction()

# The tests of `name` that match `filter` once more on each lesser instruction set. For tests with SIMD code in them.
function(lumicut_test_instruction_sets name filter)
  if(LUMICUT_SANITIZE)
    return()  # their builds have one instruction set only
  endif()
  target_sources(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/instruction_set.cpp)
  target_link_libraries(${name} PRIVATE hwy::hwy)
  get_test_property(${name} ENVIRONMENT environment)
  foreach(set AVX2 SSE4 EMU128)
    add_test(NAME ${name}_${set} COMMAND ${name} "--gtest_filter=InstructionSet.*:${filter}")
    set_tests_properties(${name}_${set} PROPERTIES TIMEOUT 600
      ENVIRONMENT "${environment};LUMICUT_TEST_INSTRUCTION_SET=${set}")
  endforeach()
endfunction()

# Manual pages of the program `target` and its commands, and bash's completion, made of what `--help` says.
function(lumicut_manual target component)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  get_target_property(name ${target} OUTPUT_NAME)
  if(NOT name)
    set(name ${target})
  endif()
  set(manual ${PROJECT_BINARY_DIR}/manual/${name})
  set(script ${PROJECT_SOURCE_DIR}/tools/manual.py)
  add_custom_command(OUTPUT ${manual}/${name}.1
    COMMAND ${Python3_EXECUTABLE} ${script} $<TARGET_FILE:${target}> ${PROJECT_VERSION} ${manual}
    DEPENDS ${target} ${script} VERBATIM)
  if(NOT LUMICUT_FUZZ)
    add_custom_target(${name}_manual ALL DEPENDS ${manual}/${name}.1)
  endif()
  install(DIRECTORY ${manual}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT ${component})
  install(FILES ${manual}/completion/${name} DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT ${component})
endfunction()
