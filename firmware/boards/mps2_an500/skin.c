/* The analog side: the state of the AD9833, the electrodes that the multiplexers connect, and the
 * voltages from "skin.bin":
 *
 *   u32 rows, u32 frames, u32 frame_us; rows x 4 u8 electrodes I+, I-, V+, V-; frames x rows f32
 * volts, amplitude
 *
 * Each frame lasts frame_us, counted from the start of the scan; the last one stays. Electrodes
 * that do not form a row read 0 V. */
#include "boards/parts/drive_monitor.h"
#include "mps2.h"

#include <math.h>
#include <string.h>

enum { MAX_BYTES = 1024 * 1024 };
#define PHASE_BITS 28
#define LATE_RAD   0.7f /* phase of the voltages behind the generator: cables, filters, skin */

static _Alignas(4) uint8_t file_bytes[MAX_BYTES];
static struct {
    uint32_t rows, frames, frame_us;
    const uint8_t *electrodes;
    const float *volts;
} skin;
static ad9833_model generator;
static uint32_t levels_now, running_since_us;

void mps2_skin_start(void)
{
    const size_t size = mps2_load("skin.bin", file_bytes, sizeof file_bytes);
    if (size == 0)
        return;
    uint32_t head[3];
    memcpy(head, file_bytes, sizeof head);
    const size_t cells = (size_t)head[0] * head[1];
    if (size < sizeof head || size != sizeof head + (size_t)head[0] * 4u + cells * sizeof(float) ||
        cells == 0)
        mps2_fail("skin.bin: length");
    skin.rows = head[0];
    skin.frames = head[1];
    skin.frame_us = head[2];
    skin.electrodes = file_bytes + sizeof head;
    skin.volts = (const float *)(const void *)(skin.electrodes + (size_t)head[0] * 4u);
}

static fw_status write_words(void *ctx, const uint16_t *words, size_t count)
{
    for (size_t k = 0; k < count; ++k) {
        if (ad9833_model_write(&generator, words[k]))
            running_since_us = mps2_time_us(ctx);
    }
    return (generator.control & AD9833_MODEL_FSELECT) != 0 ? FW_E_BUS : FW_OK;
}

static fw_status write_lines(void *ctx, uint32_t mask, uint32_t levels)
{
    (void)ctx;
    levels_now = (levels_now & ~mask) | (levels & mask);
    return FW_OK;
}

static void wait_ns(void *ctx, uint32_t ns)
{
    (void)ctx;
    for (uint32_t k = 0; k < (ns + 14u) / 15u; ++k) /* three instructions of 5 ns, at least */
        __asm volatile("nop");
}

static float connected_volts(uint32_t scanning_us)
{
    uint8_t four[4];
    if (drive_monitor_joined(levels_now, four) != 4)
        return 0;
    const uint32_t passed = skin.frame_us == 0 ? 0 : scanning_us / skin.frame_us;
    const float *const frame =
        skin.volts + (size_t)(passed < skin.frames ? passed : skin.frames - 1u) * skin.rows;
    for (uint32_t row = 0; row < skin.rows; ++row)
        if (memcmp(skin.electrodes + (size_t)row * 4u, four, sizeof four) == 0)
            return frame[row];
    return 0;
}

void mps2_skin_burst(uint16_t *codes, uint32_t samples, uint32_t sample_rate_hz, uint32_t start_us,
                     uint32_t scanning_us)
{
    const bool untouched = !ad9833_model_runs(&generator) || skin.rows == 0;
    const float volts =
        untouched ? 0 : connected_volts(scanning_us) * ((float)MPS2_GAIN_PPM * 1e-6f);
    const float steps =
        volts * ((float)(MPS2_FULL_SCALE_CODE + 1) / ((float)MPS2_REFERENCE_UV * 1e-6f));
    const uint32_t a_us = generator.tuning * (MPS2_MCLK_HZ / 1000000u),
                   begin = a_us * (start_us - running_since_us);
    for (uint32_t k = 0; k < samples; ++k) {
        /* sample k is taken k + 1/2 sample periods after the slot's start */
        const uint32_t phase =
            begin + (uint32_t)((uint64_t)a_us * (2u * k + 1u) * 500000u / sample_rate_hz);
        const float turn = (float)(phase & ((1u << PHASE_BITS) - 1u)) / (float)(1u << PHASE_BITS);
        const long code = lrintf((float)((MPS2_FULL_SCALE_CODE + 1) / 2) +
                                 steps * sinf(turn * 6.283185307f - LATE_RAD));
        codes[k] = (uint16_t)(code < 0                      ? 0
                              : code > MPS2_FULL_SCALE_CODE ? MPS2_FULL_SCALE_CODE
                                                            : code);
    }
}

const fw_spi_ops mps2_generator_ops = {write_words};
const fw_lines_ops mps2_multiplexers_ops = {write_lines, wait_ns};
