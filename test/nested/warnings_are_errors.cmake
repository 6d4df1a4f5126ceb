# cmake -DCOMMANDS=files [-DSTRICT=bool] -P warnings_are_errors.cmake: COMMANDS are files with the flags of one
# compilation or one target in each line: compile_commands.json, or all files flags.make. Fails when the files have no
# source of Margay, or when a source of Margay lacks -Werror. Skips when STRICT is false. The flag -Wconversion marks
# the sources of Margay.
if(DEFINED STRICT AND NOT STRICT)
  message("SKIPPED: this build has no MARGAY_WERROR=ON")
  return()
endif()
set(all 0)
set(errors 0)
foreach(file IN LISTS COMMANDS)
  file(STRINGS ${file} ours REGEX "-Wconversion")
  file(STRINGS ${file} strict REGEX "-Wconversion.* -Werror ")
  list(LENGTH ours here)
  math(EXPR all "${all} + ${here}")
  list(LENGTH strict here)
  math(EXPR errors "${errors} + ${here}")
endforeach()
if(all EQUAL 0 OR NOT errors EQUAL all)
  message(FATAL_ERROR "warnings are errors in ${errors} of ${all} compilations or targets: ${COMMANDS}")
endif()
message("warnings are errors in ${all} compilations or targets")
