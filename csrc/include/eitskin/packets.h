/* eitskin: packets between a board and a host: their numbers and the layout of their payloads.
 *
 * Payloads are little-endian and have no padding; a test compares their sizes and places with those
 * of the compiler. docs/reference/link-protocol.md says how they are used, and link.h has their
 * codec. Numbers of packets, statuses, faults and bits never get another meaning.
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

/* Types below 0x80 are sent by the board, the others by the host. */
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
    /* a frame's events: taps, swipes and other gestures */
    EITS_PACKET_EVENTS = 0x15,
    /* touches after a drive */
    EITS_PACKET_DRIVE_TOUCHES = 0x17,
    /* the board's counters */
    EITS_PACKET_STATS = 0x13,
    /* a fault that was raised or cleared */
    EITS_PACKET_FAULT = 0x14,
    /* SHA-256 of the model and of the firmware */
    EITS_PACKET_HASHES = 0x16,
    /* the converter's codes for one row */
    EITS_PACKET_PROBED = 0x18,
    /* never on a wire: the first packet of an .eits file */
    EITS_PACKET_RECORDING = 0x70,
    /* send an INFO */
    EITS_PACKET_GET_INFO = 0x80,
    /* choose what the board sends for each frame */
    EITS_PACKET_STREAM = 0x81,
    /* take the reference */
    EITS_PACKET_TARE = 0x82,
    /* set how frames are scanned, and forget the reference */
    EITS_PACKET_SCAN = 0x83,
    /* set the solver's options */
    EITS_PACKET_SOLVER = 0x84,
    /* stop the scan and erase the bank that is not in use */
    EITS_PACKET_MODEL_BEGIN = 0x85,
    /* store bytes of the model */
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
    /* the host is present; or it leaves, and the current stops. Not answered */
    EITS_PACKET_KEEPALIVE = 0x8d,
    /* store the owner's settings in flash */
    EITS_PACKET_SETTINGS = 0x8e,
    /* send HASHES */
    EITS_PACKET_GET_HASHES = 0x8f,
    /* measure one row once, and send a PROBED */
    EITS_PACKET_PROBE = 0x90
} eits_packet_type;

/* The result of a command. The reply's `detail` adds to it; [0] and [1] are its two numbers. */
typedef enum eits_reply_status {
    /* the command was carried out; of MODEL_BEGIN: [0] the offset to continue from */
    EITS_REPLY_OK = 0,
    /* no command has this packet type */
    EITS_REPLY_UNKNOWN_COMMAND = 1,
    /* the payload has the wrong length: [0] the expected bytes */
    EITS_REPLY_LENGTH = 2,
    /* a field is out of range: [0] its offset in the payload; [1] the limit that it exceeded */
    EITS_REPLY_RANGE = 3,
    /* no model is in use: send one first */
    EITS_REPLY_NO_MODEL = 4,
    /* there is no reference: send a TARE first; of a TARE: there is no earlier reference to
     * restore */
    EITS_REPLY_NOT_TARED = 5,
    /* another command is still running: [0] its packet type */
    EITS_REPLY_BUSY = 6,
    /* the model is too large: [0] the bytes that a bank, a packet or the memory can hold */
    EITS_REPLY_MODEL_SIZE = 7,
    /* the core rejected the model: [0] eits_status */
    EITS_REPLY_MODEL_INVALID = 8,
    /* the board has too few electrodes: [0] those that the protocol needs; [1] those of the
     * board */
    EITS_REPLY_MODEL_SCAN = 9,
    /* the bytes that arrived do not have the checksum that MODEL_BEGIN announced */
    EITS_REPLY_MODEL_CRC = 10,
    /* MODEL_DATA came out of order: [0] the expected offset; -1: no upload has begun */
    EITS_REPLY_OFFSET = 11,
    /* erasing or programming failed: [0] the offset */
    EITS_REPLY_FLASH = 12,
    /* the core reported an error: [0] eits_status */
    EITS_REPLY_CORE = 13,
    /* the samples do not span whole excitation periods: [0] the nearest number that does */
    EITS_REPLY_PERIODS = 14,
    /* the frame period is too short: [0] the shortest one for this scan, us */
    EITS_REPLY_TOO_FAST = 15,
    /* the self-test failed: [0] difference from the golden image in parts per 1e9 of its peak */
    EITS_REPLY_SELF_TEST = 16,
    /* the owner has locked the board: hold its blue button */
    EITS_REPLY_LOCKED = 17,
    /* the current was above its limit: send CLEAR_FAULTS first */
    EITS_REPLY_TRIPPED = 18,
    /* touches after each drive need a model with fields, a reference that is not tracked, full
     * scans, and every frame streamed */
    EITS_REPLY_DRIVES = 19
} eits_reply_status;

/* Bits of a row's quality byte. */
typedef enum eits_quality {
    /* a sample lay at either end of the converter's range */
    EITS_QUALITY_SATURATED = 1,
    /* the multiplexers were switched later than the settling time before the first sample */
    EITS_QUALITY_UNSETTLED = 2,
    /* the row and its reciprocal disagree (in full scans and checks) */
    EITS_QUALITY_RECIPROCITY = 4,
    /* the row was not measured, and has its reciprocal's value */
    EITS_QUALITY_COPIED = 8,
    /* one of its electrodes seems to be open. Set only without a reference and during a tare; later
     * the core finds open electrodes */
    EITS_QUALITY_OPEN = 16,
    /* the row is left out by MASK_ROW */
    EITS_QUALITY_MASKED = 32
} eits_quality;

/* Faults of the board or the skin, and the meaning of index, value and words. */
typedef enum eits_fault {
    /* no bank holds a valid model; value: eits_status of the newest bank */
    EITS_FAULT_NO_MODEL = 1,
    /* an electrode is open; index: electrode */
    EITS_FAULT_ELECTRODE_OPEN = 2,
    /* rows are saturated; index: the first; value: their number */
    EITS_FAULT_SATURATED = 3,
    /* a frame took longer than the frame period; value: by how many us */
    EITS_FAULT_DEADLINE = 4,
    /* reciprocal rows disagree; index: the worst row; value: its difference in parts per thousand
     * of the rms voltage */
    EITS_FAULT_RECIPROCITY = 5,
    /* the core rejected the frame; value: eits_status */
    EITS_FAULT_SOLVER = 6,
    /* the converter or its DMA delivered nothing in time */
    EITS_FAULT_SCAN_STALLED = 7,
    /* the board restarted after a processor fault; words: pc, lr, cfsr, hfsr, address */
    EITS_FAULT_CRASH = 8,
    /* the board restarted because the program hung */
    EITS_FAULT_WATCHDOG = 9,
    /* writing to the generator or the multiplexers failed */
    EITS_FAULT_BUS = 10,
    /* electrodes are bridged; index: one of them; value: its partner, or -1 if more than two are
     * bridged; words[0], [1]: bit e for each such electrode e */
    EITS_FAULT_BRIDGED = 11,
    /* an electrode is noisy; index: electrode */
    EITS_FAULT_ELECTRODE_NOISY = 12,
    /* no change of the skin explains the frame; value: the unexplained parts per thousand of the
     * data, or 0 if the signs of rows show it */
    EITS_FAULT_MODEL_MISMATCH = 13,
    /* frames change in a way that touches cannot; only solved frames raise it, and a tare clears
     * it */
    EITS_FAULT_STALE_REFERENCE = 14,
    /* the reference is unlike the model's; only solved frames raise it, and a tare clears it */
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

/* ELECTRODE_OPEN, SATURATED and BRIDGED are raised by the first frame that shows them.
 * MODEL_MISMATCH, ELECTRODE_NOISY, STALE_REFERENCE and UNLIKE_MODEL are raised by the third
 * consecutive frame that shows them (RAISE), since a touch that lands within a scan causes one such
 * frame. Each of these faults is cleared by the eighth consecutive frame without it (CLEAR). */
#define EITS_FAULT_RAISE_FRAMES 3u
#define EITS_FAULT_CLEAR_FRAMES 8u

/* Bits of a RAW's flags. */
typedef enum eits_raw_flags {
    /* the frame belongs to a tare */
    EITS_RAW_REFERENCE = 1,
    /* only one row of each reciprocal pair was measured */
    EITS_RAW_RECIPROCAL = 2,
    /* a full scan between half ones, which checks reciprocity */
    EITS_RAW_CHECK = 4,
    /* the tracker brought all rows to the instant of the last drive */
    EITS_RAW_ALIGNED = 8,
    /* the frame was solved: touches explain its drives, or frames have not been explained for a
     * while */
    EITS_RAW_TRUSTED = 16,
    /* the tracker began with this frame */
    EITS_RAW_BEGUN = 32
} eits_raw_flags;

/* Bits that choose what is streamed for each frame. */
typedef enum eits_stream {
    /* its voltages, as a RAW */
    EITS_STREAM_RAW = 1,
    /* its image, as an IMAGE */
    EITS_STREAM_IMAGE = 2,
    /* its touches, as TOUCHES */
    EITS_STREAM_TOUCHES = 4,
    /* its events, as EVENTS, also if there are none; a tare forgets the fingers */
    EITS_STREAM_EVENTS = 8,
    /* touches after each drive, as DRIVE_TOUCHES */
    EITS_STREAM_DRIVE_TOUCHES = 16
} eits_stream;

/* The board, its model and its settings. New fields are added at the end. */
typedef struct eits_packet_info {
    /* that of the GET_INFO which asked; 0 after a restart */
    uint32_t request;
    /* major, minor, patch, 0 */
    uint8_t firmware[4];
    /* the kind of board, such as nucleo_f767zi; zero-filled */
    char board[16];
    /* the processor's serial number, hexadecimal, zero-filled */
    char serial[24];
    /* processor clock, Hz */
    uint32_t f_cpu_hz;
    /* electrodes that the multiplexers can reach */
    uint32_t electrodes;
    /* the size of a bank: the most bytes of a model */
    uint32_t bank_bytes;
    /* the most bytes in one MODEL_DATA */
    uint32_t data_bytes;
    /* size of the model in use; 0: no model */
    uint32_t model_bytes;
    /* CRC-32 of the whole model file, as zlib's crc32 */
    uint32_t model_crc;
    /* hash of the protocol that is scanned */
    uint64_t protocol_hash;
    /* electrodes of the model; the fields down to storage describe the model, too */
    uint32_t n_electrodes;
    /* rows of its protocol */
    uint32_t n_rows;
    /* rows that are left when reciprocal ones are averaged */
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
    /* the bank that holds the model */
    uint32_t bank;
    /* excitation frequency, as the generator's tuning word gives it */
    uint32_t excitation_millihz;
    /* sample rate of the converter */
    uint32_t sample_rate_hz;
    /* samples per measurement */
    uint16_t samples;
    /* settling time before the first sample */
    uint16_t settle_us;
    /* time from one measurement to the next; 0, as all numbers of the scan, if the frames come from
     * another instrument */
    uint32_t slot_us;
    /* every n-th frame is scanned fully; 1: all frames; 0: none */
    uint16_t check_every;
    /* bits of eits_stream: what is streamed */
    uint16_t streaming;
    /* every n-th frame is streamed */
    uint16_t every;
    /* 1: there is a reference */
    uint16_t tared;
    /* time from one frame to the next; 0: as fast as the scan allows */
    uint32_t frame_period_us;
    /* bit k: fault number k is raised */
    uint32_t faults;
    /* voltage between the electrodes that is one step of the converter */
    uint32_t volts_per_code_nv;
    /* eits_drive: whether current may flow */
    uint16_t drive;
    /* bits of eits_setting */
    uint16_t settings;
    /* current that the source gives as built; 0: not known */
    uint32_t source_ua_rms;
    /* current as last measured; 0: there is no sense resistor, or no current */
    uint32_t current_ua_rms;
    /* current above which the drive is switched off; 0: no limit */
    uint32_t current_limit_ua_rms;
    /* name that the owner gave the board, zero-filled; empty: none */
    char name[32];
    /* amplitude of the current source; 0: not known */
    uint32_t source_ua;
    /* volts at the converter per volt between the electrodes, in millionths; 0: not known */
    uint32_t gain_ppm;
    /* present level of the button's pin; 2: there is no button */
    uint32_t button;
    /* must be 0 */
    uint32_t reserved;
} eits_packet_info;

/* The result of the command with this request number. */
typedef struct eits_packet_reply {
    /* request number of the command that is answered */
    uint32_t request;
    /* its packet type */
    uint16_t command;
    /* eits_reply_status */
    uint16_t status;
    /* meaning depends on the status */
    int32_t detail[2];
} eits_packet_reply;

/* A scanned frame. It is followed by n_rows voltages, V, in the protocol's order, exactly as the
 * board's core got them, NaN for a row that could not be used; then by n_rows quality bytes. */
typedef struct eits_packet_raw {
    /* counts scanned frames; wraps */
    uint32_t frame;
    /* when its scan began, on the board's clock; wraps */
    uint32_t time_us;
    /* how long the scan took */
    uint32_t scan_us;
    /* number of voltages, and of quality bytes, that follow */
    uint16_t n_rows;
    /* bits of eits_raw_flags */
    uint16_t flags;
} eits_packet_raw;

/* The head of IMAGE and TOUCHES: the numbers of eits_info, and times. */
typedef struct eits_packet_solved {
    /* number of the scanned frame, as in its RAW */
    uint32_t frame;
    /* when its scan began */
    uint32_t time_us;
    /* how long the solve took */
    uint32_t solve_us;
    /* how long the touches took */
    uint32_t touch_us;
    /* time from the end of its scan until this packet was made */
    uint32_t age_us;
    /* pixels or touches that follow */
    uint16_t count;
    /* 0, or minus the eits_status of a rejected frame, whose image is zero and which has no
     * touches */
    uint16_t status;
    /* eits_stop: why the solver stopped */
    uint8_t stop;
    /* eits_shown: which image shows the frame; 0 if no touches were looked for */
    uint8_t shown;
    /* rows left out */
    uint16_t masked;
    /* iterations of the solver */
    uint32_t iterations;
    /* coefficients that are not zero */
    uint32_t nonzeros;
    /* multiply-accumulates of the solve */
    uint32_t macs;
    /* multiply-accumulates of the touches */
    uint32_t touch_macs;
    /* lambda as used for this frame */
    float lambda;
    /* the least lambda whose image is zero */
    float lambda_max;
    /* max(S'y) of noise, as the reference showed it; 0: unknown */
    float lambda_noise;
    /* relative duality gap */
    float gap_rel;
    /* norm of the residual */
    float residual;
    /* norm of the reduced data */
    float data_norm;
    /* bits of eits_diagnostic */
    uint32_t diagnostics;
    /* saturated rows, masked ones not counted: at the converter's limit or beyond the core's */
    uint16_t saturated;
    /* rows left out as outliers */
    uint16_t outliers;
    /* fraction of the data that lies outside the model's range */
    float model_mismatch;
    /* bit e: electrode e is open */
    uint64_t open_electrodes;
    /* bit e: electrode e is bridged with another one */
    uint64_t bridged_electrodes;
    /* bit e: electrode e is noisy */
    uint64_t noisy_electrodes;
} eits_packet_solved;

/* A touch, like eits_touch. */
typedef struct eits_packet_touch {
    /* number from 1 that stays with a touch from frame to frame */
    uint32_t id;
    /* x of the centre, in the model's coordinates */
    float x_mm;
    /* y of the centre */
    float y_mm;
    /* radius of the fitted disc */
    float radius_mm;
    /* change of conductivity times area, S mm^2/m */
    float strength_s_per_m_mm2;
    /* fraction of the data that only this touch explains, 0 to 1; 0: it was not found in this
     * frame, and is held */
    float explained;
    /* force, N; 0 if the model is not calibrated */
    float force_n;
    /* probability that this is exactly one touch; 0: not known */
    float confidence;
    /* covariance of the centre, with the next two; 0: not known */
    float x_variance_mm2;
    float xy_covariance_mm2;
    float y_variance_mm2;
    /* half of an ellipse's long axis, as a vector; 0, 0: a disc, or not known */
    float long_x_mm;
    float long_y_mm;
    /* standard deviation of the radius; 0: the data do not determine the radius */
    float radius_sd_mm;
    /* 1: a whole frame has shown it */
    uint32_t confirmed;
} eits_packet_touch;

/* Touches at an instant within a scan. While nothing touches the skin, the packet is sent only
 * once: after the tracker has begun, or after the last touch has gone. */
typedef struct eits_packet_drive_touches {
    /* number of the frame that is scanned */
    uint32_t frame;
    /* the instant for which they hold: the middle of the drive, as if no row had been repeated */
    uint32_t time_us;
    /* the frame with which the tracker began */
    uint32_t begun;
    /* time from the end of the drive until this packet was made; at most 65,535 */
    uint16_t age_us;
    /* the part of it that the tracker took; at most 65,535 */
    uint16_t update_us;
    /* number of the drive; drives are in the order of their first rows */
    uint16_t drive;
    /* touches that follow */
    uint16_t count;
} eits_packet_drive_touches;

/* A touch, like eits_fast_touch. */
typedef struct eits_packet_drive_touch {
    /* number from 1 that stays with a touch, the same as in TOUCHES */
    uint16_t id;
    /* 1: a whole frame has shown it */
    uint16_t confirmed;
    /* x of the centre, in the model's coordinates */
    float x_mm;
    /* y of the centre */
    float y_mm;
    /* velocity */
    float vx_mm_per_s;
    float vy_mm_per_s;
    /* change of conductivity times area, S mm^2/m */
    float strength_s_per_m_mm2;
    /* radius of the disc with which the touch is modelled */
    float radius_mm;
    /* covariance of the centre, with the next two */
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

/* One event, like eits_event (gesture_events.h), at its frame's time. The host adds zones. */
typedef struct eits_packet_event {
    /* eits_event_kind */
    uint16_t kind;
    /* eits_event_phase */
    uint16_t phase;
    /* id that the touch had when it landed */
    uint32_t first_id;
    /* id of the second of two fingers; 0 for gestures of one finger */
    uint32_t second_id;
    /* place of the event */
    float x_mm;
    float y_mm;
    /* direction of a swipe: 0 along x, 90 along y */
    float direction_deg;
    /* meaning depends on the kind */
    float value;
} eits_packet_event;

/* Stages that are timed. */
typedef enum eits_stage {
    /* the scan, from a frame's first measurement to its last */
    EITS_STAGE_SCAN = 0,
    /* processor time that interrupts take during the scan */
    EITS_STAGE_DEMODULATE = 1,
    /* frame stage and solver */
    EITS_STAGE_SOLVE = 2,
    /* touch detection and fit, if touches are streamed */
    EITS_STAGE_TOUCHES = 3,
    /* the rest between the scan and the end of the frame: packets are made and queued */
    EITS_STAGE_SEND = 4,
    /* the whole frame */
    EITS_STAGE_FRAME = 5
} eits_stage;
#define EITS_STAGES 6u

/* Times of one stage. */
typedef struct eits_stage_stats {
    /* frames that were timed */
    uint32_t count;
    /* time of the last such frame */
    uint32_t last_us;
    /* 99th percentile: the upper edge of its bin, an eighth of an octave wide */
    uint32_t p99_us;
    /* longest time since the start, or since GET_STATS set the times to zero */
    uint32_t worst_us;
} eits_stage_stats;

/* The board's counters. */
typedef struct eits_packet_stats {
    /* that of the GET_STATS which asked */
    uint32_t request;
    /* time since the start */
    uint32_t uptime_ms;
    /* frames that were scanned, streamed or not */
    uint32_t frames_scanned;
    /* frames that were solved because image or touches are streamed */
    uint32_t frames_solved;
    /* packets sent since the link came up */
    uint32_t packets_sent;
    /* packets that were dropped; each still takes a sequence number */
    uint32_t packets_dropped;
    /* frame periods missed */
    uint32_t deadlines_missed;
    /* measurements repeated because the multiplexers switched too late */
    uint32_t slots_repeated;
    /* rows left out as outliers in all frames since the reference was taken */
    uint32_t outliers;
    /* commands received */
    uint32_t link_packets;
    /* whole packets whose checksum does not fit */
    uint32_t link_crc_errors;
    /* packets that ended inside a COBS block, or shorter than head and checksum */
    uint32_t link_framing_errors;
    /* packets longer than the receive buffer */
    uint32_t link_overruns;
    /* bytes reserved for the stack */
    uint32_t stack_bytes;
    /* the most bytes of it used so far */
    uint32_t stack_used;
    /* bytes reserved for the model's context and its frames */
    uint32_t workspace_bytes;
    /* bytes of it that the model in use takes */
    uint32_t workspace_used;
    /* times, indexed by eits_stage */
    eits_stage_stats stage[6];
} eits_packet_stats;

/* A fault that was raised or cleared. */
typedef struct eits_packet_fault {
    /* eits_fault */
    uint16_t code;
    /* 1: the fault was raised; 0: it was cleared */
    uint16_t raised;
    /* the frame in which that happened */
    uint32_t frame;
    /* index, value and words: their meaning depends on the code (eits_fault) */
    int32_t index;
    int32_t value;
    /* 0 if the code has none */
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
    /* bits of eits_stream; 0 stops the stream */
    uint16_t what;
    /* stream every n-th frame; at least 1 */
    uint16_t every;
    /* stop after this many streamed frames; 0: stream until stopped */
    uint32_t frames;
} eits_command_stream;

/* Take the reference. The reply comes when that is done. */
typedef struct eits_command_tare {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* frames to take: 1, or 4 to 1024; 0: restore the reference from before the last tare, if it
     * was kept */
    uint32_t frames;
} eits_command_tare;

/* Set how frames are scanned. The board forgets its reference. */
typedef struct eits_command_scan {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* excitation frequency: 1,000 to 250,000,000, below half the sample rate */
    uint32_t excitation_millihz;
    /* sample rate of the converter: 1,000 to 5,000,000 */
    uint32_t sample_rate_hz;
    /* samples per measurement: 4 to 1024 */
    uint16_t samples;
    /* settling time before the first sample: at most 50,000 */
    uint16_t settle_us;
    /* 1: every frame is scanned fully; n > 1: only every n-th one, the others with one row of each
     * reciprocal pair; 0: none is scanned fully */
    uint16_t check_every;
    /* must be 0 */
    uint16_t reserved;
    /* time from one frame to the next: at most 600,000,000; 0: as fast as the scan allows */
    uint32_t frame_period_us;
} eits_command_scan;

/* Set the solver's options, from the next frame on until another model or a restart. */
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
    /* multiply-accumulates per frame; 0: no limit */
    uint32_t mac_limit;
    /* bits of eits_diagnostic that are looked for */
    uint32_t diagnostics;
} eits_command_solver;

/* Begin the upload of a model. */
typedef struct eits_command_model_begin {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* size of the model, at least 64 */
    uint32_t bytes;
    /* CRC-32 of the whole model */
    uint32_t crc;
} eits_command_model_begin;

/* Bytes of the model follow. Their number is a multiple of 4, except in the last packet. */
typedef struct eits_command_model_data {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* offset of the first byte within the model */
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
    /* row of the protocol */
    uint16_t row;
    /* 1: leave it out; 0: use it again */
    uint16_t masked;
} eits_command_mask_row;

/* Whether current may flow through the skin, and if not, why. */
typedef enum eits_drive {
    /* off: no host has asked for frames */
    EITS_DRIVE_OFF = 0,
    /* on: a host has asked for frames, and still sends packets */
    EITS_DRIVE_ON = 1,
    /* off: no packet came from the host for a second */
    EITS_DRIVE_SILENT = 2,
    /* off: the current was above its limit */
    EITS_DRIVE_TRIPPED = 3
} eits_drive;

/* Bits of the owner's settings. */
typedef enum eits_setting {
    /* the current keeps flowing when no host listens */
    EITS_SETTING_KEEP_CURRENT = 1,
    /* changing models or settings, or lowering the excitation frequency, needs the blue button */
    EITS_SETTING_LOCKED = 2,
    /* a sense resistor is fitted, and the current is measured */
    EITS_SETTING_SENSE = 4,
    /* a pressed button pulls its pin low; without this bit it pulls it high */
    EITS_SETTING_BUTTON_LOW = 8
} eits_setting;

/* Says that the host is present. Every command does that; this one does nothing else, and is not
 * answered. */
typedef struct eits_command_keepalive {
    /* ignored */
    uint32_t request;
    /* 1: the host is present; 0: it leaves, and the current stops now */
    uint32_t present;
} eits_command_keepalive;

/* Replace all of the owner's settings. They survive a loss of power. */
typedef struct eits_command_settings {
    /* never 0; the reply repeats it */
    uint32_t request;
    /* bits of eits_setting */
    uint32_t settings;
    /* limit of the current: at most 10,000; 0: 1.25 times what the source gives; 2^32 - 1:
     * unchanged */
    uint32_t current_limit_ua_rms;
    /* the board's name. It has letters, digits, - and _, and begins with a letter or digit;
     * zero-filled; empty: none */
    char name[32];
    /* amplitude of the current source as fitted, 10 to 7,000; 0: as designed; 2^32 - 1:
     * unchanged */
    uint32_t source_ua;
    /* gain from electrodes to converter as fitted, 10,000 to 400,000,000; 0: as designed; 2^32 - 1:
     * unchanged */
    uint32_t gain_ppm;
} eits_command_settings;

/* SHA-256 hashes of what the board's flash holds. */
typedef struct eits_packet_hashes {
    /* that of the GET_HASHES which asked */
    uint32_t request;
    /* hash of the model in use; all zero: no model */
    uint8_t model[32];
    /* hash of the program; all zero: not known */
    uint8_t firmware[32];
} eits_packet_hashes;

/* Measure a burst of one row, switch to a second row, measure a burst of that one, and send the
 * second burst, whose first samples show how it settles. The scan waits meanwhile. */
typedef struct eits_command_probe {
    /* never 0; PROBED repeats it */
    uint32_t request;
    /* electrodes of the first row: I+, I-, V+, V-, 8 bits each, I+ lowest; 2^32 - 1: all are
     * open */
    uint32_t before;
    /* electrodes of the second row, in the same form */
    uint32_t joined;
    /* least time from switching to the first sample; at most 50,000 */
    uint16_t settle_us;
    /* samples per burst, at the sample rate of SCAN: 4 to 1024 */
    uint16_t samples;
    /* 1: the generator runs; 0: it is held in reset */
    uint16_t generator;
    /* must be 0 */
    uint16_t reserved;
} eits_command_probe;

/* A burst of one row. Its samples follow: codes of the converter, u16 each. */
typedef struct eits_packet_probed {
    /* that of the PROBE which asked */
    uint32_t request;
    /* when the burst began, on the board's clock */
    uint32_t start_us;
    /* when its electrodes had been switched */
    uint32_t switched_us;
    /* number of samples that follow */
    uint16_t samples;
    /* 1: the converter lost samples */
    uint16_t lost;
} eits_packet_probed;

#ifdef __cplusplus
}
#endif
#endif
