/* A board without hardware: pins, converter, flash and link in memory, on its own clock.
 *
 * The skin's voltages come from a function of the electrodes that the lines select; the generator
 * is decoded from the words that were written to it; the multiplexers' output settles
 * exponentially. Bursts' interrupts come while the application waits, reads the clock or writes.
 * Faults are injected where a field says so. */
#ifndef FW_FAKE_BOARD_H
#define FW_FAKE_BOARD_H

#include "app/instrument.h"
#include "boards/parts/drive_monitor.h"
#include "drivers/ad9833.h"
#include "drivers/adg1206.h"

#include <setjmp.h>

/* The fuzzer sets its own size, because it copies a whole board before each input. */
#ifndef FAKE_BANK
#define FAKE_WIRE      (1 << 20)
#define FAKE_BANK      (128 * 1024)
#define FAKE_WORKSPACE (192 * 1024)
#define FAKE_ROWS      4096
#endif
#define FAKE_MCLK_HZ    8000000u
#define FAKE_ELECTRODES 16u

enum { FAKE_SPI_LOG = 64, FAKE_EVENTS = 256, FAKE_PAGE = 1024 /* eight records */ };

typedef enum fake_kind { FAKE_SPI, FAKE_LINES } fake_kind;

/* One write to a bus, in order. */
typedef struct fake_write {
    fake_kind kind;
    uint64_t at_ns;
    uint32_t a, b; /* the word; mask and levels */
} fake_write;

typedef struct fake_event { /* the multiplexers' output from here on */
    uint64_t at_ns;
    double amplitude, target;
} fake_event;

typedef struct fake_board {
    fw_board board;
    uint64_t now_ns;
    uint64_t clock_cost_ns; /* each reading of the clock outside interrupts takes so long */
    uint64_t write_cost_ns; /* each write to the link */

    /* buses */
    fake_write *log; /* the last log_room of `writes`; NULL: none is kept */
    uint32_t log_room, writes;
    /* spi_fails calls fail, from number spi_fail_from on */
    uint32_t spi_calls, spi_fail_from, spi_fails;
    uint32_t lines_calls, lines_fail_from, lines_fails;

    /* generator */
    fw_ad9833 ad9833;
    ad9833_model generator;
    uint64_t released_ns; /* when its phase began */
    double extra_turn;    /* phase that cables and skin add */

    /* multiplexers and skin */
    fw_adg1206 adg1206;
    drive_monitor monitor; /* has the levels of the lines */
    double (*volts)(void *user, const uint8_t electrodes[4], uint64_t at_ns);
    void *user;
    double tau_ns;
    fake_event event[FAKE_EVENTS];
    uint32_t events;
    uint8_t selected[FAKE_ROWS][4]; /* of the last bursts, in order */
    uint32_t bursts;

    /* capture */
    fw_capture_setup setup;
    void (*done)(void *user, const fw_burst *burst);
    void *done_user;
    bool capturing, stalled, in_interrupt;
    uint64_t slot_ns;      /* start of the next slot */
    uint64_t latency_ns;   /* from a burst's end to its interrupt */
    uint64_t late_once_ns; /* added to the next one's */
    uint32_t lose;         /* so many bursts from now are lost */
    double noise_codes;
    uint64_t random;
    uint16_t samples[2][FW_MAX_SAMPLES];
    fw_status configure_status;
    void (*later)(void *user); /* after the interrupt; NULL: nothing */
    void *later_user;

    /* flash: NOR */
    _Alignas(16) uint8_t bank[FW_BANKS][FAKE_BANK];
    uint8_t page[FW_PAGES - FW_BANKS][FAKE_PAGE];
    uint32_t flash_steps, cut_at; /* power is cut at this step (counted from 1; 0: never) */
    jmp_buf cut;
    fw_status erase_status, program_status;
    uint32_t erases, rewrites; /* rewrites: attempts to program a bit from 0 to 1 */

    uint32_t feeds, resets, leds;
    bool button;         /* the owner holds it */
    bool supply_missing; /* +-15 V are not there */
    uint32_t current_ua; /* that flows */
    _Alignas(16) uint8_t workspace[FAKE_WORKSPACE];

    /* link; its bytes come last, so that a copy may omit them */
    size_t to_board_size, to_board_at, to_host_size;
    bool writing;
    uint32_t nested_writes; /* that began within another */
    size_t host_room;       /* bytes that the link still takes; SIZE_MAX: any */
    bool ended;
    uint8_t to_board[FAKE_WIRE], to_host[FAKE_WIRE];
} fake_board;

/* Erased, at time start_us, with no voltage. */
void fake_init(fake_board *fake, uint32_t start_us);

/* Power up again: the clock continues, the flash stays, everything else is as after fake_init. */
void fake_restart(fake_board *fake);

/* Write a bank with a valid record, as a programmer would. */
void fake_put_model(fake_board *fake, uint32_t bank, uint32_t generation, const uint8_t *blob,
                    size_t size);

/* Let time pass; bursts that end meanwhile are reported. */
void fake_advance(fake_board *fake, uint64_t ns);

/* Let time pass to the end of the next burst, at most a millisecond. */
void fake_wait(fake_board *fake);

/* The generator's frequency by its registers; 0 while it is in reset. */
double fake_generator_hz(const fake_board *fake);

double fake_lsb_v(const fake_board *fake);

#endif
