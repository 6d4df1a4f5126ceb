# find_package(ethercat): the target EtherLab::ethercat, and the variables of hand-written find modules.
include(${CMAKE_CURRENT_LIST_DIR}/margay-ecrt-targets.cmake)
if(NOT TARGET EtherLab::ethercat)
  add_library(EtherLab::ethercat INTERFACE IMPORTED)
  target_link_libraries(EtherLab::ethercat INTERFACE margay::margay_ecrt)
endif()
get_target_property(ethercat_INCLUDE_DIRS margay::margay_ecrt INTERFACE_INCLUDE_DIRECTORIES)
set(ethercat_LIBRARIES EtherLab::ethercat)
