# Bare-metal Cortex-M7 with the single-precision FPU that STM32F746 and F767 share (Debian: gcc-arm-none-eabi).
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_C_FLAGS_INIT "-mcpu=cortex-m7 -mthumb -mfpu=fpv5-sp-d16 -mfloat-abi=hard -mfp16-format=ieee -ffunction-sections -fdata-sections")
set(EITSKIN_M7 ON) # kernels_m7.c too
