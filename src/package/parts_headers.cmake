# cmake -DSOURCE=top -DFOLDER=where -P parts_headers.cmake
#
# Copies the headers of the parts to FOLDER/margay/parts. In the copies `#include "wire/esc.hpp"` is `#include
# <margay/parts/wire/esc.hpp>`. A copy is written only when it changes, so that no source is compiled without need.
# Copies of removed headers are removed.
cmake_minimum_required(VERSION 3.25)
set(parts ${FOLDER}/margay/parts)
set(wanted)
foreach(root osal oshw src/util src/wire src/subdevice src/sim src/analyse)
  file(GLOB_RECURSE headers RELATIVE ${SOURCE} ${SOURCE}/${root}/*.hpp)
  foreach(header IN LISTS headers)
    file(READ ${SOURCE}/${header} text)
    string(REGEX REPLACE "(#include )\"([^\"]*)\"" "\\1<margay/parts/\\2>" text "${text}")
    string(REGEX REPLACE "^src/" "" name ${header})
    list(APPEND wanted ${name})
    set(old)
    if(EXISTS ${parts}/${name})
      file(READ ${parts}/${name} old)
    endif()
    if(NOT text STREQUAL old)
      file(WRITE ${parts}/${name} "${text}")
    endif()
  endforeach()
endforeach()

file(GLOB_RECURSE there RELATIVE ${parts} ${parts}/*.hpp)
foreach(name IN LISTS there)
  if(NOT name IN_LIST wanted)
    file(REMOVE ${parts}/${name})
  endif()
endforeach()
