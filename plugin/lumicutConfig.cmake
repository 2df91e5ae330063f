# find_package(lumicut) gives the target lumicut::lumicut. What the library links is its own affair.
include("${CMAKE_CURRENT_LIST_DIR}/lumicutTargets.cmake")
