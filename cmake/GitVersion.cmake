# cmake -DSOURCE=<tree> -DOUTPUT=<header> -P GitVersion.cmake: writes what `git describe` says, only when it changed.
execute_process(COMMAND git -C ${SOURCE} describe --always --tags --dirty
  OUTPUT_VARIABLE description OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed OR NOT description)
  set(description unknown)
endif()
set(text "#pragma once\n#define LUMICUT_GIT_VERSION \"${description}\"\n")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} before)
endif()
if(NOT "${before}" STREQUAL "${text}")
  file(WRITE ${OUTPUT} "${text}")
endif()
