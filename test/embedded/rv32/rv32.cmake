# Toolchain file: RISC-V with 32 bits and the extensions M, A and C, without an operating system. Debian has the
# compiler and picolibc for this processor, but no C++ headers. So the headers of the ARM compiler of the same version
# are used. Headers bring no code that was compiled for ARM into the program.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR riscv32)
set(CMAKE_CXX_COMPILER riscv64-unknown-elf-g++)
file(GLOB headers /usr/include/newlib/c++/12.*)
set(CMAKE_CXX_FLAGS_INIT "-march=rv32imac -mabi=ilp32 --specs=picolibc.specs -ffunction-sections -fdata-sections \
-isystem ${headers} -isystem ${headers}/arm-none-eabi/thumb/v7-m/nofp")
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
