# Configures SOURCE in FOLDER with DEFINE and builds TARGETS (empty: all targets). Skips when a program of NEEDS, or
# a file where the name begins with "/", is missing.
foreach(needed IN LISTS NEEDS)
  if(needed MATCHES "^/")
    set(found ${needed})
  else()
    find_program(found_${needed} ${needed})
    set(found ${found_${needed}})
  endif()
  if(NOT found OR NOT EXISTS ${found})
    message("SKIPPED: there is no ${needed}")
    return()
  endif()
endforeach()

unset(ENV{CMAKE_GENERATOR})  # Makefiles: one compiler at a time, and they list the targets in the form below
set(settings)
foreach(definition IN LISTS DEFINE)
  list(APPEND settings "-D${definition}")
endforeach()
execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${FOLDER} ${settings} COMMAND_ERROR_IS_FATAL ANY)

set(only)
if(TARGETS)
  # Parts that have no sources yet have no target.
  execute_process(COMMAND ${CMAKE_COMMAND} --build ${FOLDER} --target help OUTPUT_VARIABLE known COMMAND_ERROR_IS_FATAL ANY)
  foreach(target IN LISTS TARGETS)
    if(known MATCHES "\\.\\.\\. ${target}\n")
      list(APPEND only --target ${target})
    endif()
  endforeach()
endif()
execute_process(COMMAND ${CMAKE_COMMAND} --build ${FOLDER} ${only} COMMAND_ERROR_IS_FATAL ANY)
