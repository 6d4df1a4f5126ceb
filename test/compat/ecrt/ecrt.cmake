# Programs for ecrt.h, in C as their users write them. Each program is a test, and ends with 0 when everything is as
# expected. The segment is simulated and runs in real time, because the programs run in real time.
if(NOT TARGET margay_ecrt OR MARGAY_SANITIZE)
  return()
endif()
set(folder ${CMAKE_CURRENT_LIST_DIR})

# margay_ecrt_program(NAME SOURCE …): a program, compiled with the warnings that users switch on.
function(margay_ecrt_program name)
  list(TRANSFORM ARGN PREPEND ${folder}/)
  add_executable(${name} ${ARGN})
  target_link_libraries(${name} PRIVATE margay_ecrt)
  target_include_directories(${name} PRIVATE ${folder})
  target_compile_options(${name} PRIVATE -Wall -Wextra -pedantic -Werror -O1)
  set_target_properties(${name} PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF CXX_STANDARD 11)
endfunction()

# margay_ecrt_test(NAME PROGRAM SEGMENT [ARGUMENT …]): a test with a SEGMENT runs in real time, and mainly waits.
function(margay_ecrt_test name program segment)
  add_test(NAME compat/ecrt/${name} COMMAND ${program} ${ARGN})
  set_tests_properties(compat/ecrt/${name} PROPERTIES TIMEOUT 120 ENVIRONMENT MARGAY_MASTER0=${segment})
  if(segment)
    margay_waits(compat/ecrt/${name})
  endif()
endfunction()

foreach(program user information dc two_domains requests later mail rules masters eoe request_rules machine places settings silent said again assignments comes_before pdos_in_init)
  margay_ecrt_program(ecrt_${program} ${program}.c)
endforeach()
margay_ecrt_program(ecrt_mixed mixed.cpp)
margay_ecrt_program(ecrt_information_at_start information_at_start.cpp)
margay_ecrt_program(ecrt_turns turns.cpp)
margay_ecrt_program(ecrt_configuring configuring.cpp)
find_package(Threads REQUIRED)
target_link_libraries(ecrt_information_at_start PRIVATE Threads::Threads)
target_link_libraries(ecrt_turns PRIVATE Threads::Threads)
target_link_libraries(ecrt_configuring PRIVATE Threads::Threads)
target_link_libraries(ecrt_requests PRIVATE Threads::Threads)
target_link_libraries(ecrt_masters PRIVATE Threads::Threads)

margay_ecrt_test(user ecrt_user sim:demo)
margay_ecrt_test(information ecrt_information sim:demo 5 22 8 0)
margay_ecrt_test(information_of_drives ecrt_information sim:drive,pulse_axis 2 18 2 55)
margay_ecrt_test(information_of_ring ecrt_information sim:${folder}/../ring.toml 3 42 0 165)
margay_ecrt_test(information_at_start ecrt_information_at_start sim:drive,drive,drive)
margay_ecrt_test(turns ecrt_turns sim:drive,drive,drive)
set_tests_properties(compat/ecrt/turns PROPERTIES PASS_REGULAR_EXPRESSION "position 0: SDO upload[^\n]*the cyclic thread does not.*position 2: [^\n]*the cyclic thread does not.*an end")
foreach(scene register_at_activation=0 read_at_activation=1 register_in_two_threads=2 read_in_operation=3 read_what_was_configured=4 read_what_was_written=5)
  string(REPLACE "=" ";" scene ${scene})
  list(GET scene 0 name)
  list(GET scene 1 number)
  margay_ecrt_test(${name} ecrt_configuring sim:drive,drive,drive,drive,drive,drive ${number})
endforeach()
margay_ecrt_test(assignments ecrt_assignments sim:drive)
set_tests_properties(compat/ecrt/assignments PROPERTIES FAIL_REGULAR_EXPRESSION "out of range")
margay_ecrt_test(dc ecrt_dc sim:pulse_axis,pulse_axis,drive)
margay_ecrt_test(dc_ring ecrt_dc sim:${folder}/dc_ring.toml)
margay_ecrt_test(two_domains ecrt_two_domains sim:drive,digital_in_8,digital_out_8)
margay_ecrt_test(again ecrt_again sim:${folder}/again.toml)
set_tests_properties(compat/ecrt/again PROPERTIES FAIL_REGULAR_EXPRESSION "another slave;starts again")
margay_ecrt_test(comes_before ecrt_comes_before sim:${folder}/comes_before.toml)
margay_ecrt_test(pdos_in_init ecrt_pdos_in_init sim:${folder}/pdos_in_init.toml)
set_tests_properties(compat/ecrt/pdos_in_init PROPERTIES PASS_REGULAR_EXPRESSION "position 0: [^\n]*the slave is in INIT" FAIL_REGULAR_EXPRESSION "it is configured")
margay_ecrt_test(requests ecrt_requests sim:drive,digital_in_8)
margay_ecrt_test(later ecrt_later sim:drive,drive@4s)
margay_ecrt_test(mail ecrt_mail sim:drive,soe_drive,voe_device)
margay_ecrt_test(rules ecrt_rules sim:drive,drive,pulse_axis)
margay_ecrt_test(request_rules ecrt_request_rules sim:drive,digital_in_8)
margay_ecrt_test(masters ecrt_masters sim:drive,drive)
set_property(TEST compat/ecrt/masters APPEND PROPERTY ENVIRONMENT MARGAY_MASTER1=sim:drive,digital_in_8)
margay_ecrt_test(ring ecrt_rules sim:${folder}/../ring.toml 2)
margay_ecrt_test(mixed ecrt_mixed sim:drive,digital_in_8,drive\#16,drive,drive\#99@3s)

margay_ecrt_test(machine ecrt_machine sim:digital_in_8\#7,drive,pulse_axis\#16,drive,drive\#99@6s)

# Devices that appear later, and positions that change.
foreach(scene tool equal_branches other_branches)
  margay_ecrt_test(places_${scene} ecrt_places sim:${folder}/${scene}.toml ${scene})
endforeach()
margay_ecrt_test(places_newcomer ecrt_places sim:drive,drive@2500ms newcomer)
margay_ecrt_test(settings ecrt_settings sim:${folder}/settings.toml)
margay_ecrt_test(silent ecrt_silent sim:${folder}/silent.toml)

margay_ecrt_test(said ecrt_said sim:drive,drive)
set_tests_properties(compat/ecrt/said PROPERTIES
  PASS_REGULAR_EXPRESSION "position 1: [^\n]*0x9999.*configuration 0:0: [^\n]*state 1 to state 8.*configuration 0:5: a request of.*position 5: [^\n]*missing.*0x0037.*configuration 0:0: SDO request 0x9998:02: .*SDO request 0x9000:17: .*0:0: register request, 0x0f80: its memory.*register request, 0x0f80: its memory.*everything was said"
  FAIL_REGULAR_EXPRESSION "slave [0-9];out of range;SDO request 0x9998.*SDO request 0x9998")

# The same programs over a veth pair, with the segment in another process.
include(${folder}/../over_veth.cmake)
function(margay_ecrt_far_test name program segment)
  margay_far_test(compat/ecrt/${name}_over_veth ${segment} ${program} ${ARGN})
  set_tests_properties(compat/ecrt/${name}_over_veth PROPERTIES ENVIRONMENT "MARGAY_MASTER0=ecat-m;FAR_SEGMENT=1")
endfunction()
if(TARGET virtual_segment)
  margay_ecrt_far_test(user ecrt_user demo)
  margay_ecrt_far_test(dc ecrt_dc pulse_axis,pulse_axis,drive)
  margay_ecrt_far_test(two_domains ecrt_two_domains drive,digital_in_8,digital_out_8)
  margay_ecrt_far_test(mixed ecrt_mixed drive,digital_in_8,drive\#16,drive,drive\#99@3s)
  margay_ecrt_far_test(machine ecrt_machine digital_in_8\#7,drive,pulse_axis\#16,drive,drive\#99@6s ecat-m)
  margay_ecrt_far_test(eoe ecrt_eoe eoe)
  set_property(TEST compat/ecrt/eoe_over_veth APPEND PROPERTY ENVIRONMENT "FAR_OPTIONS=--ports gw" FAR_ADDRESS=192.168.77.2/24@gw1)
endif()

# The header in every version of the languages, with types, constants and macros.
margay_ecrt_program(ecrt_header_c99 header.c)
margay_ecrt_test(header_c99 ecrt_header_c99 "")
foreach(standard 11 14 17 20 23)
  margay_ecrt_program(ecrt_header_cpp${standard} header.cpp)
  set_target_properties(ecrt_header_cpp${standard} PROPERTIES CXX_STANDARD ${standard})
  margay_ecrt_test(header_cpp${standard} ecrt_header_cpp${standard} "")
endforeach()

# The copies of process data, which the library does not export.
add_executable(ecrt_copies ${folder}/copies.cpp ${PROJECT_SOURCE_DIR}/src/compat/ecrt/copies.cpp)
target_include_directories(ecrt_copies PRIVATE ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(ecrt_copies PRIVATE margay_flags)
margay_ecrt_test(copies ecrt_copies "")

# Settings of slaves that no function of the facade reads. The program uses the objects of the facade, which the library
# does not export.
add_executable(ecrt_ip_stack ${folder}/ip_stack.cpp)
target_include_directories(ecrt_ip_stack PRIVATE ${folder} ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(ecrt_ip_stack PRIVATE margay_ecrt_facade margay_flags)
margay_ecrt_test(ip_stack ecrt_ip_stack sim:eoe_gateway,drive)
set_tests_properties(compat/ecrt/ip_stack PROPERTIES
  PASS_REGULAR_EXPRESSION "not set: position 1: [^\n]*not supported by the slave\nthe parameters are as set" FAIL_REGULAR_EXPRESSION "position 0")

add_executable(ecrt_before_activation ${folder}/before_activation.cpp)
target_include_directories(ecrt_before_activation PRIVATE ${folder} ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(ecrt_before_activation PRIVATE margay_ecrt_facade margay_flags)
margay_ecrt_test(before_activation ecrt_before_activation sim:drive,drive)
margay_ecrt_test(information_of_mute ecrt_before_activation sim:${folder}/mute.toml 1)

foreach(program pauses long_scan)
  add_executable(ecrt_${program} ${folder}/${program}.cpp)
  target_include_directories(ecrt_${program} PRIVATE ${folder} ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(ecrt_${program} PRIVATE margay_ecrt_facade margay_flags)
endforeach()
margay_ecrt_test(pauses ecrt_pauses sim:${folder}/pauses.toml)
margay_ecrt_test(long_scan ecrt_long_scan sim:drive,drive)
set_tests_properties(compat/ecrt/long_scan PROPERTIES
  PASS_REGULAR_EXPRESSION "0:0: entry 0x1234:05 is not mapped\n.*0:5: entry 0x6041:00 is not mapped as far as its PDOs are known: the slave is not there[^\n]*\n.*SyncManager 3 has no entry 0 in its PDO 0 as far as .*PDO 0x1a05 is not assigned as far as .*SyncManager 3 has PDOs whose entries are not known: [^\n]*\neverything was said"
  FAIL_REGULAR_EXPRESSION "0x6041:00 is not mapped\n")

add_executable(ecrt_words ${folder}/words.cpp)
target_include_directories(ecrt_words PRIVATE ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(ecrt_words PRIVATE margay_ecrt_facade margay_flags)
margay_ecrt_test(words ecrt_words "")

# These programs also use the objects of the facade. They open their segment themselves, in virtual time.
foreach(program flags moved late_outputs early_request after_silence starts requests_at_start far missing no_restart silent_scan)
  add_executable(ecrt_${program} ${folder}/${program}.cpp)
  target_include_directories(ecrt_${program} PRIVATE ${folder} ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR})
  target_link_libraries(ecrt_${program} PRIVATE margay_ecrt_facade margay_flags)
endforeach()
margay_ecrt_test(flags ecrt_flags "")
margay_ecrt_test(far ecrt_far "")
margay_ecrt_test(silent_scan ecrt_silent_scan "")
margay_ecrt_test(missing ecrt_missing "")
margay_ecrt_test(moved ecrt_moved "" sim:${folder}/moved.toml)
margay_ecrt_test(late_outputs ecrt_late_outputs "")
margay_ecrt_test(early_request ecrt_early_request "")
margay_ecrt_test(after_silence ecrt_after_silence "")
margay_ecrt_test(starts_beside_mute ecrt_starts "" sim:${folder}/mute.toml 4 1 1 500)
margay_ecrt_test(starts_beside_mute_by_domains ecrt_starts "" sim:${folder}/mute.toml 4 4 1 500)
margay_ecrt_test(no_restart_for_mute ecrt_no_restart "" sim:${folder}/early_mute.toml mute)
margay_ecrt_test(no_restart_for_late_mute ecrt_no_restart "" sim:${folder}/late_mute.toml late)
margay_ecrt_test(no_restart_for_late_mute_inputs ecrt_no_restart "" sim:${folder}/late_mute.toml late_inputs)
margay_ecrt_test(no_restart_for_refused ecrt_no_restart "" sim:drive,drive refused)
string(REPEAT "drive," 60 drives)
margay_ecrt_test(requests_at_start ecrt_requests_at_start "")
margay_ecrt_test(starts_of_many ecrt_starts "" sim:${drives}drive 61 1 -1 600)
margay_ecrt_test(starts_of_many_by_domains ecrt_starts "" sim:${drives}drive 61 60 -1 1800)

# Each function with its signature, and the table of the README.
margay_ecrt_program(ecrt_signatures signatures.c)
add_test(NAME compat/ecrt/readme COMMAND ${CMAKE_COMMAND} -DREADME=${PROJECT_SOURCE_DIR}/src/compat/ecrt/README.md
  -DLIBRARY=$<TARGET_FILE:margay_ecrt> -DNM=${CMAKE_NM} -DSIGNATURES=$<TARGET_FILE:ecrt_signatures> -P ${folder}/readme.cmake)

# Masters without a segment.
foreach(segment nosuch0 eth0+eth1 sim:nosuch "")
  string(MAKE_C_IDENTIFIER "refused_${segment}" name)
  margay_ecrt_test(${name} ecrt_user "${segment}")
  set_tests_properties(compat/ecrt/${name} PROPERTIES PASS_REGULAR_EXPRESSION "margay ecrt: master 0: [^\n]+")
endforeach()

# The same interface at both ends of a ring. The error must not name another program as the user of the interface.
margay_ecrt_test(refused_twice ecrt_user nosuch0+nosuch0)
set_tests_properties(compat/ecrt/refused_twice PROPERTIES
  PASS_REGULAR_EXPRESSION "margay ecrt: master 0: nosuch0.nosuch0: both ends of a ring are nosuch0" FAIL_REGULAR_EXPRESSION "another program")

# The installed package.
if(MARGAY_INSTALL)
  add_test(NAME compat/ecrt/package COMMAND ${CMAKE_COMMAND} -DBUILD=${PROJECT_BINARY_DIR} -DWORK=${CMAKE_CURRENT_BINARY_DIR}/ecrt_package
    -DPROGRAM=${folder}/information.c -P ${folder}/package.cmake)
endif()
