/* MPU regions, and both caches on (PM0253 4.2 and 4.8). */
#include "nucleo.h"

/* 16 KB each, lines of 32 bytes: 128 sets of 4 ways of data. */
enum { LINE_BYTES = 32, SETS = 128, WAYS = 4 };

/* RASR: execute never, access, type, subregions left out, size, enabled (PM0253 4.2.6). */
#define XN            (1u << 28)
#define NO_ACCESS     (0u << 24)
#define READ_WRITE    (3u << 24)
#define READ_ONLY     (6u << 24)
#define WRITE_THROUGH (2u << 16)  /* TEX 0, C 1, B 0: what is stored reaches the flash interface */
#define WRITE_BACK    (11u << 16) /* TEX 1, C 1, B 1: allocates on reads and writes */
#define UNCACHED      (8u << 16)  /* TEX 1, C 0, B 0 */
#define DEVICE        (5u << 16)  /* TEX 0, shareable, C 0, B 1 */
#define LEFT_OUT(subregions) ((subregions) << 8)
#define SIZE_LOG2(bits)      ((((bits) - 1u) << 1) | 1u)

static void region(uint32_t number, uint32_t base, uint32_t attributes)
{
    MPU_RNR = number;
    MPU_RBAR = base;
    MPU_RASR = attributes;
}

void nucleo_cache_start(void)
{
    /* Later regions win. The first closes 0x60000000 to 0xDFFFFFFF, where nothing is connected: the
     * core may read ahead from ordinary memory, and would wait for ever (AN4839 4). */
    region(0, 0x00000000u, XN | NO_ACCESS | LEFT_OUT(0x87u) | SIZE_LOG2(32u));
    region(1, 0x00000000u, READ_ONLY | UNCACHED | SIZE_LOG2(14u));       /* ITCM */
    region(2, 0x08000000u, READ_WRITE | WRITE_THROUGH | SIZE_LOG2(21u)); /* flash */
    region(3, 0x20000000u, XN | READ_WRITE | UNCACHED | SIZE_LOG2(17u)); /* DTCM */
    /* SRAM1 and 2: after its first 128 KB */
    region(4, 0x20000000u, XN | READ_WRITE | WRITE_BACK | LEFT_OUT(0x03u) | SIZE_LOG2(19u));
    region(5, 0x40000000u, XN | READ_WRITE | DEVICE | SIZE_LOG2(29u)); /* peripherals */
    /* NUCLEO_STACK_GUARD_BYTES */
    region(6, (uint32_t)stack_bottom, XN | NO_ACCESS | SIZE_LOG2(8u));
    /* the first 2 KB of ITCM, where null pointers lead */
    region(7, 0x00000000u, XN | NO_ACCESS | SIZE_LOG2(11u));
    MPU_CTRL = MPU_CTRL_ENABLE | MPU_CTRL_PRIVDEFENA;
    DSB();
    ISB();

    SCB_ICIALLU = 0;
    DSB();
    ISB();
    SCB_CCR |= SCB_CCR_IC;
    DSB();
    ISB();

    SCB_CSSELR = 0; /* the data cache */
    DSB();
    for (uint32_t set = 0; set < SETS; ++set)
        for (uint32_t way = 0; way < WAYS; ++way)
            SCB_DCISW = (set << 5) | (way << 30);
    DSB();
    SCB_CCR |= SCB_CCR_DC;
    DSB();
    ISB();
}

void nucleo_cache_forget(const void *start, size_t size)
{
    const uint32_t first = (uint32_t)start & ~(uint32_t)(LINE_BYTES - 1),
                   end = (uint32_t)start + size;
    DSB();
    for (uint32_t line = first; line < end; line += LINE_BYTES)
        SCB_DCIMVAC = line;
    DSB();
    ISB();
}
