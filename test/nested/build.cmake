# Configures SOURCE in FOLDER with DEFINE and builds TARGETS (empty: all targets). NEEDS are programs, and files whose
# names begin with "/": the script skips when one is missing. With MARGAY_WERROR=ON in DEFINE, the script fails when a
# target lacks -Werror.
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

unset(ENV{CMAKE_GENERATOR})  # Makefiles start one compiler at a time, and list the targets in the form below
set(settings)
foreach(definition IN LISTS DEFINE)
  list(APPEND settings "-D${definition}")
endforeach()
execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${FOLDER} ${settings} COMMAND_ERROR_IS_FATAL ANY)
if("${DEFINE}" MATCHES "MARGAY_WERROR=ON")
  file(GLOB_RECURSE COMMANDS ${FOLDER}/*/flags.make)
  include(${CMAKE_CURRENT_LIST_DIR}/warnings_are_errors.cmake)
endif()

set(only)
if(TARGETS)
  # A part without sources has no target.
  execute_process(COMMAND ${CMAKE_COMMAND} --build ${FOLDER} --target help OUTPUT_VARIABLE known COMMAND_ERROR_IS_FATAL ANY)
  foreach(target IN LISTS TARGETS)
    if(known MATCHES "\\.\\.\\. ${target}\n")
      list(APPEND only --target ${target})
    endif()
  endforeach()
endif()
execute_process(COMMAND ${CMAKE_COMMAND} --build ${FOLDER} ${only} COMMAND_ERROR_IS_FATAL ANY)
