# Installs the public headers, the headers of the parts, the archives, the CMake package and the files of pkg-config.
include(CMakePackageConfigHelpers)

install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/margay ${PROJECT_BINARY_DIR}/include/margay
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN *.hpp)
get_property(parts GLOBAL PROPERTY MARGAY_PARTS)
install(TARGETS ${parts} EXPORT margay ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
set(folder ${CMAKE_INSTALL_LIBDIR}/cmake/margay)
install(EXPORT margay NAMESPACE margay:: FILE margay-targets.cmake DESTINATION ${folder})

set(margay_components ${parts})
list(REMOVE_ITEM margay_components margay)
list(TRANSFORM margay_components REPLACE "^margay_" "")
list(SORT margay_components)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/margay-config.cmake.in ${PROJECT_BINARY_DIR}/margay-config.cmake
                              INSTALL_DESTINATION ${folder} NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/margay-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/margay-config.cmake ${PROJECT_BINARY_DIR}/margay-config-version.cmake
        DESTINATION ${folder})

# One file for each part, named like the target with a dash: margay-linux.pc. margay.pc is the master. The folders are
# given from the place of the file, so that an installation may be moved.
cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_LIBDIR BASE_DIRECTORY ${CMAKE_INSTALL_PREFIX} OUTPUT_VARIABLE margay_libdir)
cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_INCLUDEDIR BASE_DIRECTORY ${CMAKE_INSTALL_PREFIX} OUTPUT_VARIABLE margay_includedir)
set(pc_folder ${margay_libdir}/pkgconfig)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_PREFIX BASE_DIRECTORY ${pc_folder} OUTPUT_VARIABLE margay_prefix_from_pc)
cmake_path(RELATIVE_PATH margay_libdir BASE_DIRECTORY ${CMAKE_INSTALL_PREFIX})
cmake_path(RELATIVE_PATH margay_includedir BASE_DIRECTORY ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" margay_prefix_from_pc ${margay_prefix_from_pc})
set(about_margay "EtherCAT master library in userspace")
set(about_margay_wire "byte layouts of EtherCAT, shared by all parts of Margay")
set(about_margay_linux "system and AF_PACKET NIC of Linux for Margay")
set(about_margay_posix "system of POSIX clocks, poll and threads for Margay")
set(about_margay_bare "bare-metal system and LAN9118 NIC for Margay")
set(about_margay_pcap "pcap NICs and recordings for Margay")
set(about_margay_files "readers and writers of ESI and ENI files for Margay")
set(about_margay_sim "simulated EtherCAT segment of Margay")
set(about_margay_subdevice "EtherCAT slave stack of Margay")
set(about_margay_filters "NICs around a NIC and virtual time for Margay")
foreach(part IN LISTS parts)
  string(REPLACE "_" "-" pc_name ${part})
  set(pc_description "${about_${part}}")
  set(pc_libs -l${part})
  get_target_property(pc_requires ${part} MARGAY_LINK)
  if(part MATCHES "^margay_(linux|posix|bare)$" OR part STREQUAL "margay_pcap" OR part STREQUAL "margay_filters")
    set(pc_requires margay)  # such a part is no use alone, and its name then says all that a master needs
  elseif(NOT pc_requires)
    set(pc_requires "")
  endif()
  string(REPLACE "_" "-" pc_requires "${pc_requires}")
  if(part STREQUAL "margay_pcap")
    set(pc_requires "${pc_requires}, libpcap")  # the part is a static library, so that each program links libpcap itself
  endif()
  if(part STREQUAL "margay_files")
    set(pc_requires "margay, pugixml")
  endif()
  configure_file(${CMAKE_CURRENT_LIST_DIR}/margay.pc.in ${PROJECT_BINARY_DIR}/pkgconfig/${pc_name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/pkgconfig/${pc_name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endforeach()
