/* The board behind `sim:SCENE`: the firmware's own application before parts that are made of
 * memory.
 *
 * The generator and the multiplexers are decoded from what the drivers write to them, just far
 * enough: which electrodes are merged, at which frequency. The converter has 16 bits and no noise;
 * its range is that of the frames that are shown, and 1 uV until then. What it measures are frames
 * that the host has simulated: a frame is one scan, and which one it is is decided when a scan
 * begins.
 *
 * Time is counted, not waited for: it passes only in sim_scan_frame, and nothing that the processor
 * does takes any. All is in the caller's memory, so that one process can have many boards.
 * A board may also be given the frames of another instrument, whole: see sim_give_frame. */
#ifndef SIMULATED_H
#define SIMULATED_H

#include "app/instrument.h"
#include "boards/parts/drive_monitor.h"

#define SIM_PAGE_BYTES 1024u

/* Frames of the untouched skin, then those of the scene; the host puts them before the board by
 * and by. */
typedef struct sim_scene {
    const float *volts; /* count x n_rows, amplitudes in V: frames first, first + 1, ... */
    uint32_t first, count;
    bool once;          /* they are of the scan that began at put_us only */
    uint64_t put_us;    /* of the board's clock */
    uint32_t wanted;    /* the frame that the last scan showed, or that is missing */
    uint64_t wanted_us; /* when that scan begins */
    uint32_t untouched, frames;
    double rate_hz;
    bool begun, begins_with_scan; /* time 0 is when the next scan begins */
    uint64_t began_us;
    uint32_t untouched_shown; /* since the last tare began */
    const float *shown;       /* n_rows, of the scan under way */
} sim_scene;

typedef struct sim_converter {
    void (*done)(void *user, const fw_burst *burst);
    void *user;
    fw_capture_setup setup;
    bool running;
    bool interrupts;  /* `done` is under way */
    uint64_t slot_us; /* when the next slot begins */
    /* of the generator's phase at each sample of a burst, from the first on */
    float cosine[FW_MAX_SAMPLES], sine[FW_MAX_SAMPLES];
    uint16_t codes[FW_MAX_SAMPLES];
} sim_converter;

typedef struct sim_board {
    fw_board board;
    uint64_t now_us;
    ad9833_model generator;
    uint32_t released_us;  /* when its phase began */
    drive_monitor monitor; /* has the lines of the multiplexers */
    uint64_t waited_ns;    /* by the drivers, beside now_us */
    uint32_t row;          /* that was measured last */
    sim_converter converter;
    sim_scene scene;
    uint8_t *bank[FW_BANKS];
    uint8_t page[FW_PAGES - FW_BANKS][SIM_PAGE_BYTES]; /* the owner's settings */
    bool button;                                       /* the owner holds it */
    const uint8_t *to_board;                           /* the caller's, in sim_write */
    size_t to_board_bytes;
    uint8_t to_host[1 << 18];
    size_t to_host_bytes;
    void (*later)(void *user); /* after the interrupt; NULL: nothing */
    void *later_user;
    fw_instrument instrument;
} sim_board;

/* The caller's memory is used as long as the board is. */
typedef struct sim_setup {
    const char *name; /* at most 15 characters; used as long as the board is, as serial */
    const char *serial;
    bool frames_given;        /* by sim_give_frame, not by sim_show */
    uint32_t frame_period_us; /* of the first scan */
    uint8_t *banks[FW_BANKS]; /* aligned to 16 */
    uint32_t bank_bytes;
    void *workspace; /* aligned to 16 */
    size_t workspace_bytes;
} sim_setup;

/* Bytes of a board, whose memory must be aligned to 16. */
size_t sim_board_bytes(void);

/* A board at time 0 on what its banks hold, switched on. */
void sim_init(sim_board *sim, const sim_setup *setup);

/* Off and on again: time goes on, banks and skin stay. */
void sim_start(sim_board *sim);

/* Give the board bytes from the host; the commands in them are carried out. */
void sim_write(sim_board *sim, const uint8_t *bytes, size_t size);

/* Take what the board has sent, at most `room` bytes; returns how many. */
size_t sim_read(sim_board *sim, uint8_t *bytes, size_t room);

/* What the drivers did that they must never do, in words; NULL: nothing. */
const char *sim_violation(const sim_board *sim);

/* The owner holds the blue button, or lets go of it. */
void sim_press(sim_board *sim, bool held);

/* Whether the board scans for someone: a stream or a tare waits for frames. */
bool sim_wants_frame(const sim_board *sim);
bool sim_tares(const sim_board *sim); /* a tare does */

/* The model that is open, its length and CRC-32; NULL where there is none. */
const uint8_t *sim_model(const sim_board *sim, uint32_t *bytes, uint32_t *crc);

/* Put a skin before the board that has a model: first `untouched` frames (at least 1), then
 * `frames` (at least 1) at rate_hz, none above largest_v. Another model needs another call before
 * sim_scan_frame. */
void sim_show(sim_board *sim, float largest_v, uint32_t untouched, uint32_t frames, double rate_hz);

/* The `count` frames from `first` on (0: the first untouched one), in the model's rows; they are
 * used until the next call. */
void sim_put(sim_board *sim, const float *volts, uint32_t first, uint32_t count);

/* One frame, first, that is shown only in the scan that begins when sim_wanted_s says. */
void sim_put_once(sim_board *sim, const float *volts, uint32_t first);

/* Which frame sim_scan_frame misses; when its scan begins, in s after the scene's time 0 (before
 * that 0); and how long after that each row is measured, n_rows us, 0 for those left out. */
uint32_t sim_frame_wanted(const sim_board *sim);
double sim_wanted_s(const sim_board *sim);
void sim_row_delays(const sim_board *sim, uint32_t *delays_us);

/* Let the scene begin with the next scan. Until then the untouched frames are shown over and over,
 * from the first on when a tare begins; then the frame of the scene that is nearest to the
 * beginning of the scan, and at last the last one. */
void sim_begin_scene(sim_board *sim);
bool sim_scene_over(const sim_board *sim);

/* Where frames are wanted: scan until the application has had one more. False where the frame that
 * a scan would show has not been put before the board: put it, and call again. */
bool sim_scan_frame(sim_board *sim);

/* Where frames are given: the application gets one, 2 n_rows volts in and out of phase of the
 * model's protocol, as they are but for rows that are not finite, which it cannot use. The frame
 * began passed_us after the last one, and frames come about period_us apart. Nothing where there is
 * no model. */
void sim_give_frame(sim_board *sim, const float *iq, uint32_t passed_us, uint32_t period_us);

/* Where frames are given: none has come for passed_us more, and the application may miss them. */
void sim_let_pass(sim_board *sim, uint32_t passed_us);

#endif
