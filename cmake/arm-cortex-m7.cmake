# Bare-metal Cortex-M7 with the single-precision FPU that STM32F746 and F767 share (Debian: gcc-arm-none-eabi).
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(EITSKIN_CPU "-mcpu=cortex-m7 -mfpu=fpv5-sp-d16" CACHE STRING "The processor; a Cortex-M4F: -mcpu=cortex-m4 -mfpu=fpv4-sp-d16")
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES EITSKIN_CPU)
set(CMAKE_C_FLAGS_INIT "${EITSKIN_CPU} -mthumb -mfloat-abi=hard -mfp16-format=ieee -ffunction-sections -fdata-sections")
set(EITSKIN_M7 ON) # csrc/src/kernels/m7.c, too
