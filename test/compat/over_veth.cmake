# margay_far_test(NAME SEGMENT PROGRAM [ARGUMENT …]): a test with the program at one end of a veth pair, and
# virtual_segment with the segment at the other end. The interface of the program is ecat-m. The test is skipped without
# network namespaces. The test mainly waits.
function(margay_far_test name segment program)
  add_test(NAME ${name} COMMAND ${PROJECT_SOURCE_DIR}/test/compat/over_veth.sh $<TARGET_FILE:virtual_segment> ${segment} $<TARGET_FILE:${program}> ${ARGN})
  set_tests_properties(${name} PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 300)
  margay_waits(${name})
endfunction()
