/* The board behind `sim:SCENE`: the firmware's own application, with simulated parts.
 *
 * It decodes which electrodes (up to 64) are connected, and at which frequency, from the writes of
 * the drivers to the generator and the multiplexers. The converter has 16 bits and no noise; its
 * range is that of the frames that are shown, and 1 uV until then. It measures frames that the host
 * has simulated. A frame is one scan, and it is chosen when the scan begins.
 *
 * Time is counted, not waited for: it passes only in sim_scan_frame, and the processor's work takes
 * none. Everything is in the caller's memory, so one process can have many boards. A board may also
 * be given whole frames of another instrument: see sim_give_frame. */
#ifndef SIMULATED_H
#define SIMULATED_H

#include "app/instrument.h"
#include "boards/parts/drive_monitor.h"
#include "drivers/ad9833.h"
#include "drivers/adg1206.h"

#define SIM_PAGE_BYTES 1024u

/* Frames of the untouched skin, then those of the scene. The host gives them a few at a time. */
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
    fw_ad9833 ad9833;
    fw_adg1206 adg1206;
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

/* The caller's memory must live as long as the board. */
typedef struct sim_setup {
    const char *name; /* at most 15 characters; must live as long as the board, as serial must */
    const char *serial;
    bool frames_given;        /* by sim_give_frame, not by sim_show */
    uint32_t frame_period_us; /* of the first scan */
    uint8_t *banks[FW_BANKS]; /* aligned to 16 */
    uint32_t bank_bytes;
    void *workspace; /* aligned to 16 */
    size_t workspace_bytes;
} sim_setup;

/* Returns the bytes of a board, whose memory must be aligned to 16. */
size_t sim_board_bytes(void);

/* Make a board with the content of its banks, at time 0 and switched on. */
void sim_init(sim_board *sim, const sim_setup *setup);

/* Switch the board off and on again: time continues, and banks and skin stay. */
void sim_start(sim_board *sim);

/* Give the board bytes from the host; it runs the commands in them. */
void sim_write(sim_board *sim, const uint8_t *bytes, size_t size);

/* Take at most `room` bytes that the board has sent. Returns their number. */
size_t sim_read(sim_board *sim, uint8_t *bytes, size_t room);

/* Returns the first violation of the drivers (drive_monitor.h), as a sentence; NULL: none. */
const char *sim_violation(const sim_board *sim);

/* The owner holds the blue button, or releases it. */
void sim_press(sim_board *sim, bool held);

/* Returns whether a stream or a tare waits for frames. */
bool sim_wants_frame(const sim_board *sim);
bool sim_tares(const sim_board *sim); /* a tare does */

/* Leave a row of the open model out of every frame, or use it again, also while a tare waits for
 * its first frame. Returns whether it was left out before. */
bool sim_mask_row(sim_board *sim, uint32_t row, bool masked);

/* Returns the open model, with its length and its CRC-32; NULL if there is none. */
const uint8_t *sim_model(const sim_board *sim, uint32_t *bytes, uint32_t *crc);

/* Put a skin before the board that has a model: first `untouched` frames (at least 1), then
 * `frames` (at least 1) at rate_hz, none above largest_v. Another model needs another call before
 * sim_scan_frame. */
void sim_show(sim_board *sim, float largest_v, uint32_t untouched, uint32_t frames, double rate_hz);

/* Give the board the `count` frames from `first` on (0: the first untouched one), in the model's
 * rows; they are used until the next call. */
void sim_put(sim_board *sim, const float *volts, uint32_t first, uint32_t count);

/* Give the board the frame `first` alone; it is shown only in the scan that begins at sim_wanted_s.
 */
void sim_put_once(sim_board *sim, const float *volts, uint32_t first);

/* The frame that sim_scan_frame needs; when its scan begins, in s after the scene's time 0 (0
 * before that); and how long after that each row is measured: n_rows us, 0 for rows that are not
 * measured.
 */
uint32_t sim_frame_wanted(const sim_board *sim);
double sim_wanted_s(const sim_board *sim);
void sim_row_delays(const sim_board *sim, uint32_t *delays_us);

/* Let the scene begin with the next scan. Until then the untouched frames are shown in a loop,
 * which a tare begins again. From then on each scan shows the frame of the scene that is nearest to
 * its beginning, and after the end of the scene the last frame. */
void sim_begin_scene(sim_board *sim);
bool sim_scene_over(const sim_board *sim);

/* If frames are wanted: scan until the application has had one more. Returns false if the frame
 * that a scan would show has not been given: give it, and call again. */
bool sim_scan_frame(sim_board *sim);

/* On a board with frames_given: give the application one frame, 2 n_rows volts in and out of phase,
 * in the order of the model's protocol. Rows that are not finite are marked as unusable. The frame
 * began passed_us after the last one, and frames come about period_us apart. Without a model the
 * frame is ignored. */
void sim_give_frame(sim_board *sim, const float *iq, uint32_t passed_us, uint32_t period_us);

/* On a board with frames_given: let passed_us pass without a frame. */
void sim_let_pass(sim_board *sim, uint32_t passed_us);

#endif
