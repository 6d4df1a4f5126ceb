# Runs PROGRAM with its corpus and with a bounded number of inputs derived from the corpus. The inputs are the same each time: the
# run shows whether a change broke something. To search for new faults, run PROGRAM without `-runs`, with another seed. New inputs
# are written to a scratch folder. An input that fails is stored beside the program: add it to the corpus together with the fix.
if(NOT EXISTS ${PROGRAM})
  message("SKIPPED: not built, as there is no clang++-16")
  return()
endif()
set(found ${PROGRAM}.found)
file(REMOVE_RECURSE ${found})
file(MAKE_DIRECTORY ${found})
# Files are longer than messages.
set(most 1600)
if(PROGRAM MATCHES "fuzz_(esi|eni)$")
  set(most 12000)
endif()
# Each input takes seconds of virtual time on a segment.
set(runs 20000)
if(PROGRAM MATCHES "fuzz_(attach|gateway)$")
  set(runs 2000)
endif()
execute_process(COMMAND ${PROGRAM} -runs=${runs} -seed=1 -max_len=${most} -timeout=10 -artifact_prefix=${PROGRAM}.failed-
                        -print_final_stats=1 ${found} ${CORPUS} COMMAND_ERROR_IS_FATAL ANY)
