/* eitskin: packets between a board and a host, and their framing. docs/reference/link-protocol.md
 * specifies the bytes.
 *
 * A packet is an 8-byte head (u8 version, u8 type, u16 bytes of payload, u32 sequence number), a
 * payload and a CRC-32 of both, stuffed by COBS (Cheshire and Baker, IEEE/ACM Trans. Networking 7
 * (1999) 159-172) between two zero bytes. Both sides use this codec: nothing else encodes or
 * decodes.
 */
#ifndef EITSKIN_LINK_H
#define EITSKIN_LINK_H

#include "eitskin/diagnostics.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EITS_LINK_VERSION     3u /* the first byte of every packet; another is refused */
#define EITS_LINK_HEAD        8u
#define EITS_LINK_MAX_PAYLOAD 16384u
#define EITS_LINK_MAX_PACKET  (EITS_LINK_HEAD + EITS_LINK_MAX_PAYLOAD + 4u)
/* Bytes on the wire at most for a payload of `size` bytes: COBS adds one byte in 254, and the two
 * zeros. */
#define EITS_LINK_ENCODED(size) \
    ((size_t)(size) + EITS_LINK_HEAD + 4u + ((size_t)(size) + EITS_LINK_HEAD + 4u) / 254u + 3u)

/* From the board: below 0x80. To the board: from 0x80 on. Numbers are never used again for
 * something else. */
typedef enum eits_packet_type {
    EITS_PACKET_INFO = 0x01,  /* eits_packet_info */
    EITS_PACKET_REPLY = 0x02, /* eits_packet_reply */
    /* eits_packet_raw, n_rows x f32 volts, n_rows x u8 eits_quality */
    EITS_PACKET_RAW = 0x10,
    EITS_PACKET_IMAGE = 0x11,     /* eits_packet_solved, n_pixels x f32 S/m */
    EITS_PACKET_TOUCHES = 0x12,   /* eits_packet_solved, count x eits_packet_touch */
    EITS_PACKET_STATS = 0x13,     /* eits_packet_stats */
    EITS_PACKET_FAULT = 0x14,     /* eits_packet_fault */
    EITS_PACKET_RECORDING = 0x70, /* never on a wire: the first packet of an .eits file, JSON */
    /* payloads of commands: eits_command_*; each begins with the request number */
    EITS_PACKET_GET_INFO = 0x80,
    EITS_PACKET_STREAM = 0x81,
    EITS_PACKET_TARE = 0x82,
    EITS_PACKET_SCAN = 0x83,
    EITS_PACKET_SOLVER = 0x84,
    EITS_PACKET_MODEL_BEGIN = 0x85,
    EITS_PACKET_MODEL_DATA = 0x86,
    EITS_PACKET_MODEL_COMMIT = 0x87,
    EITS_PACKET_GET_STATS = 0x88,
    EITS_PACKET_MASK_ROW = 0x89,
    EITS_PACKET_RESET = 0x8A,
    EITS_PACKET_SELF_TEST = 0x8B,
    EITS_PACKET_CLEAR_FAULTS = 0x8C
} eits_packet_type;

/* How a command ended. `detail` of the reply says more, as noted. */
typedef enum eits_reply_status {
    EITS_REPLY_OK = 0,
    EITS_REPLY_UNKNOWN_COMMAND = 1,
    EITS_REPLY_LENGTH = 2, /* detail[0]: bytes expected */
    /* detail[0]: byte offset in the payload of the field out of range; detail[1]: the limit that
     * it broke */
    EITS_REPLY_RANGE = 3,
    EITS_REPLY_NO_MODEL = 4,
    EITS_REPLY_NOT_TARED = 5,
    EITS_REPLY_BUSY = 6, /* detail[0]: type of the command that is under way */
    /* detail[0]: most bytes that a bank holds, or the board's memory allows */
    EITS_REPLY_MODEL_SIZE = 7,
    EITS_REPLY_MODEL_INVALID = 8, /* detail[0]: eits_status */
    /* the model's protocol cannot be scanned: detail[0] electrodes it needs, detail[1]
     * electrodes there are */
    EITS_REPLY_MODEL_SCAN = 9,
    EITS_REPLY_MODEL_CRC = 10, /* what arrived is not what MODEL_BEGIN announced */
    EITS_REPLY_OFFSET = 11,    /* MODEL_DATA out of order: detail[0] the offset expected */
    EITS_REPLY_FLASH = 12,     /* erase or programming failed: detail[0] the offset */
    EITS_REPLY_CORE = 13,      /* detail[0]: eits_status of the solver */
    /* samples are no whole number of excitation periods: detail[0] the nearest number that is */
    EITS_REPLY_PERIODS = 14,
    EITS_REPLY_TOO_FAST = 15, /* detail[0]: least frame period that this scan needs, us */
    /* the golden frame's image differs: detail[0] parts in 1e9 of the peak */
    EITS_REPLY_SELF_TEST = 16
} eits_reply_status;

/* Bits of a row's quality byte. */
typedef enum eits_quality {
    EITS_QUALITY_SATURATED = 1, /* a sample lay at either end of the converter's range */
    /* the multiplexers were switched later than the settling time before the first sample */
    EITS_QUALITY_UNSETTLED = 2,
    EITS_QUALITY_RECIPROCITY = 4, /* it and its reciprocal disagree (full scans and checks) */
    EITS_QUALITY_COPIED = 8,      /* not measured: its reciprocal's value */
    /* one of its electrodes is taken to be open, before a tare or in it; after it the core tells */
    EITS_QUALITY_OPEN = 16,
    EITS_QUALITY_MASKED = 32 /* left out by MASK_ROW */
} eits_quality;

typedef enum eits_fault {
    /* no bank holds a valid model; value: eits_status of the newest */
    EITS_FAULT_NO_MODEL = 1,
    EITS_FAULT_ELECTRODE_OPEN = 2, /* index: electrode */
    EITS_FAULT_SATURATED = 3,      /* index: first row; value: number of rows */
    EITS_FAULT_DEADLINE = 4,       /* a frame took longer than the frame period; value: us over */
    /* index: worst row; value: parts per thousand of the rms voltage */
    EITS_FAULT_RECIPROCITY = 5,
    EITS_FAULT_SOLVER = 6,       /* value: eits_status */
    EITS_FAULT_SCAN_STALLED = 7, /* the converter or its DMA gave nothing in time */
    /* the board restarted after a processor fault: words are pc, lr, cfsr, hfsr, address */
    EITS_FAULT_CRASH = 8,
    EITS_FAULT_WATCHDOG = 9, /* the board restarted because the program hung */
    EITS_FAULT_BUS = 10,     /* the generator or the multiplexers could not be written */
    /* what the core found in a frame (diagnostics.h); so are 2 and 3 after a tare */
    /* index: electrode; value: its partner, -1 where there are more; words: all, bit e */
    EITS_FAULT_BRIDGED = 11,
    EITS_FAULT_ELECTRODE_NOISY = 12, /* index: electrode */
    /* value: parts per thousand of the data that nothing in the range of the model's gives */
    EITS_FAULT_MODEL_MISMATCH = 13,
    EITS_FAULT_STALE_REFERENCE = 14
} eits_fault;
#define EITS_FAULTS 15u

/* ELECTRODE_OPEN, SATURATED and BRIDGED are raised in the frame that shows them, and those after it
 * with the third in a row, since a touch that lands within a scan gives one such frame; all these
 * are gone after so many frames in a row that do not. */
#define EITS_FAULT_RAISE_FRAMES 3u
#define EITS_FAULT_CLEAR_FRAMES 8u

/* Bits of eits_packet_raw.flags */
#define EITS_RAW_REFERENCE  1u /* a frame of a tare */
#define EITS_RAW_RECIPROCAL 2u /* only reciprocal-unique rows were measured */
#define EITS_RAW_CHECK      4u /* a full scan among reciprocal ones, for the check of reciprocity */

/* Bits of eits_command_stream.what and of eits_packet_info.streaming */
#define EITS_STREAM_RAW     1u
#define EITS_STREAM_IMAGE   2u
#define EITS_STREAM_TOUCHES 4u

/* ---- payloads: little-endian, no padding; sizes are asserted in link.c ---- */

typedef struct eits_packet_info {
    uint32_t request;    /* of the GET_INFO that asked; 0 after a restart */
    uint8_t firmware[4]; /* major, minor, patch, 0 */
    char board[16];      /* "nucleo_f767zi", ended by zeros */
    char serial[24];     /* of the processor, hexadecimal */
    uint32_t f_cpu_hz;
    uint32_t electrodes;    /* that the multiplexers reach */
    uint32_t bank_bytes;    /* most bytes of a model */
    uint32_t data_bytes;    /* most bytes in one MODEL_DATA */
    uint32_t model_bytes;   /* 0: no model */
    uint32_t model_crc;     /* CRC-32 of the whole file, as zlib's crc32 */
    uint64_t protocol_hash; /* of the table that is scanned */
    uint32_t n_electrodes, n_rows, n_folded, rank, n_pixels, nx, ny, storage; /* of the model */
    uint32_t bank;               /* that the model is in */
    uint32_t excitation_millihz; /* as the generator's tuning word gives it */
    uint32_t sample_rate_hz;
    uint16_t samples; /* per measurement */
    uint16_t settle_us;
    uint32_t slot_us;     /* from one measurement to the next */
    uint16_t check_every; /* every n-th frame is scanned fully; 1: all; 0: none is */
    uint16_t streaming;   /* EITS_STREAM_* */
    uint16_t every;       /* n-th frame that is streamed */
    uint16_t tared;
    uint32_t frame_period_us;   /* 0: as fast as the scan goes */
    uint32_t faults;            /* bit k: fault number k is raised */
    uint32_t volts_per_code_nv; /* at the electrodes, of one step of the converter */
} eits_packet_info;

typedef struct eits_packet_reply {
    uint32_t request;
    uint16_t command;
    uint16_t status; /* eits_reply_status */
    int32_t detail[2];
} eits_packet_reply;

typedef struct eits_packet_raw {
    uint32_t frame;   /* counts scanned frames; wraps */
    uint32_t time_us; /* when its scan began; wraps */
    uint32_t scan_us; /* how long it took */
    uint16_t n_rows;
    uint16_t flags;
} eits_packet_raw;

/* Head of IMAGE and TOUCHES: what eits_info says, and the times. */
typedef struct eits_packet_solved {
    uint32_t frame;
    uint32_t time_us; /* when its scan began */
    uint32_t solve_us, touch_us;
    uint32_t age_us; /* from the end of its scan until this packet was made */
    uint16_t count;  /* pixels or touches that follow */
    /* 0, or minus an eits_status: then the image is zero and there are no touches */
    uint16_t status;
    uint16_t stop; /* eits_stop */
    uint16_t masked;
    uint32_t iterations, nonzeros;
    uint32_t macs, touch_macs;
    float lambda, lambda_max, lambda_noise, gap_rel, residual, data_norm;
    uint32_t diagnostics; /* bits of eits_diagnostic */
    uint16_t saturated;   /* rows at either end of the converter's range, masked ones apart */
    uint16_t outliers;    /* rows left out as outliers */
    float model_mismatch;
    uint64_t open_electrodes, bridged_electrodes, noisy_electrodes; /* bit e: electrode e */
} eits_packet_solved;

typedef struct eits_packet_touch {
    uint32_t id;
    float x_mm, y_mm, radius_mm, strength_s_per_m_mm2, confidence;
    float force_n; /* 0 where the model is not calibrated */
} eits_packet_touch;

/* Stages that are timed, in microseconds. */
typedef enum eits_stage {
    EITS_STAGE_SCAN = 0,
    EITS_STAGE_DEMODULATE = 1,
    EITS_STAGE_SOLVE = 2,
    EITS_STAGE_TOUCHES = 3,
    EITS_STAGE_SEND = 4,
    EITS_STAGE_FRAME = 5
} eits_stage;
#define EITS_STAGES 6u

typedef struct eits_stage_stats {
    /* p99: upper edge of its bin, an eighth of an octave wide */
    uint32_t count, last_us, p99_us, worst_us;
} eits_stage_stats;

typedef struct eits_packet_stats {
    uint32_t request;
    uint32_t uptime_ms;
    uint32_t frames_scanned, frames_solved;
    /* since the link came up; a dropped packet still takes a sequence number */
    uint32_t packets_sent, packets_dropped;
    uint32_t deadlines_missed;
    /* measurements taken again because the switch came too late */
    uint32_t slots_repeated;
    /* rows left out as outliers, of all frames after a tare */
    uint32_t outliers;
    uint32_t link_packets, link_crc_errors, link_framing_errors, link_overruns;
    uint32_t stack_bytes, stack_used; /* used: the most so far */
    uint32_t workspace_bytes, workspace_used;
    eits_stage_stats stage[6]; /* by eits_stage */
} eits_packet_stats;

typedef struct eits_packet_fault {
    uint16_t code;   /* eits_fault */
    uint16_t raised; /* 1: it is there, 0: it has gone */
    uint32_t frame;
    int32_t index, value;
    uint32_t words[5];
} eits_packet_fault;

/* GET_INFO, MODEL_COMMIT, RESET, SELF_TEST, CLEAR_FAULTS */
typedef struct eits_command_plain {
    uint32_t request;
} eits_command_plain;

typedef struct eits_command_stream {
    uint32_t request;
    uint16_t what;   /* EITS_STREAM_*; 0 stops */
    uint16_t every;  /* at least 1 */
    uint32_t frames; /* so many streamed frames, then stop; 0: until told */
} eits_command_stream;

/* 1, or 4 to 1024; replied when done */
typedef struct eits_command_tare {
    uint32_t request, frames;
} eits_command_tare;

typedef struct eits_command_scan {
    uint32_t request;
    uint32_t excitation_millihz; /* 1 Hz to 250 kHz */
    uint32_t sample_rate_hz;
    uint16_t samples;
    uint16_t settle_us;
    /* 1: every frame is full; n > 1: reciprocal-unique, every n-th full; 0: never full */
    uint16_t check_every;
    uint16_t reserved;
    uint32_t frame_period_us;
} eits_command_scan; /* forgets the tare */

typedef struct eits_command_solver {
    uint32_t request;
    uint32_t iterations, max_touches, warm_start, sign;
    float lambda_rel, gap_rel;
    uint32_t solver;      /* eits_solver */
    uint32_t mac_limit;   /* 0: none */
    uint32_t diagnostics; /* bits of eits_diagnostic that are looked for */
    /* 1: touches are followed in time (eits_options_track), as after a start; 0: each frame by
     * itself */
    uint32_t track;
} eits_command_solver;

/* stops the scan */
typedef struct eits_command_model_begin {
    uint32_t request, bytes, crc;
} eits_command_model_begin;
/* bytes follow: a multiple of 4, but for the last */
typedef struct eits_command_model_data {
    uint32_t request, offset;
} eits_command_model_data;
typedef struct eits_command_get_stats {
    uint32_t request, reset;
} eits_command_get_stats;
typedef struct eits_command_mask_row {
    uint32_t request;
    uint16_t row, masked;
} eits_command_mask_row;

/* ---- codec ---- */

/* Encode one packet from a payload in two parts (either may be empty) into `out`. Returns its bytes
 * on the wire, or 0 if `room` is less than EITS_LINK_ENCODED(head_size + body_size) or the payload
 * is longer than EITS_LINK_MAX_PAYLOAD. */
size_t eits_link_encode(uint8_t *out, size_t room, uint8_t type, uint32_t sequence,
                        const void *head, size_t head_size, const void *body, size_t body_size);

typedef struct eits_link_packet {
    uint8_t type;
    uint32_t sequence;
    /* inside the decoder's buffer, 4-byte aligned, until the next eits_link_feed */
    const uint8_t *payload;
    size_t size;
} eits_link_packet;

/* State of decoding a stream of bytes; the caller owns the buffer. */
typedef struct eits_link_decoder {
    uint8_t *buffer; /* 8-byte aligned */
    size_t room, used;
    uint8_t left, code, in_packet, broken;
    uint32_t packets;        /* accepted */
    uint32_t crc_errors;     /* whole COBS frames whose checksum does not fit */
    uint32_t framing_errors; /* ended inside a COBS block, or shorter than head and checksum */
    uint32_t overruns;       /* longer than the buffer */
    uint32_t version_errors; /* checksum fits, but of another protocol version */
    uint8_t other_version;   /* the last such */
} eits_link_decoder;

/* Errors: EITS_E_ARGUMENT (no buffer, not 8-byte aligned, or room below EITS_LINK_HEAD + 4). */
eits_status eits_link_decoder_init(eits_link_decoder *decoder, uint8_t *buffer, size_t room);

/* Take bytes until a packet is whole or they end. Returns how many were taken; `packet->payload` is
 * NULL if none is whole. */
size_t eits_link_feed(eits_link_decoder *decoder, const uint8_t *bytes, size_t size,
                      eits_link_packet *packet);

#ifdef __cplusplus
}
#endif
#endif
