include(${CMAKE_CURRENT_LIST_DIR}/../ethercat/ethercat-config-version.cmake)
