# Runs PROGRAM over its corpus and a bounded number of inputs made from it. The same inputs each time. What is found
# newly goes to a scratch folder; an input that fails stays beside the program: add it to the corpus with the repair.
if(NOT EXISTS ${PROGRAM})
  message("SKIPPED: not built, as there is no clang++-16")
  return()
endif()
set(found ${PROGRAM}.found)
file(REMOVE_RECURSE ${found})
file(MAKE_DIRECTORY ${found})
execute_process(COMMAND ${PROGRAM} -runs=50000 -seed=1 -max_len=1600 -timeout=10 -artifact_prefix=${PROGRAM}.failed-
                        -print_final_stats=1 ${found} ${CORPUS} COMMAND_ERROR_IS_FATAL ANY)
