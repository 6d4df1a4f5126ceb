# Links SAMPLE for a Cortex-M4 with the archives below FOLDER and prints the memory that it needs. Fails above the promised limits:
# 32 KiB of text (code and constants), 4 KiB of RAM without the buffers for messages and values. Skips without the compiler.
foreach(tool g++ size nm)
  find_program(arm_${tool} arm-none-eabi-${tool})
  if(NOT arm_${tool})
    message("SKIPPED: there is no arm-none-eabi-${tool}")
    return()
  endif()
endforeach()

set(program ${FOLDER}/footprint.elf)
execute_process(COMMAND "${arm_g++}" -std=c++20 -Os -mcpu=cortex-m4 -mthumb -fno-exceptions -fno-rtti -fno-threadsafe-statics
                        -ffunction-sections -fdata-sections -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror -Wno-psabi
                        -I${SOURCE}/include -I${SOURCE}/src -I${SOURCE}/samples
                        ${SAMPLE} ${FOLDER}/libmargay_subdevice.a ${FOLDER}/libmargay_wire.a
                        --specs=nano.specs --specs=nosys.specs -nostartfiles -Wl,--gc-sections,-e,main,-u,main -o ${program}
                ERROR_VARIABLE words RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "${words}")
endif()

execute_process(COMMAND "${arm_size}" -A -d ${program} OUTPUT_VARIABLE sections COMMAND_ERROR_IS_FATAL ANY)
function(sum result)
  set(total 0)
  foreach(section IN LISTS ARGN)
    if(sections MATCHES "\n\\${section} +([0-9]+)")
      math(EXPR total "${total} + ${CMAKE_MATCH_1}")
    endif()
  endforeach()
  set(${result} ${total} PARENT_SCOPE)
endfunction()
sum(text .text .rodata .ARM.exidx .ARM.extab .init .fini .init_array .fini_array .data)
sum(ram .data .bss)
execute_process(COMMAND "${arm_nm}" -S -C ${program} OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
if(NOT symbols MATCHES "[0-9a-f]+ ([0-9a-f]+) [bBdD] [^\n]*::buffers\n")
  message(FATAL_ERROR "the sample has no object named 'buffers'")
endif()
math(EXPR buffers "0x${CMAKE_MATCH_1}")
math(EXPR beside "${ram} - ${buffers}")
message("ESM + CoE + FoE on a Cortex-M4, -Os: ${text} octets of text, ${beside} octets of RAM beside ${buffers} of buffers")

if(text GREATER_EQUAL 32768 OR text LESS 4096)
  message(FATAL_ERROR "text: ${text} octets; less than 32768 are promised, and less than 4096 would mean that something was left out")
endif()
if(beside GREATER_EQUAL 4096)
  message(FATAL_ERROR "RAM beside the buffers: ${beside} octets; less than 4096 are promised")
endif()
if(symbols MATCHES " (__aeabi_u?ldivmod)")
  message(FATAL_ERROR "it uses a division of 64 bits: ${CMAKE_MATCH_1}")
endif()
if(symbols MATCHES " (operator new|malloc|_Znwj|__cxa_throw)")
  message(FATAL_ERROR "it uses ${CMAKE_MATCH_1}")
endif()
