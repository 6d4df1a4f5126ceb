# CPack: the Debian packages margay (programs, unit, completion, manual pages) and libmargay-dev (headers, archives, CMake and
# pkg-config files, and the interfaces of other masters). `cpack -G DEB` in the build folder makes both.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME margay)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "Margay developers <margay@localhost>")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
# CPack installs the files with the prefix /usr into its own folder, so that the unit contains the path of the installed
# program.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL development)
if(MARGAY_SAMPLES)
  list(APPEND CPACK_COMPONENTS_ALL programs)
endif()
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)

set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME margay)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SECTION utils)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_DEPENDS adduser)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS "graphviz, gnuplot-nox")
set(CPACK_DEBIAN_PROGRAMS_DESCRIPTION "EtherCAT master in userspace: service and tools
The service margayd runs EtherCAT segments without a kernel module, and ethercat shows and configures their slaves,
with the commands of IgH's tool. Simulated segments work without hardware.")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_CONTROL_EXTRA
    "${PROJECT_SOURCE_DIR}/src/package/debian/postinst;${PROJECT_SOURCE_DIR}/src/package/debian/prerm;${PROJECT_SOURCE_DIR}/src/package/debian/postrm")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(needed)
if(TARGET margay_pcap)
  list(APPEND needed libpcap-dev)
endif()
if(TARGET margay_files)
  list(APPEND needed libpugixml-dev)
endif()
if(TARGET margay_xdp)
  list(APPEND needed libxdp-dev libbpf-dev)
endif()
if(TARGET margay_soem1)
  list(APPEND needed libfmt-dev libtomlplusplus-dev)  # for margay_source, which a program for SOEM links
endif()
list(JOIN needed ", " needed)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libmargay-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${needed}")
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "EtherCAT master in userspace: headers and static libraries
For programs in C++20 that are an EtherCAT master or a slave, and for programs written for the interfaces of other
masters.")
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libmargay-dev RENAME copyright)
if(MARGAY_SAMPLES)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/margay RENAME copyright COMPONENT programs)
endif()
include(CPack)
