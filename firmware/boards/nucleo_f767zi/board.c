/* The NUCLEO-F767ZI as the application sees it. */
#include "drivers/ad9833.h"
#include "drivers/adg1206.h"
#include "nucleo.h"

/* Codes at 12 bits and 3.3 V. Models are for 1 mA: half of it and a gain of 3 give what 1 mA and
 * 1.5 would (docs/guide/hardware.md). The owner's settings may have another source and gain. */
enum {
    FULL_SCALE_CODE = 4095,
    REFERENCE_UV = 3300000,
    SOURCE_UA = 500,
    GAIN_PPM = 3000000,
    FRONT_END_GAIN_PPM = 1500000,
    SOURCE_UA_RMS = 350,
    /* 40 ms at the fastest scan: the blocking capacitors of generator and source */
    SETTLE_FRAMES = 2,
    BLINKS = 16
};

/* Without the 8 MHz clock every frequency would be wrong. The red light blinks for a few seconds,
 * timed by the 16 MHz oscillator; all pins to multiplexers and generator float. */
__attribute__((noreturn)) static void no_clock(void)
{
    RCC_AHB1ENR |= RCC_AHB1ENR_GPIOBEN;
    (void)RCC_AHB1ENR;
    nucleo_pin(GPIOB_BASE, 14, PIN_OUTPUT, 0, 0, 0);
    for (uint32_t left = BLINKS; left > 0; --left) {
        GPIO_BSRR(GPIOB_BASE) = left % 2u == 0 ? 1u << 14 : 1u << 30;
        for (volatile uint32_t k = 0; k < 500000; ++k)
            ;
    }
    nucleo_restart(NULL); /* the clock may be back */
}

static fw_ad9833 ad9833;
static fw_adg1206 adg1206;

int main(void)
{
    if (!nucleo_clock_start())
        no_clock();
    nucleo_cache_start();
    nucleo_system_start();
    nucleo_multiplexers_start();
    nucleo_generator_start();
    nucleo_capture_start();
    nucleo_sense_start();
    nucleo_link_start();
    const fw_board board = {
        .name = "nucleo_f767zi",
        .serial = nucleo_serial(),
        .f_cpu_hz = NUCLEO_SYSCLK_HZ,
        .stack_bytes =
            (uint32_t)((uint8_t *)stack_top - (uint8_t *)stack_bottom) - NUCLEO_STACK_GUARD_BYTES,
        .source_ua_rms = SOURCE_UA_RMS,
        .source_ua = SOURCE_UA,
        .gain_ppm = GAIN_PPM,
        .settle_frames = SETTLE_FRAMES,
        .generator =
            fw_ad9833_generator(&ad9833, (fw_spi){&nucleo_generator_ops, NULL}, NUCLEO_MCLK_HZ),
        .multiplexers = fw_adg1206_multiplexers(
            &adg1206, (fw_lines){&nucleo_multiplexers_ops, NULL}, nucleo_electrodes()),
        .capture = {&nucleo_capture_ops, NULL, FULL_SCALE_CODE, REFERENCE_UV, FRONT_END_GAIN_PPM},
        .link = {&nucleo_link_ops, NULL},
        .store = {&nucleo_store_ops, NULL, NUCLEO_BANK_BYTES, NUCLEO_PAGE_BYTES},
        .system = &nucleo_system_ops,
        .last_reset = nucleo_last_reset(),
        .sense = {nucleo_measure_ua_rms, NULL},
        .image = image_start,
        .image_bytes = (size_t)(image_end - image_start),
        .workspace = workspace_start,
        .workspace_bytes = (size_t)(workspace_end - workspace_start),
    };
    return fw_run(&board);
}
