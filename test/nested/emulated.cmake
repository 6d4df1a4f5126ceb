# Executes PROGRAM with EMULATOR, and fails unless the program ends with 0. Skips when the emulator or the program is
# missing.
find_program(emulator ${EMULATOR})
if(NOT emulator)
  message("SKIPPED: there is no ${EMULATOR}")
  return()
endif()
if(NOT EXISTS ${PROGRAM})
  message("SKIPPED: there is no compiler for ${PROGRAM}")
  return()
endif()
execute_process(COMMAND ${emulator} ${PROGRAM} COMMAND_ERROR_IS_FATAL ANY)
