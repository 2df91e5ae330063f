# oneTBB and Highway as static libraries from Debian 12's source packages, for a liblumicut.so that needs neither on the
# machine it runs on (LUMICUT_PORTABLE; docs/decisions/0022-a-zip-that-needs-nothing.md). The targets have the names that
# find_package gives: TBB::tbb, hwy::hwy.
include(FetchContent)
find_package(Threads REQUIRED)

# Where apt gets Debian 12's packages here, then Debian itself.
set(mirrors "")
find_program(APT_GET apt-get)
if(APT_GET)
  execute_process(COMMAND ${APT_GET} indextargets --format "$(REPO_URI)" "Identifier: Packages" "Codename: bookworm"
    OUTPUT_VARIABLE mirrors ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
  string(REPLACE "\n" ";" mirrors "${mirrors}")
endif()
list(APPEND mirrors http://deb.debian.org/debian/)
list(REMOVE_DUPLICATES mirrors)

# lumicut_source(NAME FILE SHA256): unpacks the file of Debian's pool into ${NAME_SOURCE_DIR}, which is set.
function(lumicut_source name file sha256)
  list(TRANSFORM mirrors APPEND "pool/main/${file}" OUTPUT_VARIABLE urls)
  FetchContent_Declare(${name} URL ${urls} URL_HASH SHA256=${sha256} DOWNLOAD_EXTRACT_TIMESTAMP OFF
    SOURCE_SUBDIR none)  # their own CMake files are not wanted
  FetchContent_MakeAvailable(${name})
  set(${name}_SOURCE_DIR ${${name}_SOURCE_DIR} PARENT_SCOPE)  # licences are read there
endfunction()
lumicut_source(onetbb o/onetbb/onetbb_2021.8.0.orig.tar.xz
  7e9111b8bb59c8800bf6d0b06afe7b0891937443d2dae1ee1101c8e2ede6a7ef)
lumicut_source(highway h/highway/highway_1.0.3.orig.tar.gz
  566fc77315878473d9a6bd815f7de78c73734acdcb745c3dde8579560ac5440e)

# Nothing is loaded at run time: no allocator, no topology library, no profiler of the host's.
file(GLOB tbb_sources ${onetbb_SOURCE_DIR}/src/tbb/*.cpp)
add_library(tbb STATIC ${tbb_sources})
add_library(TBB::tbb ALIAS tbb)
target_include_directories(tbb SYSTEM PUBLIC ${onetbb_SOURCE_DIR}/include)
target_compile_definitions(tbb PRIVATE __TBB_BUILD __TBB_DYNAMIC_LOAD_ENABLED=0
  __TBB_WEAK_SYMBOLS_PRESENT=0 __TBB_SOURCE_DIRECTLY_INCLUDED=1)
target_compile_options(tbb PRIVATE -w -mrtm -mwaitpkg -flifetime-dse=1)
target_link_libraries(tbb PUBLIC Threads::Threads)

set(hwy ${highway_SOURCE_DIR}/hwy)
add_library(hwy STATIC ${hwy}/aligned_allocator.cc ${hwy}/per_target.cc ${hwy}/targets.cc)
add_library(hwy::hwy ALIAS hwy)
target_include_directories(hwy SYSTEM PUBLIC ${highway_SOURCE_DIR})
target_compile_definitions(hwy PUBLIC HWY_STATIC_DEFINE)
target_compile_options(hwy PRIVATE -w -fmerge-all-constants -fno-exceptions)
