# cmake -DCOMMANDS=file [-DSTRICT=bool] -P warnings_are_errors.cmake: COMMANDS is a compile_commands.json. Fails when it names no
# source of ours, or compiles one of them without -Werror. Skips when STRICT is false. All sources of ours have -Wconversion.
if(DEFINED STRICT AND NOT STRICT)
  message("SKIPPED: this build has no MARGAY_WERROR=ON")
  return()
endif()
file(STRINGS ${COMMANDS} ours REGEX "-Wconversion")
file(STRINGS ${COMMANDS} strict REGEX "-Wconversion.* -Werror ")
list(LENGTH ours all)
list(LENGTH strict errors)
if(all EQUAL 0 OR NOT errors EQUAL all)
  message(FATAL_ERROR "${COMMANDS}: warnings are errors in ${errors} of ${all} compilations")
endif()
