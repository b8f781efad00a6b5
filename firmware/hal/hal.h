/* The interface of a board for the application and the drivers: small tables of functions, each
 * with its context pointer.
 *
 * A board fills one fw_board and calls fw_run. Nothing above this file knows a register; nothing
 * below it knows a frame.
 */
#ifndef FW_HAL_H
#define FW_HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum fw_status {
    FW_OK = 0,
    FW_E_ARGUMENT = -1,
    FW_E_TIMEOUT = -2, /* the peripheral did not answer */
    FW_E_BUS = -3,     /* the bus reported an error */
    FW_E_FLASH = -4,   /* erase or programming failed, or read back differently */
    FW_E_RANGE = -5    /* a setting that this board cannot do */
} fw_status;

/* ---- SPI: 16-bit words, most significant bit first, SCLK idle high, data valid on the falling
 * edge (mode 2); chip select low around each word ---- */
typedef struct fw_spi_ops {
    /* returns when the last bit was sent */
    fw_status (*write)(void *ctx, const uint16_t *words, size_t count);
} fw_spi_ops;
typedef struct fw_spi {
    const fw_spi_ops *ops;
    void *ctx;
} fw_spi;

/* ---- digital outputs that are set together ---- */
typedef struct fw_lines_ops {
    /* lines in `mask` take their bit of `levels` */
    fw_status (*write)(void *ctx, uint32_t mask, uint32_t levels);
    void (*wait_ns)(void *ctx, uint32_t ns); /* at least */
} fw_lines_ops;
typedef struct fw_lines {
    const fw_lines_ops *ops;
    void *ctx;
} fw_lines;

/* ---- the generator of the excitation, a sine. A driver fills this over the board's bus
 * (drivers/ad9833.h), or the board does it itself ---- */
typedef struct fw_tone {
    uint32_t millihz; /* rounded; 0: the generator cannot make it */
    /* advance of its phase, in 2^-64 turns per us; the demodulator follows the phase with it */
    uint64_t turn_per_us;
} fw_tone;
typedef struct fw_generator_ops {
    /* the tone nearest to this frequency that `start` would make */
    fw_tone (*nearest)(const void *ctx, uint32_t millihz);
    /* Make that tone, also if another one is on. After an error it is off, if the bus still works.
     * Errors: FW_E_RANGE (it cannot), those of the bus. */
    fw_status (*start)(void *ctx, uint32_t millihz);
    /* No current flows afterwards. Errors: those of the bus; the tone may be on then. */
    fw_status (*stop)(void *ctx);
} fw_generator_ops;
typedef struct fw_generator {
    const fw_generator_ops *ops;
    void *ctx;
} fw_generator;

/* ---- the switches between the electrodes and the instrument's I+, I-, V+ and V-. Filled by a
 * driver (drivers/adg1206.h) or by the board ---- */
#define FW_MAX_ELECTRODES 64u /* diagnostics have a bit for each */
typedef struct fw_multiplexers_ops {
    /* Connect the electrodes of I+, I-, V+ and V-: 8 bits each, I+ lowest. Each is below
     * `electrodes` of the fw_multiplexers, and the two of a pair differ. Those that were connected
     * are disconnected before. Called from the capture's interrupt, so it takes few microseconds.
     * Errors: those of the lines; all are left disconnected then, if the lines still work. */
    fw_status (*join)(void *ctx, uint32_t electrodes);
    /* Disconnect all electrodes. Errors: those of the lines. */
    fw_status (*all_off)(void *ctx);
} fw_multiplexers_ops;
typedef struct fw_multiplexers {
    const fw_multiplexers_ops *ops;
    void *ctx;
    uint32_t electrodes; /* there are, at most FW_MAX_ELECTRODES */
} fw_multiplexers;

/* ---- sampling: slots of equal length, in each a burst of samples, started by hardware at the
 * slot's start ---- */
typedef struct fw_capture_setup {
    uint32_t sample_rate_hz;
    uint32_t samples; /* per slot, at most FW_MAX_SAMPLES */
    uint32_t slot_us; /* from burst to burst; longer than the burst */
} fw_capture_setup;
#define FW_MAX_SAMPLES 1024u
#define FW_MODEL_UA    1000u /* amplitude of the current that models are made for */

typedef struct fw_burst {
    const uint16_t *samples; /* right-aligned codes; valid until the next burst ends */
    /* of its slot on the board's clock, exact: differences are multiples of slot_us */
    uint32_t start_us;
    uint32_t entered_us; /* when its interrupt looked at the clock, soon after it began */
    bool lost;           /* the converter overran or DMA failed: do not use it */
} fw_burst;

typedef struct fw_capture_ops {
    /* `done` is called from an interrupt when a slot's burst is complete. FW_E_RANGE: this board
     * cannot do these settings. */
    fw_status (*configure)(void *ctx, const fw_capture_setup *setup,
                           void (*done)(void *user, const fw_burst *burst), void *user);
    fw_status (*start)(void *ctx); /* the first slot starts at least 20 us later */
    void (*stop)(void *ctx);       /* afterwards `done` is not called */
} fw_capture_ops;
typedef struct fw_capture {
    const fw_capture_ops *ops;
    void *ctx;
    /* 4095 for 12 bits; the bias lies at half of full_scale_code + 1 */
    uint32_t full_scale_code;
    /* of the converter: full_scale_code + 1 steps (STM32 data sheets, "1 LSB ideal = VREF+ /
     * 4096") */
    uint32_t reference_uv;
    /* volts at the converter per volt that the model's current would cause between the electrodes,
     * in millionths */
    uint32_t front_end_gain_ppm;
} fw_capture;

/* ---- the link: bytes to and from the host; never blocks ---- */
typedef struct fw_link_ops {
    /* all or nothing; false: no room now */
    bool (*write)(void *ctx, const uint8_t *bytes, size_t size);
    size_t (*read)(void *ctx, uint8_t *bytes, size_t room);
    bool (*ended)(void *ctx); /* no more bytes will come: fw_run returns. NULL: never */
} fw_link_ops;
typedef struct fw_link {
    const fw_link_ops *ops;
    void *ctx;
} fw_link;

/* ---- storage: regions that are erased as a whole and read in place. The first FW_BANKS have
 * bank_bytes each and hold models; the others, up to FW_PAGES, have page_bytes each and hold the
 * owner's settings ---- */
#define FW_BANKS 2u
#define FW_PAGES 4u
typedef struct fw_store_ops {
    const uint8_t *(*bank)(void *ctx, uint32_t bank); /* 16-byte aligned, memory-mapped */
    /* to 0xFF; may take seconds; feeds the watchdog */
    fw_status (*erase)(void *ctx, uint32_t bank);
    /* multiples of 4; reads back */
    fw_status (*program)(void *ctx, uint32_t bank, uint32_t offset, const void *bytes, size_t size);
} fw_store_ops;
typedef struct fw_store {
    const fw_store_ops *ops;
    void *ctx;
    uint32_t bank_bytes;
    uint32_t page_bytes; /* 0: no settings are stored */
} fw_store;

/* ---- the current through the skin, measured over a resistor in its return path ---- */
typedef struct fw_sense {
    uint32_t (*measure_ua_rms)(void *ctx); /* takes about 0.3 ms; NULL: it cannot be measured */
    void *ctx;
} fw_sense;

/* ---- the rest of a board ---- */
typedef struct fw_system_ops {
    /* wraps; runs from the clock that the generator's comes from */
    uint32_t (*time_us)(void *ctx);
    /* returns when an interrupt has come since the last call, or after about 1 ms */
    void (*wait)(void *ctx);
    uint32_t (*lock)(void *ctx); /* interrupts off; returns the state for unlock */
    void (*unlock)(void *ctx, uint32_t state);
    void (*feed_watchdog)(void *ctx);
    void (*reset)(void *ctx);                   /* does not return */
    uint32_t (*stack_used)(void *ctx);          /* the most bytes so far */
    void (*set_leds)(void *ctx, uint32_t leds); /* bit 0 alive, bit 1 touch, bit 2 fault */
    bool (*button)(void *ctx);                  /* the level of its pin; NULL: the board has none */
    /* `work` runs soon, after the interrupts and before the main loop continues. It is always the
     * same function. Called from the capture's interrupt, the main loop, or `work`. */
    void (*later)(void *ctx, void (*work)(void *user), void *user);
    bool (*analog_supply)(void *ctx); /* +-15 V are there; NULL: the board cannot tell */
} fw_system_ops;

/* The information that the start-up code found in memory that survives a reset. */
typedef struct fw_last_reset {
    uint32_t crash;    /* 1: a processor fault, words as in EITS_FAULT_CRASH */
    uint32_t watchdog; /* 1 */
    uint32_t words[5];
    uint32_t clock;  /* 1: the generator's clock failed */
    uint32_t supply; /* 1: the supply fell */
} fw_last_reset;

typedef struct fw_board {
    const char *name;   /* at most 15 characters */
    const char *serial; /* at most 24 characters, hexadecimal */
    uint32_t f_cpu_hz;
    uint32_t stack_bytes;
    uint32_t frame_period_us; /* of the scan after a start; 0: as fast as possible */
    /* The current of the source as built; 0: none flows. It bounds the excitation from below
     * (docs/guide/hardware.md, "Safety"). */
    uint32_t source_ua_rms;
    /* The same as an amplitude, and volts at the converter per volt between the electrodes, in
     * millionths: as designed, the owner's settings may have others; 0: the board does not know. */
    uint32_t source_ua, gain_ppm;
    /* dropped after the current is switched on, while capacitors in its path settle */
    uint32_t settle_frames;
    fw_generator generator;
    fw_multiplexers multiplexers;
    fw_capture capture;
    fw_link link;
    fw_store store;
    const fw_system_ops *system;
    void *system_ctx;
    fw_last_reset last_reset;
    fw_sense sense;
    const uint8_t *image; /* the program, for its hash; NULL: not known */
    size_t image_bytes;
    bool frames_given; /* by another instrument, whose scan is not known */
    void *workspace;   /* 16-byte aligned: the core's, and the frames' */
    size_t workspace_bytes;
} fw_board;

/* The application; returns only on boards whose input ends (emulators): 0, or a reason to fail. */
int fw_run(const fw_board *board);

#endif
