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

include(${compat}/over_veth.cmake)

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
                     -I${PROJECT_SOURCE_DIR}/src/compat/soem${v}/include -I${PROJECT_SOURCE_DIR}/src/compat/soem/include
                     ${compat}/soem${v}/include.c)
  endforeach()
  foreach(standard c++11 c++14 c++17 c++20 c++23)
    add_test(NAME compat/soem${v}_headers_${standard}
             COMMAND ${CMAKE_CXX_COMPILER} -x c++ -std=${standard} -Wall -Wextra -pedantic -Werror -fsyntax-only
                     -I${PROJECT_SOURCE_DIR}/src/compat/soem${v}/include -I${PROJECT_SOURCE_DIR}/src/compat/soem/include
                     ${compat}/soem${v}/include.c)
  endforeach()
endforeach()

# Programs on simulated segments. Those with one thread run in virtual time.
foreach(program simple tools firmware eeprom lost closing ring edges masters)
  margay_compat(compat_soem1_${program} margay_soem1 ${program}.c)
endforeach()
margay_compat(compat_soem2_simple margay_soem2 simple_ng.c)
margay_compat(compat_soem2_machine margay_soem2 soem2/machine.c)
add_test(NAME compat/soem2_machine COMMAND compat_soem2_machine sim:drive,drive,pulse_axis,digital_in_8,digital_out_8)
set(virtual)
foreach(program edges masters)
  margay_compat(compat_soem2_${program} margay_soem2 ${program}.c)
  target_compile_definitions(compat_soem2_${program} PRIVATE SOEM2)
endforeach()
foreach(v 1 2)
  foreach(segment drives demo)
    add_test(NAME compat/soem${v}_edges_${segment} COMMAND compat_soem${v}_edges sim:${segment})
    list(APPEND virtual compat/soem${v}_edges_${segment})
  endforeach()
  # Asks the library which commands are sent.
  add_executable(compat_soem${v}_block_lrw ${compat}/block_lrw.cpp)
  target_link_libraries(compat_soem${v}_block_lrw PRIVATE margay_soem${v} margay_soem_session margay_flags)
  target_include_directories(compat_soem${v}_block_lrw PRIVATE ${PROJECT_SOURCE_DIR}/src)
  add_test(NAME compat/soem${v}_block_lrw COMMAND compat_soem${v}_block_lrw)
  list(APPEND virtual compat/soem${v}_block_lrw)
  add_test(NAME compat/soem${v}_masters COMMAND compat_soem${v}_masters sim:drives sim:demo sim:servodrives)
  set_tests_properties(compat/soem${v}_masters PROPERTIES TIMEOUT 300)
endforeach()
foreach(case "drives 1" "servodrives 2" "demo 4" "bootloader 2")
  separate_arguments(arguments UNIX_COMMAND "${case}")
  string(REPLACE " " "_" label "${case}")
  add_test(NAME compat/soem1_tools_${label} COMMAND compat_soem1_tools sim:${arguments})
  list(APPEND virtual compat/soem1_tools_${label})
endforeach()
add_test(NAME compat/soem1_firmware COMMAND compat_soem1_firmware sim:bootloader 2 0x4d47)
list(APPEND virtual compat/soem1_firmware)
add_test(NAME compat/soem1_eeprom COMMAND compat_soem1_eeprom sim:digital_in_8,digital_in_8 2)
list(APPEND virtual compat/soem1_eeprom)
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
# At a cable, with the segment in another process.
if(TARGET virtual_segment)
  foreach(segment demo drives dc_bench)
    margay_far_test(compat/soem1_simple_${segment}_over_veth ${segment} compat_soem1_simple ecat-m 200)
  endforeach()
  margay_far_test(compat/soem1_tools_over_veth servodrives compat_soem1_tools ecat-m 2)
  # An EEPROM is busy for some milliseconds: a cable is faster.
  margay_far_test(compat/soem1_eeprom_over_veth digital_in_8,digital_in_8 compat_soem1_eeprom ecat-m 2)
  margay_far_test(compat/soem1_firmware_over_veth bootloader compat_soem1_firmware ecat-m 2 0x4d47)
  margay_far_test(compat/soem2_machine_over_veth drive,drive,pulse_axis,digital_in_8,digital_out_8 compat_soem2_machine ecat-m ecat-m)
  margay_far_test(compat/soem2_simple_over_veth drives compat_soem2_simple ecat-m 200 1)
endif()

# The places of the data of slaves, compared with those of the original masters.
margay_compat(compat_soem1_layouts margay_soem1 layouts.c)
margay_compat(compat_soem2_layouts margay_soem2 layouts.c)
target_compile_definitions(compat_soem2_layouts PRIVATE SOEM2)
# 200 slaves and the entry for all are more than SOEM 2.0 has room for by default: EC_MAXSLAVE is 200. The original made the layout of this
# segment in a build with more. The library does the same in a build with more.
margay_soem(margay_soem2_large soem2)
target_compile_definitions(margay_soem2_large PUBLIC MARGAY_SOEM2_MAXSLAVE=256)
margay_compat(compat_soem2_layouts_large margay_soem2_large layouts.c)
target_compile_definitions(compat_soem2_layouts_large PRIVATE SOEM2)
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
      if(v EQUAL 1 AND mode STREQUAL "packed")
        continue()  # SOEM 1.4 has no packed mode
      endif()
      set(program compat_soem${v}_layouts)
      if(v EQUAL 2 AND segment STREQUAL "mixed200")
        set(program compat_soem2_layouts_large)
      endif()
      set(test compat/soem${v}_layout_${segment}_${mode})
      add_test(NAME ${test} COMMAND ${program} ${source} ${mode} ${golden}/${segment}.${version}.${mode}.txt)
      set_tests_properties(${test} PROPERTIES SKIP_RETURN_CODE 77)
      list(APPEND virtual ${test})
    endforeach()
  endforeach()
endforeach()
target_compile_definitions(compat_soem2_block_lrw PRIVATE SOEM2)
set_tests_properties(${virtual} PROPERTIES ENVIRONMENT MARGAY_SIM_TIME=virtual)

# The table of the README names every function.
add_test(NAME compat/readme
         COMMAND ${CMAKE_COMMAND} -DREADME=${PROJECT_SOURCE_DIR}/src/compat/README.md
                 "-DROWS=${compat}/rows_functions.inc;${compat}/soem1/rows.c;${compat}/soem2/rows.c" -P ${compat}/readme.cmake)
