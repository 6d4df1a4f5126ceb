# Programs for ecrt.h, in C as their users write them, each a test of its own: it ends with 0 when it has seen what it expects.
# The segment is simulated and runs in real time, because the programs do.
if(NOT TARGET margay_ecrt OR MARGAY_SANITIZE)
  return()
endif()
set(folder ${CMAKE_CURRENT_LIST_DIR})

# margay_ecrt_program(NAME SOURCE …): with the warnings that users switch on.
function(margay_ecrt_program name)
  list(TRANSFORM ARGN PREPEND ${folder}/)
  add_executable(${name} ${ARGN})
  target_link_libraries(${name} PRIVATE margay_ecrt)
  target_compile_options(${name} PRIVATE -Wall -Wextra -pedantic -Werror -O1)
  set_target_properties(${name} PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF CXX_STANDARD 11)
endfunction()

# margay_ecrt_test(NAME PROGRAM SEGMENT [ARGUMENT …])
function(margay_ecrt_test name program segment)
  add_test(NAME compat/ecrt/${name} COMMAND ${program} ${ARGN})
  set_tests_properties(compat/ecrt/${name} PROPERTIES TIMEOUT 120 ENVIRONMENT MARGAY_MASTER0=${segment})
endfunction()

foreach(program user information)
  margay_ecrt_program(ecrt_${program} ${program}.c)
endforeach()
margay_ecrt_test(user ecrt_user sim:demo)
margay_ecrt_test(information ecrt_information sim:demo 5 22)
margay_ecrt_test(information_of_drives ecrt_information sim:drive,pulse_axis 2 18)
