# Executes some seeds of PROGRAM, which is the storm with sanitizers. Fails when a sanitizer reports an error, or when
# the program does not reach its end.
execute_process(COMMAND ${PROGRAM} --seeds 40 --no-shrink --keep-going OUTPUT_VARIABLE words ERROR_VARIABLE words RESULT_VARIABLE ended)
if(words MATCHES "AddressSanitizer|runtime error|Sanitizer:")
  message(FATAL_ERROR "${words}")
endif()
if(NOT ended MATCHES "^[01]$")
  message(FATAL_ERROR "it ended with ${ended}: ${words}")
endif()
