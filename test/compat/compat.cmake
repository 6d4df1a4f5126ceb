# Programs in C that use the interfaces of other masters, as their users write them.
set(MARGAY_INTERFACES_DIR "" CACHE PATH "Folder with golden-layouts/ of other masters; tests that need it are skipped without")
if(NOT MARGAY_INTERFACES_DIR AND EXISTS ${shared}/interfaces)
  set(MARGAY_INTERFACES_DIR ${shared}/interfaces)
endif()
set(compat ${CMAKE_CURRENT_LIST_DIR})

# margay_compat(NAME LIBRARY SOURCE…): one program, which must compile without a warning of a strict C compiler.
function(margay_compat name library)
  list(TRANSFORM ARGN PREPEND ${compat}/ OUTPUT_VARIABLE sources)
  add_executable(${name} ${sources})
  target_link_libraries(${name} PRIVATE ${library})
  target_include_directories(${name} PRIVATE ${compat})
  target_compile_options(${name} PRIVATE -Wall -Wextra)
endfunction()

# Every constant, field and function of the tables.
foreach(v 1 2)
  margay_compat(compat_soem${v}_rows margay_soem${v} soem${v}/rows.c rows_main.c)
  set_target_properties(compat_soem${v}_rows PROPERTIES C_STANDARD 99 C_EXTENSIONS ON)
  add_test(NAME compat/soem${v}_rows COMMAND compat_soem${v}_rows)
endforeach()

# The headers in all standards, without a warning.
foreach(v 1 2)
  foreach(standard c99 c11 c17)
    add_test(NAME compat/soem${v}_headers_${standard}
             COMMAND ${CMAKE_C_COMPILER} -std=${standard} -Wall -Wextra -pedantic -Werror -fsyntax-only
                     -I${PROJECT_SOURCE_DIR}/src/compat/soem${v}/include ${compat}/soem${v}/include.c)
  endforeach()
  foreach(standard c++11 c++14 c++17 c++20 c++23)
    add_test(NAME compat/soem${v}_headers_${standard}
             COMMAND ${CMAKE_CXX_COMPILER} -x c++ -std=${standard} -Wall -Wextra -pedantic -Werror -fsyntax-only
                     -I${PROJECT_SOURCE_DIR}/src/compat/soem${v}/include ${compat}/soem${v}/include.c)
  endforeach()
endforeach()

# Programs on simulated segments. Those with one thread run in virtual time.
foreach(program simple tools firmware lost closing ring)
  margay_compat(compat_soem1_${program} margay_soem1 ${program}.c)
endforeach()
margay_compat(compat_soem2_simple margay_soem2 simple_ng.c)
set(virtual)
foreach(case "drives 1" "servodrives 2" "demo 4" "bootloader 2")
  separate_arguments(arguments UNIX_COMMAND "${case}")
  string(REPLACE " " "_" label "${case}")
  add_test(NAME compat/soem1_tools_${label} COMMAND compat_soem1_tools sim:${arguments})
  list(APPEND virtual compat/soem1_tools_${label})
endforeach()
add_test(NAME compat/soem1_firmware COMMAND compat_soem1_firmware sim:bootloader 2 0x4d47)
list(APPEND virtual compat/soem1_firmware)
add_test(NAME compat/soem1_lost_drives COMMAND compat_soem1_lost sim:drives 2)
list(APPEND virtual compat/soem1_lost_drives)
add_test(NAME compat/soem1_closing COMMAND compat_soem1_closing sim:drives 25)
set_tests_properties(compat/soem1_closing PROPERTIES TIMEOUT 300)
add_test(NAME compat/soem1_ring COMMAND compat_soem1_ring sim:${compat}/ring.toml sim:drives)
list(APPEND virtual compat/soem1_ring)
foreach(segment demo drives dc_bench)
  add_test(NAME compat/soem1_simple_${segment} COMMAND compat_soem1_simple sim:${segment} 200)
endforeach()
add_test(NAME compat/soem2_simple_demo COMMAND compat_soem2_simple sim:demo 200 0)
add_test(NAME compat/soem2_simple_drives COMMAND compat_soem2_simple sim:drives 200 1)

# The places of the data of slaves, compared with those of the original masters.
margay_compat(compat_soem1_layouts margay_soem1 layouts.c)
margay_compat(compat_soem2_layouts margay_soem2 layouts.c)
target_compile_definitions(compat_soem2_layouts PRIVATE SOEM2)
set(golden ${MARGAY_INTERFACES_DIR}/golden-layouts)
foreach(segment bits coupler dc_bench drives hot_connect mixed200 tree)
  set(source sim:${segment})
  if(segment STREQUAL "bits")
    set(source sim:${golden}/bits.toml)
  endif()
  foreach(mode plain overlapped packed)
    foreach(v 1 2)
      set(version soem1.4)
      if(v EQUAL 2)
        set(version soem2.0)
      endif()
      # SOEM 1.4 has no packed mode. 200 slaves are more than a context of SOEM 2.0 has by default.
      if((v EQUAL 1 AND mode STREQUAL "packed") OR (v EQUAL 2 AND segment STREQUAL "mixed200"))
        continue()
      endif()
      set(test compat/soem${v}_layout_${segment}_${mode})
      add_test(NAME ${test} COMMAND compat_soem${v}_layouts ${source} ${mode} ${golden}/${segment}.${version}.${mode}.txt)
      set_tests_properties(${test} PROPERTIES SKIP_RETURN_CODE 77)
      list(APPEND virtual ${test})
    endforeach()
  endforeach()
endforeach()
set_tests_properties(${virtual} PROPERTIES ENVIRONMENT MARGAY_SIM_TIME=virtual)

# The table of the README names every function.
add_test(NAME compat/readme
         COMMAND ${CMAKE_COMMAND} -DREADME=${PROJECT_SOURCE_DIR}/src/compat/README.md
                 "-DROWS=${compat}/soem1/rows.c;${compat}/soem2/rows.c" -P ${compat}/readme.cmake)
