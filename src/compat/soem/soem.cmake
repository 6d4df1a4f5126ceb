# The interfaces SOEM 1.4 and 2.0. The sources that know the structures of a version are compiled once for each version.
set(here ${CMAKE_CURRENT_LIST_DIR})
add_library(margay_soem_session STATIC ${here}/session.cpp ${here}/inbox.cpp ${here}/priority_lock.cpp)
target_link_libraries(margay_soem_session PUBLIC margay_source margay PRIVATE $<BUILD_INTERFACE:margay_flags>)
set_target_properties(margay_soem_session PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(margay_soem_session PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>)

# margay_soem(NAME FOLDER): the library of one version.
set(margay_soem_here ${here})
function(margay_soem name folder)
  set(shared)
  foreach(file registers frames errors open system eeprom sii states scan hooks map process_data mailbox coe dictionary files drives
               eoe clocks pdo_map)
    list(APPEND shared ${margay_soem_here}/${file}.cpp)
  endforeach()
  file(GLOB own CONFIGURE_DEPENDS ${margay_soem_here}/../${folder}/*.cpp)
  add_library(${name} STATIC ${shared} ${own})
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src/compat/${folder}/include>
                                            $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/margay-${folder}>
                                     PRIVATE ${PROJECT_SOURCE_DIR}/src/compat/${folder})
  target_link_libraries(${name} PRIVATE margay_soem_session $<BUILD_INTERFACE:margay_flags>)
  # Headers of C: anonymous structures, and casts of functions that C programs need.
  target_compile_options(${name} PRIVATE -Wno-pedantic -Wno-cast-function-type)
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
endfunction()
margay_soem(margay_soem1 soem1)
margay_soem(margay_soem2 soem2)

# Programs of SOEM 1.4 include its headers with prefixes too.
set(forwarding ${PROJECT_BINARY_DIR}/compat/soem1)
file(GLOB headers RELATIVE ${PROJECT_SOURCE_DIR}/src/compat/soem1/include ${PROJECT_SOURCE_DIR}/src/compat/soem1/include/*.h)
foreach(prefix soem soem_rsl soem_vendor)
  foreach(header IN LISTS headers)
    file(CONFIGURE OUTPUT ${forwarding}/${prefix}/${header} CONTENT "#include \"../${header}\"\n" @ONLY)
  endforeach()
endforeach()
foreach(header IN LISTS headers)
  file(CONFIGURE OUTPUT ${forwarding}/${header} CONTENT "#include \"${PROJECT_SOURCE_DIR}/src/compat/soem1/include/${header}\"\n" @ONLY)
endforeach()
target_include_directories(margay_soem1 PUBLIC $<BUILD_INTERFACE:${forwarding}>)
