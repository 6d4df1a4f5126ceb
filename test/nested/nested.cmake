# Tests that build the project in another way: installed and used by another project, with the ARM compiler, with clang,
# with clang for fuzzing. Each test has a build folder below build/nested. The folder is kept, so that only changed
# files are built again.

# margay_nested(NAME SOURCE folder [NEEDS program_or_/file …] [DEFINE VAR=value …] [TARGETS target …] [FIXTURE name] [COST seconds]
#               [FOLDER name] [AFTER fixture])
# A test with COST begins before the others, so that the run does not wait for it at the end. FOLDER: the build folder,
# if several tests share it. AFTER: the fixture of the test that uses this folder first. Tests with the same FOLDER
# never run at the same time.
function(margay_nested name)
  cmake_parse_arguments(NESTED "" "SOURCE;FIXTURE;COST;FOLDER;AFTER" "NEEDS;DEFINE;TARGETS" ${ARGN})
  string(REPLACE "/" "_" folder ${name})
  if(NESTED_FOLDER)
    set(folder ${NESTED_FOLDER})
  endif()
  add_test(NAME ${name} COMMAND ${CMAKE_COMMAND} "-DSOURCE=${NESTED_SOURCE}" "-DFOLDER=${PROJECT_BINARY_DIR}/nested/${folder}"
           "-DNEEDS=${NESTED_NEEDS}" "-DDEFINE=${NESTED_DEFINE}" "-DTARGETS=${NESTED_TARGETS}"
           -P ${CMAKE_CURRENT_SOURCE_DIR}/nested/build.cmake)
  set_tests_properties(${name} PROPERTIES SKIP_REGULAR_EXPRESSION "SKIPPED" TIMEOUT 1800)
  if(NESTED_FOLDER)
    set_tests_properties(${name} PROPERTIES RESOURCE_LOCK ${NESTED_FOLDER})
  endif()
  if(NESTED_COST)
    set_tests_properties(${name} PROPERTIES COST ${NESTED_COST})
  endif()
  if(NESTED_FIXTURE)
    set_tests_properties(${name} PROPERTIES FIXTURES_SETUP ${NESTED_FIXTURE})
  endif()
  if(NESTED_AFTER)
    set_tests_properties(${name} PROPERTIES FIXTURES_REQUIRED ${NESTED_AFTER})
  endif()
endfunction()

# margay_emulated(NAME program EMULATOR name FIXTURE name): a program for another processor, executed by QEMU's
# user-mode emulation.
function(margay_emulated name program)
  cmake_parse_arguments(EMULATED "" "EMULATOR;FIXTURE" "" ${ARGN})
  add_test(NAME ${name} COMMAND ${CMAKE_COMMAND} -DPROGRAM=${program} -DEMULATOR=${EMULATED_EMULATOR}
           -P ${CMAKE_CURRENT_SOURCE_DIR}/nested/emulated.cmake)
  set_tests_properties(${name} PROPERTIES SKIP_REGULAR_EXPRESSION "SKIPPED: " TIMEOUT 600 LABELS build_types
                                          FIXTURES_REQUIRED ${EMULATED_FIXTURE})
endfunction()

set(parts_only MARGAY_TESTS=OFF MARGAY_SAMPLES=OFF)

# Another project that uses the installed package.
add_test(NAME install/install COMMAND ${CMAKE_COMMAND} --install ${PROJECT_BINARY_DIR} --prefix ${PROJECT_BINARY_DIR}/nested/prefix)
set_tests_properties(install/install PROPERTIES FIXTURES_SETUP prefix)
margay_nested(install/consumer_builds SOURCE ${CMAKE_CURRENT_SOURCE_DIR}/install FIXTURE consumer
              DEFINE CMAKE_PREFIX_PATH=${PROJECT_BINARY_DIR}/nested/prefix)
set_tests_properties(install/consumer_builds PROPERTIES FIXTURES_REQUIRED prefix)
add_test(NAME install/consumer_runs COMMAND ${PROJECT_BINARY_DIR}/nested/install_consumer_builds/consumer)
set_tests_properties(install/consumer_runs PROPERTIES FIXTURES_REQUIRED consumer)
# The pieces of README.md that need no real interface. With a wrong change of the owner thread the program would not
# end.
foreach(program readme_pieces readme_threads)
  add_test(NAME install/consumer_${program}_runs
           COMMAND ${PROJECT_BINARY_DIR}/nested/install_consumer_builds/consumer_${program})
  set_tests_properties(install/consumer_${program}_runs PROPERTIES FIXTURES_REQUIRED consumer TIMEOUT 60)
endforeach()

add_test(NAME install/consumer_for_linux_runs COMMAND ${PROJECT_BINARY_DIR}/nested/install_consumer_builds/consumer_linux)
set_tests_properties(install/consumer_for_linux_runs PROPERTIES FIXTURES_REQUIRED consumer)

if(TARGET margay_pcap)
  add_test(NAME install/consumer_of_pcap_runs COMMAND ${PROJECT_BINARY_DIR}/nested/install_consumer_builds/consumer_pcap)
  set_tests_properties(install/consumer_of_pcap_runs PROPERTIES FIXTURES_REQUIRED consumer)
endif()

if(TARGET margay_files)
  add_test(NAME install/consumer_of_files_runs COMMAND ${PROJECT_BINARY_DIR}/nested/install_consumer_builds/consumer_files)
  set_tests_properties(install/consumer_of_files_runs PROPERTIES FIXTURES_REQUIRED consumer)
endif()
if(TARGET margay_xdp)
  add_test(NAME install/consumer_of_xdp_runs COMMAND ${PROJECT_BINARY_DIR}/nested/install_consumer_builds/consumer_xdp)
  set_tests_properties(install/consumer_of_xdp_runs PROPERTIES FIXTURES_REQUIRED consumer)
endif()

add_test(NAME install/consumer_port_runs COMMAND ${PROJECT_BINARY_DIR}/nested/install_consumer_builds/consumer_port)
set_tests_properties(install/consumer_port_runs PROPERTIES FIXTURES_REQUIRED consumer TIMEOUT 60)

# A copy of the installation in another place.
foreach(check pkg_config component programs)
  add_test(NAME install/moved_${check}
           COMMAND ${CMAKE_COMMAND} -DCHECK=${check} -DPREFIX=${PROJECT_BINARY_DIR}/nested/prefix -DVERSION=${PROJECT_VERSION}
                   -DFOLDER=${PROJECT_BINARY_DIR}/nested/moved_${check} -DSOURCE=${CMAKE_CURRENT_SOURCE_DIR}/install
                   -P ${CMAKE_CURRENT_SOURCE_DIR}/install/moved.cmake)
  set_tests_properties(install/moved_${check} PROPERTIES FIXTURES_REQUIRED prefix SKIP_REGULAR_EXPRESSION "SKIPPED")
endforeach()

# The unit of the installed service, checked by the tools of systemd.
if(MARGAY_SAMPLES)
  add_test(NAME install/unit COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/install/unit.sh ${PROJECT_BINARY_DIR}/nested/prefix
           ${PROJECT_BINARY_DIR}/nested/unit)
  set_tests_properties(install/unit PROPERTIES FIXTURES_REQUIRED prefix SKIP_REGULAR_EXPRESSION "SKIPPED")
endif()

# The Debian packages.
foreach(check make contents dpkg service program)
  add_test(NAME install/debian_${check}
           COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/install/debian.sh ${check} ${PROJECT_BINARY_DIR}
                   ${PROJECT_BINARY_DIR}/nested/debian ${CMAKE_CURRENT_SOURCE_DIR}/install)
  set_tests_properties(install/debian_${check} PROPERTIES FIXTURES_REQUIRED debian SKIP_REGULAR_EXPRESSION "SKIPPED" TIMEOUT 600)
endforeach()
# The packages where systemd is process 1: with the files of this machine, and with a bare Debian.
foreach(root systemd bare)
  set(files /)
  if(root STREQUAL "bare")
    set(files "${MARGAY_DEBIAN_ROOT}")
  endif()
  add_test(NAME install/debian_${root}
           COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/install/systemd.sh ${PROJECT_BINARY_DIR}/nested/debian/packages
                   ${PROJECT_BINARY_DIR}/nested/debian_${root} "${files}")
  set_tests_properties(install/debian_${root} PROPERTIES FIXTURES_REQUIRED debian SKIP_REGULAR_EXPRESSION "SKIPPED" TIMEOUT 600)
endforeach()
# install/debian_make follows install/install, because both write the unit into the build folder.
set_tests_properties(install/debian_make PROPERTIES FIXTURES_SETUP debian FIXTURES_REQUIRED prefix)

# Programs in C for the interfaces of other masters, linked by the C compiler.
if(TARGET margay_soem1 AND TARGET margay_ecrt)
  add_test(NAME install/compat COMMAND ${CMAKE_COMMAND} -DPREFIX=${PROJECT_BINARY_DIR}/nested/prefix
           -DWORK=${PROJECT_BINARY_DIR}/nested/compat -DPROGRAMS=${CMAKE_CURRENT_SOURCE_DIR}/compat -DCC=${CMAKE_C_COMPILER}
           -P ${CMAKE_CURRENT_SOURCE_DIR}/compat/package.cmake)
  set_tests_properties(install/compat PROPERTIES FIXTURES_REQUIRED prefix TIMEOUT 300)
endif()

# Another project that uses the sources by add_subdirectory(). The build folder is also the folder of
# build_types/gcc_Debug.
set(gcc_Debug SOURCE ${CMAKE_CURRENT_SOURCE_DIR}/install FOLDER install_subdirectory_builds
    DEFINE MARGAY_TREE=${PROJECT_SOURCE_DIR} MARGAY_UNITY=ON MARGAY_PCH=ON MARGAY_WERROR=ON MARGAY_PCAP=ON
           MARGAY_BUILD_ONCE=${MARGAY_BUILD_ONCE} CMAKE_BUILD_TYPE=Debug CMAKE_CXX_FLAGS_DEBUG=-g0)
margay_nested(install/subdirectory_builds ${gcc_Debug} FIXTURE subdirectory COST 100 TARGETS consumer_linux consumer_readme consumer_port)

# An option without the options that it needs is an error. CMake does not ignore such an option silently.
add_test(NAME install/compat_needs COMMAND ${CMAKE_COMMAND} -S ${PROJECT_SOURCE_DIR} -B ${PROJECT_BINARY_DIR}/nested/compat_needs
         -DMARGAY_TESTS=OFF -DMARGAY_SAMPLES=OFF -DMARGAY_PCAP=OFF -DMARGAY_COMPAT=ON)
set_tests_properties(install/compat_needs PROPERTIES PASS_REGULAR_EXPRESSION "MARGAY_COMPAT needs MARGAY_LINUX, MARGAY_PCAP")
# A value that an option does not know is an error, too.
add_test(NAME install/sanitize_values COMMAND ${CMAKE_COMMAND} -S ${PROJECT_SOURCE_DIR}
         -B ${PROJECT_BINARY_DIR}/nested/sanitize_values -DMARGAY_TESTS=OFF -DMARGAY_SAMPLES=OFF -DMARGAY_SANITIZE=memory)
set_tests_properties(install/sanitize_values PROPERTIES PASS_REGULAR_EXPRESSION "MARGAY_SANITIZE must be one of OFF, address, ON, thread")
add_test(NAME install/unity_values COMMAND ${CMAKE_COMMAND} -S ${PROJECT_SOURCE_DIR}
         -B ${PROJECT_BINARY_DIR}/nested/unity_values -DMARGAY_TESTS=OFF -DMARGAY_SAMPLES=OFF -DMARGAY_UNITY=nonsense)
set_tests_properties(install/unity_values PROPERTIES PASS_REGULAR_EXPRESSION "MARGAY_UNITY must be one of OFF, tests, ON")

# For an embedded system: the parts, the programs for a board of QEMU, which test/qemu executes, and a program for each
# feature of the master. All three tests use the same archives.
set(board SOURCE ${CMAKE_CURRENT_SOURCE_DIR}/embedded/sizes NEEDS arm-none-eabi-g++ FOLDER embedded_arm_builds COST 300
    DEFINE MARGAY_TREE=${PROJECT_SOURCE_DIR} MARGAY_FREERTOS_DIR=${MARGAY_FREERTOS_DIR} MARGAY_WERROR=ON MARGAY_PCH=ON
           CMAKE_BUILD_TYPE=MinSizeRel CMAKE_TOOLCHAIN_FILE=${CMAKE_CURRENT_SOURCE_DIR}/embedded/arm-none-eabi.cmake)
margay_nested(embedded/arm_builds ${board} FIXTURE arm_archives TARGETS margay_wire margay margay_subdevice)
margay_nested(embedded/mps2_builds ${board} FIXTURE mps2_images AFTER arm_archives
              TARGETS master count_cycle check_port master_freertos check_port_freertos sdo)
margay_nested(embedded/sizes_builds ${board} FIXTURE size_programs AFTER arm_archives)

# The program `master` for other processors. test/qemu executes the program for ARMv6-M, because a Cortex-M4 also
# executes this code. The Cortex-M0+ and RISC-V with 32 bits lack operations that osal/bare/read_modify_write.cpp
# provides.
set(master SOURCE ${PROJECT_SOURCE_DIR}/samples/mps2_an386 NEEDS arm-none-eabi-g++ TARGETS master COST 60
    DEFINE MARGAY_TREE=${PROJECT_SOURCE_DIR} MARGAY_WERROR=ON MARGAY_PCH=ON MARGAY_UNITY=ON CMAKE_BUILD_TYPE=MinSizeRel
           MARGAY_BUILD_ONCE=${MARGAY_BUILD_ONCE}
           CMAKE_TOOLCHAIN_FILE=${CMAKE_CURRENT_SOURCE_DIR}/embedded/arm-none-eabi.cmake)
margay_nested(embedded/cortex_m0plus_builds ${master} MARGAY_CPU=cortex-m0plus FIXTURE mps2_images)
margay_nested(embedded/cortex_m7_builds ${master} MARGAY_CPU=cortex-m7)
set_tests_properties(embedded/cortex_m7_builds PROPERTIES LABELS build_types)
set(rv32 ${CMAKE_CURRENT_SOURCE_DIR}/embedded/rv32)
margay_nested(embedded/rv32_builds SOURCE ${rv32} FIXTURE rv32_programs COST 60
              NEEDS riscv64-unknown-elf-g++ arm-none-eabi-g++ /usr/lib/picolibc/riscv64-unknown-elf/picolibc.specs
              DEFINE MARGAY_TREE=${PROJECT_SOURCE_DIR} MARGAY_WERROR=ON MARGAY_PCH=ON MARGAY_UNITY=ON CMAKE_BUILD_TYPE=MinSizeRel
                     MARGAY_BUILD_ONCE=${MARGAY_BUILD_ONCE} CMAKE_TOOLCHAIN_FILE=${rv32}/rv32.cmake)
set_tests_properties(embedded/rv32_builds PROPERTIES LABELS build_types)
margay_emulated(embedded/rv32_read_modify_write ${PROJECT_BINARY_DIR}/nested/embedded_rv32_builds/read_modify_write
                EMULATOR qemu-riscv32-static FIXTURE rv32_programs)

# The unit tests of the layouts, the engine and the master with a simulated segment, on a big-endian processor.
margay_nested(big_endian/builds SOURCE ${CMAKE_CURRENT_SOURCE_DIR}/big_endian FIXTURE big_endian_programs COST 300
              NEEDS s390x-linux-gnu-g++ qemu-s390x-static /usr/src/googletest/googletest/src/gtest-all.cc
              DEFINE MARGAY_TREE=${PROJECT_SOURCE_DIR} CMAKE_CXX_COMPILER=s390x-linux-gnu-g++ MARGAY_BUILD_ONCE=${MARGAY_BUILD_ONCE}
                     MARGAY_CAPTURES_DIR=${MARGAY_CAPTURES_DIR} MARGAY_SII_DIR=${MARGAY_SII_DIR})
set_tests_properties(big_endian/builds PROPERTIES LABELS build_types)
foreach(suite wire engine segment)
  margay_emulated(big_endian/${suite} ${PROJECT_BINARY_DIR}/nested/big_endian_builds/test_${suite}
                  EMULATOR qemu-s390x-static FIXTURE big_endian_programs)
endforeach()

# The memory that each feature of the master needs on a microcontroller.
add_test(NAME embedded/sizes COMMAND ${CMAKE_COMMAND} "-DFOLDER=${PROJECT_BINARY_DIR}/nested/embedded_arm_builds"
         -P ${CMAKE_CURRENT_SOURCE_DIR}/embedded/sizes/table.cmake)
set_tests_properties(embedded/sizes PROPERTIES FIXTURES_REQUIRED size_programs SKIP_REGULAR_EXPRESSION "SKIPPED")

# The memory that a device with CoE and FoE needs on a microcontroller.
add_test(NAME embedded/footprint
         COMMAND ${CMAKE_COMMAND} "-DSOURCE=${PROJECT_SOURCE_DIR}" "-DSAMPLE=${PROJECT_SOURCE_DIR}/samples/subdevice_lan9252.cpp"
                 "-DFOLDER=${PROJECT_BINARY_DIR}/nested/embedded_arm_builds/board/margay" -P ${CMAKE_CURRENT_SOURCE_DIR}/nested/footprint.cmake)
set_tests_properties(embedded/footprint PROPERTIES FIXTURES_REQUIRED arm_archives SKIP_REGULAR_EXPRESSION "SKIPPED")

# The text of each feature of the slave stack, compared with the table in src/subdevice/README.md.
add_test(NAME embedded/footprint_table
         COMMAND ${CMAKE_COMMAND} "-DREADME=${PROJECT_SOURCE_DIR}/src/subdevice/README.md"
                 "-DARCHIVE=${PROJECT_BINARY_DIR}/nested/embedded_arm_builds/board/margay/libmargay_subdevice.a"
                 -P ${CMAKE_CURRENT_SOURCE_DIR}/nested/footprint_table.cmake)
set_tests_properties(embedded/footprint_table PROPERTIES FIXTURES_REQUIRED arm_archives SKIP_REGULAR_EXPRESSION "SKIPPED")

# The build with clang. In a complete run, clang compiles the sanitized build, and clang/builds is a test of that build
# (see test/CMakeLists.txt).
option(MARGAY_NESTED_CLANG "A test builds all but the tests with clang" ON)
if(MARGAY_NESTED_CLANG)
  margay_nested(clang/builds SOURCE ${PROJECT_SOURCE_DIR} NEEDS clang++-16 COST 400
                DEFINE CMAKE_CXX_COMPILER=clang++-16 MARGAY_WERROR=ON MARGAY_TESTS=OFF CMAKE_BUILD_TYPE=Debug MARGAY_UNITY=ON
                       CMAKE_CXX_FLAGS_DEBUG=-g0 MARGAY_BUILD_ONCE=${MARGAY_BUILD_ONCE})
  set_tests_properties(clang/builds PROPERTIES LABELS build_types)
endif()

# The parts in each build type by both compilers, with warnings as errors. Two builds have no separate folder: GCC's
# RelWithDebInfo is the build of this project, and clang's Debug is clang/builds. Debug information takes time and
# causes no warning, so it is left out. GCC reports different warnings at each level of optimisation, so GCC compiles
# each type completely. The warnings of clang come from its front end: Debug is compiled completely, Release by the
# front end alone. For the front end, RelWithDebInfo and MinSizeRel are the same as Release, and tests check this:
# RelWithDebInfo has the same macros, and MinSizeRel has one additional macro, which no source and no header uses.
# clang's Release is the only build without precompiled headers. Precompiled headers hide a missing include, and another
# project that adds Margay as a subdirectory does not precompile headers.
set(flags_of_clang_Release CMAKE_PROJECT_margay_INCLUDE=${CMAKE_CURRENT_SOURCE_DIR}/nested/front_end.cmake MARGAY_PCH=OFF)
set(gcc g++)
set(clang clang++-16)
set(families gcc clang)
foreach(version 13 14)  # newer compilers, where the system has them
  find_program(MARGAY_GCC_${version} g++-${version})
  if(MARGAY_GCC_${version})
    set(gcc_${version} g++-${version})
    list(APPEND families gcc_${version})
  endif()
endforeach()
foreach(type Release RelWithDebInfo MinSizeRel Debug)
  foreach(family IN LISTS families)
    if("${family} ${type}" STREQUAL "gcc Debug")
      margay_nested(build_types/gcc_Debug ${gcc_Debug} AFTER subdirectory COST 100)
    elseif("${family} ${type}" MATCHES "^clang (RelWithDebInfo|MinSizeRel)$")
      set(other "-DOTHER=-O2 -g -DNDEBUG")
      if(type STREQUAL "MinSizeRel")
        set(other "-DOTHER=-Os -DNDEBUG" -DBUILD=${PROJECT_BINARY_DIR}/nested/build_types_clang_Release)
      endif()
      add_test(NAME build_types/clang_${type} COMMAND ${CMAKE_COMMAND} -DCOMPILER=${clang} "-DONE=-O3 -DNDEBUG" ${other}
               -P ${CMAKE_CURRENT_SOURCE_DIR}/nested/same_macros.cmake)
      set_tests_properties(build_types/clang_${type} PROPERTIES SKIP_REGULAR_EXPRESSION "SKIPPED" FIXTURES_REQUIRED clang_release)
    elseif("${family} ${type}" STREQUAL "gcc RelWithDebInfo")
      add_test(NAME build_types/gcc_RelWithDebInfo COMMAND ${CMAKE_COMMAND} -DCOMMANDS=${PROJECT_BINARY_DIR}/compile_commands.json
               -DSTRICT=${MARGAY_WERROR} -P ${CMAKE_CURRENT_SOURCE_DIR}/nested/warnings_are_errors.cmake)
      set_tests_properties(build_types/gcc_RelWithDebInfo PROPERTIES SKIP_REGULAR_EXPRESSION "SKIPPED")
    elseif(NOT "${family} ${type}" STREQUAL "clang Debug")
      margay_nested(build_types/${family}_${type} SOURCE ${PROJECT_SOURCE_DIR} NEEDS ${${family}} COST 350
                    DEFINE CMAKE_CXX_COMPILER=${${family}} ${parts_only} CMAKE_BUILD_TYPE=${type} MARGAY_UNITY=ON MARGAY_INSTALL=OFF
                           MARGAY_WERROR=ON MARGAY_BUILD_ONCE=${MARGAY_BUILD_ONCE}
                           ${flags_of_${family}_${type}})
    endif()
    if("${family} ${type}" STREQUAL "clang Release")
      set_tests_properties(build_types/clang_Release PROPERTIES FIXTURES_SETUP clang_release)
    endif()
    if(TEST build_types/${family}_${type})
      set_tests_properties(build_types/${family}_${type} PROPERTIES LABELS build_types)
    endif()
  endforeach()
endforeach()

# Each file is one harness. The tests read the corpus and never write to it.
margay_nested(fuzz/builds SOURCE ${CMAKE_CURRENT_SOURCE_DIR}/fuzz NEEDS clang++-16 FIXTURE fuzz_programs COST 500
              DEFINE CMAKE_CXX_COMPILER=clang++-16 MARGAY_UNITY=ON MARGAY_PCH=ON)
set_tests_properties(fuzz/builds PROPERTIES LABELS sanitized)
file(GLOB harnesses CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/fuzz/*.cpp)
foreach(source IN LISTS harnesses)
  get_filename_component(harness ${source} NAME_WE)
  add_test(NAME fuzz/${harness} COMMAND ${CMAKE_COMMAND} "-DPROGRAM=${PROJECT_BINARY_DIR}/nested/fuzz_builds/fuzz_${harness}"
           "-DCORPUS=${CMAKE_CURRENT_SOURCE_DIR}/fuzz/corpus/${harness}" -P ${CMAKE_CURRENT_SOURCE_DIR}/fuzz/run.cmake)
  set_tests_properties(fuzz/${harness} PROPERTIES LABELS sanitized FIXTURES_REQUIRED fuzz_programs SKIP_REGULAR_EXPRESSION "SKIPPED" TIMEOUT 300)
endforeach()
