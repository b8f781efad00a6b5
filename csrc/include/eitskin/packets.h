/* eitskin: packets between a board and a host: their numbers and the layout of their payloads.
 *
 * Payloads are little-endian and have no padding; a test compares their sizes and places with those
 * of the compiler. docs/reference/link-protocol.md says how they are used, link.h has their codec.
 * Numbers of packets, statuses, faults and bits never get another meaning.
 *
 * Written by tables/make_tables.py from tables/link.toml.
 */
#ifndef EITSKIN_PACKETS_H
#define EITSKIN_PACKETS_H

#include "eitskin/diagnostics.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The first byte of every packet; a packet of another version is rejected. */
#define EITS_LINK_VERSION     6u
#define EITS_LINK_MAX_PAYLOAD 16384u
/* In SETTINGS this value leaves a number as it is. */
#define EITS_KEPT             0xFFFFFFFFu
/* In PROBE this value opens all electrodes. */
#define EITS_PROBE_OPEN       0xFFFFFFFFu
/* The most characters of a board's name. */
#define EITS_NAME_CHARACTERS  32u

/* Below 0x80 from the board, from there on to it. */
typedef enum eits_packet_type {
    /* the board, its model and its settings */
    EITS_PACKET_INFO = 0x01,
    /* how a command ended */
    EITS_PACKET_REPLY = 0x02,
    /* a scanned frame */
    EITS_PACKET_RAW = 0x10,
    /* a frame's image */
    EITS_PACKET_IMAGE = 0x11,
    /* a frame's touches */
    EITS_PACKET_TOUCHES = 0x12,
    /* what a frame's touches amounted to */
    EITS_PACKET_EVENTS = 0x15,
    /* touches after a drive */
    EITS_PACKET_DRIVE_TOUCHES = 0x17,
    /* the board's counters */
    EITS_PACKET_STATS = 0x13,
    /* a fault that rose or went */
    EITS_PACKET_FAULT = 0x14,
    /* SHA-256 of the model and of the firmware */
    EITS_PACKET_HASHES = 0x16,
    /* codes of a fixed row */
    EITS_PACKET_PROBED = 0x18,
    /* never on a wire: the first packet of an .eits file */
    EITS_PACKET_RECORDING = 0x70,
    /* send an INFO */
    EITS_PACKET_GET_INFO = 0x80,
    /* what to send of each frame */
    EITS_PACKET_STREAM = 0x81,
    /* take the reference */
    EITS_PACKET_TARE = 0x82,
    /* how frames are scanned; forgets the reference */
    EITS_PACKET_SCAN = 0x83,
    /* the solver's options */
    EITS_PACKET_SOLVER = 0x84,
    /* stop the scan and erase the bank that is not in use */
    EITS_PACKET_MODEL_BEGIN = 0x85,
    /* bytes of the model */
    EITS_PACKET_MODEL_DATA = 0x86,
    /* use the model that was sent */
    EITS_PACKET_MODEL_COMMIT = 0x87,
    /* send a STATS */
    EITS_PACKET_GET_STATS = 0x88,
    /* leave a row out, or use it again */
    EITS_PACKET_MASK_ROW = 0x89,
    /* restart the board */
    EITS_PACKET_RESET = 0x8a,
    /* run the model's golden frame */
    EITS_PACKET_SELF_TEST = 0x8b,
    /* forget the faults */
    EITS_PACKET_CLEAR_FAULTS = 0x8c,
    /* the host is there, or goes and the current stops; not answered */
    EITS_PACKET_KEEPALIVE = 0x8d,
    /* the owner's settings, kept in flash */
    EITS_PACKET_SETTINGS = 0x8e,
    /* send HASHES */
    EITS_PACKET_GET_HASHES = 0x8f,
    /* measure a fixed row once and send PROBED */
    EITS_PACKET_PROBE = 0x90
} eits_packet_type;

/* The result of a command; `detail` of the reply adds to it. */
typedef enum eits_reply_status {
    /* MODEL_BEGIN: [0] the offset to go on from */
    EITS_REPLY_OK = 0,
    /* no command has this packet type */
    EITS_REPLY_UNKNOWN_COMMAND = 1,
    /* [0] bytes of payload that are expected */
    EITS_REPLY_LENGTH = 2,
    /* [0] offset in the payload of the field out of range; [1] the limit it broke */
    EITS_REPLY_RANGE = 3,
    /* no model is in use: send one first */
    EITS_REPLY_NO_MODEL = 4,
    /* there is no reference: send a TARE first; of a TARE: none to bring back */
    EITS_REPLY_NOT_TARED = 5,
    /* [0] type of the command under way */
    EITS_REPLY_BUSY = 6,
    /* [0] most bytes that a bank, a packet or the memory holds */
    EITS_REPLY_MODEL_SIZE = 7,
    /* [0] eits_status */
    EITS_REPLY_MODEL_INVALID = 8,
    /* [0] electrodes that the protocol needs; [1] electrodes there are */
    EITS_REPLY_MODEL_SCAN = 9,
    /* what arrived is not what MODEL_BEGIN announced */
    EITS_REPLY_MODEL_CRC = 10,
    /* MODEL_DATA out of order: [0] the offset expected; -1: no upload is under way */
    EITS_REPLY_OFFSET = 11,
    /* [0] the offset where erasing or programming failed */
    EITS_REPLY_FLASH = 12,
    /* [0] eits_status of the core */
    EITS_REPLY_CORE = 13,
    /* [0] the nearest number of samples that is whole excitation periods */
    EITS_REPLY_PERIODS = 14,
    /* [0] least frame period of this scan, us */
    EITS_REPLY_TOO_FAST = 15,
    /* [0] difference to the golden image in parts per 1e9 of its peak */
    EITS_REPLY_SELF_TEST = 16,
    /* the owner has locked the board: its blue button must be held */
    EITS_REPLY_LOCKED = 17,
    /* the current was above its limit: CLEAR_FAULTS first */
    EITS_REPLY_TRIPPED = 18,
    /* touches after each drive want a model with fields, a reference that stays, full scans and
     * every frame */
    EITS_REPLY_DRIVES = 19
} eits_reply_status;

/* Bits of a row's quality byte. */
typedef enum eits_quality {
    /* a sample lay at either end of the converter's range */
    EITS_QUALITY_SATURATED = 1,
    /* the multiplexers were switched later than the settling time before the first sample */
    EITS_QUALITY_UNSETTLED = 2,
    /* it and its reciprocal disagree (full scans and checks) */
    EITS_QUALITY_RECIPROCITY = 4,
    /* not measured: its reciprocal's value */
    EITS_QUALITY_COPIED = 8,
    /* one of its electrodes is taken to be open: only without a reference and in a tare; then the
     * core finds them */
    EITS_QUALITY_OPEN = 16,
    /* left out by MASK_ROW */
    EITS_QUALITY_MASKED = 32
} eits_quality;

/* Faults of the board or the skin, and the meaning of index, value and words. */
typedef enum eits_fault {
    /* no bank holds a valid model; value: eits_status of the newest bank */
    EITS_FAULT_NO_MODEL = 1,
    /* index: electrode */
    EITS_FAULT_ELECTRODE_OPEN = 2,
    /* index: first row; value: rows */
    EITS_FAULT_SATURATED = 3,
    /* a frame took longer than the frame period; value: us over */
    EITS_FAULT_DEADLINE = 4,
    /* index: worst row; value: parts per thousand of the rms voltage */
    EITS_FAULT_RECIPROCITY = 5,
    /* the core rejected the frame; value: eits_status */
    EITS_FAULT_SOLVER = 6,
    /* the converter or its DMA gave nothing in time */
    EITS_FAULT_SCAN_STALLED = 7,
    /* the board restarted after a processor fault; words: pc, lr, cfsr, hfsr, address */
    EITS_FAULT_CRASH = 8,
    /* the board restarted because the program hung */
    EITS_FAULT_WATCHDOG = 9,
    /* the generator or the multiplexers could not be written */
    EITS_FAULT_BUS = 10,
    /* index: electrode; value: its partner, -1 where more than two are bridged; words[0], [1]: all
     * of them, bit e */
    EITS_FAULT_BRIDGED = 11,
    /* index: electrode */
    EITS_FAULT_ELECTRODE_NOISY = 12,
    /* value: parts per thousand of the data; 0: from signs, not a fraction */
    EITS_FAULT_MODEL_MISMATCH = 13,
    /* only solved frames raise it; a tare ends it */
    EITS_FAULT_STALE_REFERENCE = 14,
    /* likewise */
    EITS_FAULT_UNLIKE_MODEL = 15,
    /* the current was above its limit and was switched off; value: uA rms */
    EITS_FAULT_CURRENT = 16,
    /* the board restarted because the generator's clock failed */
    EITS_FAULT_CLOCK = 17,
    /* the board restarted because its supply fell below 2.9 V */
    EITS_FAULT_SUPPLY = 18,
    /* the locked board refused a command; index: its packet type */
    EITS_FAULT_LOCKED = 19,
    /* the analog supply of +-15 V, or one half of it, is missing */
    EITS_FAULT_ANALOG_SUPPLY = 20
} eits_fault;
#define EITS_FAULTS 21u

/* ELECTRODE_OPEN, SATURATED and BRIDGED rise in the frame that shows them, MODEL_MISMATCH,
 * ELECTRODE_NOISY, STALE_REFERENCE and UNLIKE_MODEL with the third in a row, since a touch that
 * lands within a scan gives one such frame; all these are gone after so many frames in a row
 * without them. */
#define EITS_FAULT_RAISE_FRAMES 3u
#define EITS_FAULT_CLEAR_FRAMES 8u

/* Bits of a RAW's flags. */
typedef enum eits_raw_flags {
    /* a frame of a tare */
    EITS_RAW_REFERENCE = 1,
    /* only one row of each reciprocal pair was measured */
    EITS_RAW_RECIPROCAL = 2,
    /* a full scan among such, for the check of reciprocity */
    EITS_RAW_CHECK = 4,
    /* the touches after each drive brought it to the instant of its last drive */
    EITS_RAW_ALIGNED = 8,
    /* and it was solved: its drives are accounted for */
    EITS_RAW_TRUSTED = 16,
    /* the tracker of touches began with it */
    EITS_RAW_BEGUN = 32
} eits_raw_flags;

/* Bits of what is streamed of each frame. */
typedef enum eits_stream {
    /* its voltages, as a RAW */
    EITS_STREAM_RAW = 1,
    /* its image, as an IMAGE */
    EITS_STREAM_IMAGE = 2,
    /* its touches, as TOUCHES */
    EITS_STREAM_TOUCHES = 4,
    /* its events, as EVENTS, also where there are none; a tare forgets fingers */
    EITS_STREAM_EVENTS = 8,
    /* touches after each drive, as DRIVE_TOUCHES */
    EITS_STREAM_DRIVE_TOUCHES = 16
} eits_stream;

/* The board, its model and its settings. Fields are added at its end. */
typedef struct eits_packet_info {
    /* of the GET_INFO that asked; 0 after a restart */
    uint32_t request;
    /* major, minor, patch, 0 */
    uint8_t firmware[4];
    /* such as nucleo_f767zi, zero-filled */
    char board[16];
    /* the processor's serial number, hexadecimal, zero-filled */
    char serial[24];
    /* processor clock, Hz */
    uint32_t f_cpu_hz;
    /* of the multiplexers */
    uint32_t electrodes;
    /* most bytes of a model */
    uint32_t bank_bytes;
    /* most bytes in one MODEL_DATA */
    uint32_t data_bytes;
    /* of the model in use; 0: none */
    uint32_t model_bytes;
    /* CRC-32 of the whole model file, as zlib's crc32 */
    uint32_t model_crc;
    /* of the protocol that is scanned */
    uint64_t protocol_hash;
    /* of the model, as all down to storage */
    uint32_t n_electrodes;
    /* of its protocol */
    uint32_t n_rows;
    /* its rows once reciprocal ones are averaged */
    uint32_t n_folded;
    /* numbers of the reduced data */
    uint32_t rank;
    /* pixels of an IMAGE */
    uint32_t n_pixels;
    /* columns of the grid that the pixels lie in */
    uint32_t nx;
    /* rows of that grid */
    uint32_t ny;
    /* eits_storage: 0 f32, 1 f16, 2 i16, 3 i8 */
    uint32_t storage;
    /* that the model is in */
    uint32_t bank;
    /* as the generator's tuning word gives it */
    uint32_t excitation_millihz;
    /* of the converter */
    uint32_t sample_rate_hz;
    /* of a measurement */
    uint16_t samples;
    /* settling time */
    uint16_t settle_us;
    /* from one measurement to the next; 0, as all of the scan: the frames are another
     * instrument's */
    uint32_t slot_us;
    /* every n-th frame is scanned fully; 1: all; 0: none */
    uint16_t check_every;
    /* bits of eits_stream */
    uint16_t streaming;
    /* every n-th frame is streamed */
    uint16_t every;
    /* 1: there is a reference */
    uint16_t tared;
    /* 0: as fast as the scan goes */
    uint32_t frame_period_us;
    /* bit k: fault number k is raised */
    uint32_t faults;
    /* between the electrodes, for one step of the converter */
    uint32_t volts_per_code_nv;
    /* eits_drive */
    uint16_t drive;
    /* bits of eits_setting */
    uint16_t settings;
    /* what the current source gives as built; 0: not known */
    uint32_t source_ua_rms;
    /* as measured last; 0: there is no sense resistor, or no current */
    uint32_t current_ua_rms;
    /* above which the drive goes off; 0: none */
    uint32_t current_limit_ua_rms;
    /* that the owner gave the board, zero-filled; empty: none */
    char name[32];
    /* amplitude of the current source; 0: not known */
    uint32_t source_ua;
    /* volts at the converter per volt between the electrodes, in millionths; 0: not known */
    uint32_t gain_ppm;
    /* the level of the button's pin now; 2: there is none */
    uint32_t button;
    /* 0 */
    uint32_t reserved;
} eits_packet_info;

/* The result of the command with this request number. */
typedef struct eits_packet_reply {
    /* of the command that is answered */
    uint32_t request;
    /* its packet type */
    uint16_t command;
    /* eits_reply_status */
    uint16_t status;
    /* by status */
    int32_t detail[2];
} eits_packet_reply;

/* A scanned frame. n_rows numbers in V follow in the protocol's order, the very numbers that the
 * board's core got, NaN for a row that could not be used; then as many quality bytes. */
typedef struct eits_packet_raw {
    /* counts scanned frames; wraps */
    uint32_t frame;
    /* when its scan began, on the board's clock; wraps */
    uint32_t time_us;
    /* how long the scan took */
    uint32_t scan_us;
    /* voltages, and quality bytes, that follow */
    uint16_t n_rows;
    /* bits of eits_raw_flags */
    uint16_t flags;
} eits_packet_raw;

/* Head of IMAGE and TOUCHES: what eits_info says, and the times. */
typedef struct eits_packet_solved {
    /* number of the scanned frame, as in its RAW */
    uint32_t frame;
    /* when its scan began */
    uint32_t time_us;
    /* time for the solve */
    uint32_t solve_us;
    /* time for the touches */
    uint32_t touch_us;
    /* from the end of its scan until this packet was made */
    uint32_t age_us;
    /* pixels or touches that follow */
    uint16_t count;
    /* 0, or minus an eits_status: then the image is zero and there are no touches */
    uint16_t status;
    /* eits_stop */
    uint8_t stop;
    /* eits_shown; 0 where no touches were looked for */
    uint8_t shown;
    /* rows left out */
    uint16_t masked;
    /* that the solver took */
    uint32_t iterations;
    /* coefficients that are not zero */
    uint32_t nonzeros;
    /* multiply-accumulates of the solve */
    uint32_t macs;
    /* of the touches */
    uint32_t touch_macs;
    /* as used for this frame */
    float lambda;
    /* the least lambda whose image is zero */
    float lambda_max;
    /* max(S'y) of noise, by the reference; 0: unknown */
    float lambda_noise;
    /* relative duality gap */
    float gap_rel;
    /* its norm */
    float residual;
    /* norm of the reduced data */
    float data_norm;
    /* bits of eits_diagnostic */
    uint32_t diagnostics;
    /* saturated rows without masked ones: by the converter or beyond the core's limit */
    uint16_t saturated;
    /* rows left out as outliers */
    uint16_t outliers;
    /* fraction of the data outside the model's range */
    float model_mismatch;
    /* bit e: electrode e */
    uint64_t open_electrodes;
    /* likewise, of one or more pairs */
    uint64_t bridged_electrodes;
    /* likewise */
    uint64_t noisy_electrodes;
} eits_packet_solved;

/* A touch, as eits_touch. */
typedef struct eits_packet_touch {
    /* from 1; stays with a touch from frame to frame */
    uint32_t id;
    /* of the centre, in the model's coordinates */
    float x_mm;
    /* of the centre */
    float y_mm;
    /* of the disc that was fitted */
    float radius_mm;
    /* S mm^2/m */
    float strength_s_per_m_mm2;
    /* fraction of the data that it alone explains, 0 to 1; 0: held, not found */
    float explained;
    /* 0 where the model is not calibrated */
    float force_n;
    /* probability that it is one touch; 0: not known */
    float confidence;
    /* covariance of the centre; 0: not known */
    float x_variance_mm2;
    float xy_covariance_mm2;
    float y_variance_mm2;
    /* half of the long axis as a vector; 0, 0: a disc, or not known */
    float long_x_mm;
    float long_y_mm;
    /* standard deviation of the radius; 0: the data do not tell the radius */
    float radius_sd_mm;
    /* 1: a whole frame has shown it */
    uint32_t confirmed;
} eits_packet_touch;

/* Touches as of an instant within a scan. Where nothing touches it is sent once: when that begins,
 * or the touches have gone. */
typedef struct eits_packet_drive_touches {
    /* number of the frame that is scanned */
    uint32_t frame;
    /* the instant they hold for: the middle of the drive, were no row repeated */
    uint32_t time_us;
    /* the frame before which nothing was known */
    uint32_t begun;
    /* from the end of the drive until this packet was made; at most 65,535 */
    uint16_t age_us;
    /* of it for the update; likewise */
    uint16_t update_us;
    /* of the protocol, in the order of first rows */
    uint16_t drive;
    /* touches that follow */
    uint16_t count;
} eits_packet_drive_touches;

/* A touch, as eits_fast_touch. */
typedef struct eits_packet_drive_touch {
    /* from 1, as in TOUCHES; stays with a touch */
    uint16_t id;
    /* 1: a whole frame has shown it */
    uint16_t confirmed;
    /* of the centre, in the model's coordinates */
    float x_mm;
    /* of the centre */
    float y_mm;
    /* its velocity */
    float vx_mm_per_s;
    float vy_mm_per_s;
    /* S mm^2/m */
    float strength_s_per_m_mm2;
    /* of the disc that it is taken for */
    float radius_mm;
    /* covariance of the centre */
    float x_variance_mm2;
    float xy_covariance_mm2;
    float y_variance_mm2;
} eits_packet_drive_touch;

/* Events of a frame; there are none if the core rejected it. */
typedef struct eits_packet_events {
    /* number of the scanned frame, as in its RAW */
    uint32_t frame;
    /* when its scan began */
    uint32_t time_us;
    /* events that follow */
    uint32_t count;
} eits_packet_events;

/* One event, as eits_event (gesture_events.h); its time is the frame's, its zone the host's. */
typedef struct eits_packet_event {
    /* eits_event_kind */
    uint16_t kind;
    /* eits_event_phase */
    uint16_t phase;
    /* of the touch, as it was when it landed */
    uint32_t first_id;
    /* of two fingers the second; else 0 */
    uint32_t second_id;
    /* where */
    float x_mm;
    float y_mm;
    /* of a swipe, 0 along x, 90 along y */
    float direction_deg;
    /* by kind */
    float value;
} eits_packet_event;

/* Stages that are timed. */
typedef enum eits_stage {
    /* from the first measurement of a frame to its last */
    EITS_STAGE_SCAN = 0,
    /* processor time in interrupts within the scan */
    EITS_STAGE_DEMODULATE = 1,
    /* frame stage and solver */
    EITS_STAGE_SOLVE = 2,
    /* touch detection and fit, where touches are streamed */
    EITS_STAGE_TOUCHES = 3,
    /* what is left between scan and end: packets are made and queued */
    EITS_STAGE_SEND = 4,
    /* the whole frame */
    EITS_STAGE_FRAME = 5
} eits_stage;
#define EITS_STAGES 6u

/* Times of one stage. */
typedef struct eits_stage_stats {
    /* frames that were timed */
    uint32_t count;
    /* of the last such frame */
    uint32_t last_us;
    /* 99th percentile: the upper edge of its bin, an eighth of an octave wide */
    uint32_t p99_us;
    /* of all since the start, or since GET_STATS set the times to zero */
    uint32_t worst_us;
} eits_stage_stats;

/* The board's counters. */
typedef struct eits_packet_stats {
    /* of the GET_STATS that asked */
    uint32_t request;
    /* since the start */
    uint32_t uptime_ms;
    /* streamed or not */
    uint32_t frames_scanned;
    /* where image or touches were streamed */
    uint32_t frames_solved;
    /* since the link came up */
    uint32_t packets_sent;
    /* a dropped packet still takes a sequence number */
    uint32_t packets_dropped;
    /* frame periods missed */
    uint32_t deadlines_missed;
    /* measurements taken again because the switch came too late */
    uint32_t slots_repeated;
    /* rows left out as outliers, of all frames since there is a reference */
    uint32_t outliers;
    /* commands received */
    uint32_t link_packets;
    /* whole packets whose checksum does not fit */
    uint32_t link_crc_errors;
    /* ended inside a COBS block, or shorter than head and checksum */
    uint32_t link_framing_errors;
    /* longer than the receive buffer */
    uint32_t link_overruns;
    /* that are set aside */
    uint32_t stack_bytes;
    /* the most so far */
    uint32_t stack_used;
    /* for the model's context and its frames */
    uint32_t workspace_bytes;
    /* of them by the model in use */
    uint32_t workspace_used;
    /* by eits_stage */
    eits_stage_stats stage[6];
} eits_packet_stats;

/* A fault that rose or went. */
typedef struct eits_packet_fault {
    /* eits_fault */
    uint16_t code;
    /* 1: it is there; 0: it has gone */
    uint16_t raised;
    /* in which it rose or went */
    uint32_t frame;
    /* by code, as value and words */
    int32_t index;
    /* by code */
    int32_t value;
    /* by code; 0 where it has none */
    uint32_t words[5];
} eits_packet_fault;

/* A command without parameters. */
typedef struct eits_command_plain {
    /* never 0; the reply repeats it */
    uint32_t request;
} eits_command_plain;

/* Selects the data that the board sends per frame. */
typedef struct eits_command_stream {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* bits of eits_stream; 0 stops */
    uint16_t what;
    /* every n-th frame, at least 1 */
    uint16_t every;
    /* so many streamed frames, then stop; 0: until stopped */
    uint32_t frames;
} eits_command_stream;

/* Take the reference; the reply comes when that is done. */
typedef struct eits_command_tare {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* 1, or 4 to 1024; 0: the reference before the last tare comes back, where it is kept */
    uint32_t frames;
} eits_command_tare;

/* Sets how frames are scanned; forgets the reference. */
typedef struct eits_command_scan {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* 1,000 to 250,000,000, below half the sample rate */
    uint32_t excitation_millihz;
    /* 1,000 to 5,000,000 */
    uint32_t sample_rate_hz;
    /* 4 to 1024 */
    uint16_t samples;
    /* at most 50,000 */
    uint16_t settle_us;
    /* 1: every frame is full; n > 1: one row of each reciprocal pair, every n-th frame full; 0:
     * never full */
    uint16_t check_every;
    /* 0 */
    uint16_t reserved;
    /* at most 600,000,000; 0: as fast as the scan goes */
    uint32_t frame_period_us;
} eits_command_scan;

/* The solver's options, from the next frame on until another model or a restart. */
typedef struct eits_command_solver {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* 1 to 1000 */
    uint32_t iterations;
    /* at most EITS_MAX_TOUCHES */
    uint32_t max_touches;
    /* 0 or 1 */
    uint32_t warm_start;
    /* eits_sign: 0 increase, 1 decrease, 2 both */
    uint32_t sign;
    /* 0 to 1 */
    float lambda_rel;
    /* 0 to 1 */
    float gap_rel;
    /* eits_solver: 0 FISTA, 1 working set, 3 active set; 2 is reserved and rejected */
    uint32_t solver;
    /* multiply-accumulates a frame; 0: no limit */
    uint32_t mac_limit;
    /* bits of eits_diagnostic that are looked for */
    uint32_t diagnostics;
} eits_command_solver;

/* Announces a model. */
typedef struct eits_command_model_begin {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* of the model, at least 64 */
    uint32_t bytes;
    /* CRC-32 of the whole model */
    uint32_t crc;
} eits_command_model_begin;

/* Bytes of the model follow: a multiple of 4, but for the last. */
typedef struct eits_command_model_data {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* of the first byte */
    uint32_t offset;
} eits_command_model_data;

/* Send a STATS. */
typedef struct eits_command_get_stats {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* 1: set the times to zero after sending them */
    uint32_t reset;
} eits_command_get_stats;

/* Leave a row out, or use it again. */
typedef struct eits_command_mask_row {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* of the protocol */
    uint16_t row;
    /* 1: leave it out; 0: use it again */
    uint16_t masked;
} eits_command_mask_row;

/* Current may flow through the skin, or the reason that it may not. */
typedef enum eits_drive {
    /* no host has asked for frames */
    EITS_DRIVE_OFF = 0,
    /* a host has, and is heard */
    EITS_DRIVE_ON = 1,
    /* off: no packet came from the host for a second */
    EITS_DRIVE_SILENT = 2,
    /* off: the current was above its limit */
    EITS_DRIVE_TRIPPED = 3
} eits_drive;

/* Bits of the owner's settings. */
typedef enum eits_setting {
    /* current flows on where no host listens */
    EITS_SETTING_KEEP_CURRENT = 1,
    /* models, settings and lower excitations need the blue button */
    EITS_SETTING_LOCKED = 2,
    /* a sense resistor is fitted: the current is measured */
    EITS_SETTING_SENSE = 4,
    /* the owner's button pulls its pin low, and does not lift it */
    EITS_SETTING_BUTTON_LOW = 8
} eits_setting;

/* The host is there. Any command says so; this one asks for nothing, and is not answered. */
typedef struct eits_command_keepalive {
    /* not looked at */
    uint32_t request;
    /* 1: it is; 0: it goes, and the current stops now */
    uint32_t present;
} eits_command_keepalive;

/* The owner's settings, all of them, kept over a loss of power. */
typedef struct eits_command_settings {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* bits of eits_setting */
    uint32_t settings;
    /* at most 10,000; 0: 1.25 times what the source gives; 2^32 - 1: as it is */
    uint32_t current_limit_ua_rms;
    /* letters, digits, - and _, the first a letter or digit; zero-filled; empty: none */
    char name[32];
    /* amplitude of the current source as fitted, 10 to 7,000; 0: as designed; 2^32 - 1: as it is */
    uint32_t source_ua;
    /* from electrodes to converter as fitted, 10,000 to 400,000,000; 0: as designed; 2^32 - 1: as
     * it is */
    uint32_t gain_ppm;
} eits_command_settings;

/* SHA-256 of what the board's flash holds. */
typedef struct eits_packet_hashes {
    /* of the GET_HASHES that asked */
    uint32_t request;
    /* of the model in use; zero: none */
    uint8_t model[32];
    /* of the program; zero: not known */
    uint8_t firmware[32];
} eits_packet_hashes;

/* Take one burst of a fixed row, after another one of the row before it, so that its first samples
 * show how it settles. The scan waits meanwhile. */
typedef struct eits_command_probe {
    /* never 0; PROBED repeats it */
    uint32_t request;
    /* electrodes of I+, I-, V+, V- of 8 bits each, the first one lowest; 2^32 - 1: all open */
    uint32_t before;
    /* the same of the burst that is sent */
    uint32_t joined;
    /* from the switch to the burst's first sample, at least; at most 50,000 */
    uint16_t settle_us;
    /* 4 to 1024; those of SCAN's rate */
    uint16_t samples;
    /* 1: it runs; 0: it is in reset */
    uint16_t generator;
    /* 0 */
    uint16_t reserved;
} eits_command_probe;

/* A burst of a fixed row; then its samples, codes of the converter, u16 each. */
typedef struct eits_packet_probed {
    /* of the PROBE that asked */
    uint32_t request;
    /* when the burst began, on the board's clock */
    uint32_t start_us;
    /* when its electrodes had been joined */
    uint32_t switched_us;
    /* that follow */
    uint16_t samples;
    /* 1: the converter lost samples */
    uint16_t lost;
} eits_packet_probed;

#ifdef __cplusplus
}
#endif
#endif
