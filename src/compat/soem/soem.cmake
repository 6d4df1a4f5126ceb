# The interfaces SOEM 1.4 and 2.0. The sources that know the structures of a version are compiled once for each version.
set(here ${CMAKE_CURRENT_LIST_DIR})
add_library(margay_soem_session STATIC ${here}/session.cpp ${here}/inbox.cpp ${here}/priority_lock.cpp)
target_link_libraries(margay_soem_session PUBLIC margay_source margay PRIVATE $<BUILD_INTERFACE:margay_flags>)
set_target_properties(margay_soem_session PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_include_directories(margay_soem_session PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>)
margay_unity(margay_soem_session hosted)

# margay_soem(NAME FOLDER): the library of one version.
function(margay_soem name folder)
  set(margay_soem_here ${CMAKE_CURRENT_FUNCTION_LIST_DIR})
  set(shared)
  foreach(file registers frames errors open system eeprom sii states scan hooks map process_data mailbox coe dictionary files drives
               eoe clocks pdo_map)
    list(APPEND shared ${margay_soem_here}/${file}.cpp)
  endforeach()
  file(GLOB own CONFIGURE_DEPENDS ${margay_soem_here}/../${folder}/*.cpp)
  add_library(${name} STATIC ${shared} ${own})
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src/compat/${folder}/include>
                                            $<BUILD_INTERFACE:${margay_soem_here}/include>
                                            $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/margay-${folder}>
                                     PRIVATE ${PROJECT_SOURCE_DIR}/src/compat/${folder})
  target_link_libraries(${name} PRIVATE margay_soem_session $<BUILD_INTERFACE:margay_flags>)
  # Headers of C: anonymous structures, and casts of functions that C programs need.
  target_compile_options(${name} PRIVATE -Wno-pedantic -Wno-cast-function-type)
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  margay_unity(${name} hosted)
endfunction()
margay_soem(margay_soem1 soem1)
margay_soem(margay_soem2 soem2)

# EC_MAXSLAVE is the number of entries for slaves in the structures of SOEM 2.0. One entry less can be used. Programs
# must be compiled with the same number.
set(MARGAY_SOEM2_MAXSLAVE 200 CACHE STRING "EC_MAXSLAVE of the interface SOEM 2.0")
set(soem2_definitions)
if(NOT MARGAY_SOEM2_MAXSLAVE EQUAL 200)
  set(soem2_definitions MARGAY_SOEM2_MAXSLAVE=${MARGAY_SOEM2_MAXSLAVE})
  target_compile_definitions(margay_soem2 PUBLIC ${soem2_definitions})
endif()

# Programs for SOEM 1.4 include its headers also with these prefixes.
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

add_library(margay::margay_soem1 ALIAS margay_soem1)
add_library(margay::margay_soem2 ALIAS margay_soem2)

if(MARGAY_INSTALL)
  # A program in C names all archives and the C++ library, because the C compiler links it.
  set(soem_rest margay_files margay margay_sim margay_subdevice margay_filters margay_linux margay_pcap margay_wire)
  set(soem_system pcap fmt tomlplusplus pugixml stdc++ m pthread)
  if(TARGET margay_xdp)
    list(PREPEND soem_rest margay_xdp)
    list(PREPEND soem_system xdp bpf)
  endif()
  install(TARGETS margay_soem1 margay_soem2 margay_soem_session margay_source ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  foreach(v 1 2)
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/compat/soem${v}/include/ ${here}/include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/margay-soem${v}
            FILES_MATCHING PATTERN *.h)
    set(libs -lmargay_soem${v} -lmargay_soem_session -lmargay_source)
    foreach(library IN LISTS soem_rest soem_system)
      list(APPEND libs -l${library})
    endforeach()
    list(JOIN libs " " pc_libs)
    set(pc_version 1.4)
    set(pc_definitions)
    if(v EQUAL 2)
      set(pc_version 2.0)
      list(TRANSFORM soem2_definitions PREPEND " -D" OUTPUT_VARIABLE pc_definitions)
    endif()
    file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/pkgconfig/margay-soem${v}.pc @ONLY CONTENT
"prefix=\${pcfiledir}/@margay_prefix_from_pc@
includedir=\${prefix}/@margay_includedir@/margay-soem@v@
libdir=\${prefix}/@margay_libdir@

Name: margay-soem@v@
Description: interface SOEM @pc_version@ of the EtherCAT master library Margay
Version: @PROJECT_VERSION@
Cflags: -I\${includedir}@pc_definitions@
Libs: -L\${libdir} @pc_libs@
")
    install(FILES ${PROJECT_BINARY_DIR}/pkgconfig/margay-soem${v}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
  endforeach()
  install(DIRECTORY ${forwarding}/soem ${forwarding}/soem_rsl ${forwarding}/soem_vendor
          DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/margay-soem1 FILES_MATCHING PATTERN *.h)
  # find_package(soem) works as in the builds of users of the original.
  list(JOIN soem_rest " " soem_rest_list)
  list(JOIN soem_system ";" soem_system_list)
  configure_file(${here}/soem-config.cmake.in ${PROJECT_BINARY_DIR}/soem-config.cmake @ONLY)
  configure_file(${here}/soem-config-version.cmake ${PROJECT_BINARY_DIR}/soem-config-version.cmake COPYONLY)
  install(FILES ${PROJECT_BINARY_DIR}/soem-config.cmake ${PROJECT_BINARY_DIR}/soem-config-version.cmake
          DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/soem)
endif()
