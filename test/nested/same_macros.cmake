# cmake -DCOMPILER=name -DONE=flags -DOTHER=flags [-DBUILD=folder] -P same_macros.cmake: fails when the compiler defines
# other macros with the flags OTHER than with ONE. With the same macros and the same warning flags, the front end
# reports the same warnings.
#
# BUILD is the folder of a build with the flags ONE. With BUILD, __OPTIMIZE_SIZE__ may differ. Then no file that this
# build has read may use the macro, except two headers of the C library: <math.h> uses it in C only, and <features.h>
# selects by it whether other system headers have bodies of inline functions. A compiler reports no warnings for system
# headers.
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
if(BUILD)
  string(REPLACE "#define __OPTIMIZE_SIZE__ 1\n" "" macros_OTHER "${macros_OTHER}")
endif()
if(NOT macros_ONE STREQUAL macros_OTHER)
  message(FATAL_ERROR "${ONE} and ${OTHER} define different macros")
endif()
if(NOT BUILD)
  return()
endif()

# The compiler has written the names of the files that it read, one list for each source.
file(GLOB_RECURSE lists ${BUILD}/*.o.d)
set(read)
foreach(list IN LISTS lists)
  file(READ ${list} text)
  string(REGEX REPLACE "[\\\n ]+" ";" words "${text}")
  list(FILTER words INCLUDE REGEX "^/")
  list(APPEND read ${words})
  list(REMOVE_DUPLICATES read)
endforeach()
list(LENGTH read count)
if(NOT read MATCHES "/src/context\\.cpp" OR count LESS 500)
  message(FATAL_ERROR "only ${count} names of files are known of ${BUILD}")
endif()
foreach(name IN LISTS read)
  if(EXISTS ${name} AND NOT name MATCHES "^/usr/include/(features|math)\\.h$")  # lists of earlier builds stay in the folder
    file(STRINGS ${name} found REGEX "__OPTIMIZE_SIZE__")
    if(found)
      message(FATAL_ERROR "${name} depends on __OPTIMIZE_SIZE__: ${found}")
    endif()
  endif()
endforeach()
message("${count} files do not depend on __OPTIMIZE_SIZE__")
