# Toolchain file: Cortex-M without an operating system, static libraries only. MARGAY_CPU is the value of GCC's option
# -mcpu, by default cortex-m4.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(MARGAY_CPU cortex-m4 CACHE STRING "The processor, as GCC calls it")
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES MARGAY_CPU)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_C_FLAGS_INIT "-mcpu=${MARGAY_CPU} -mthumb -ffunction-sections -fdata-sections")
set(CMAKE_CXX_FLAGS_INIT "${CMAKE_C_FLAGS_INIT} -Wno-psabi")
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
