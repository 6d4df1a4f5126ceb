# cmake -DCOMPILER=name -DONE=flags -DOTHER=flags -P same_macros.cmake: fails when the compiler defines other macros with the
# flags OTHER than with ONE. With the same macros and the same flags for warnings its front end reports the same warnings.
cmake_minimum_required(VERSION 3.25)
find_program(compiler ${COMPILER})
if(NOT compiler)
  message("SKIPPED: there is no ${COMPILER}")
  return()
endif()
foreach(flags ONE OTHER)
  separate_arguments(${flags} UNIX_COMMAND "${${flags}}")
  execute_process(COMMAND ${compiler} -std=c++20 ${${flags}} -dM -E -x c++ /dev/null OUTPUT_VARIABLE macros_${flags}
                  COMMAND_ERROR_IS_FATAL ANY)
endforeach()
if(NOT macros_ONE MATCHES "__OPTIMIZE__" OR NOT macros_ONE MATCHES "NDEBUG")
  message(FATAL_ERROR "these are not the macros of an optimised build without assertions:\n${macros_ONE}")
endif()
if(NOT macros_ONE STREQUAL macros_OTHER)
  message(FATAL_ERROR "${ONE} and ${OTHER} define different macros")
endif()
