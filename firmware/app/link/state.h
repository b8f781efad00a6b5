/* The state of the link module. Besides its own files only app/instrument.h may include this file.
 */
#ifndef FW_LINK_STATE_H
#define FW_LINK_STATE_H

#include "app/link/stats.h"
#include "app/link/tx_queue.h"
#include "eitskin/eitskin.h"
#include "eitskin/link.h"

#define FW_DATA_BYTES   4096u /* most model bytes in one MODEL_DATA */
#define FW_RECEIVE_ROOM (EITS_LINK_HEAD + sizeof(eits_command_model_data) + FW_DATA_BYTES + 4u)
#define FW_READ_BYTES   256u

typedef struct fw_stream {
    uint16_t what, every; /* EITS_STREAM_* */
    uint32_t left;        /* streamed frames until it stops, if `counted` */
    bool counted, began;
    uint32_t phase; /* frames until the next one that is streamed */
} fw_stream;

/* The events of the present frame, as the core gives them and as they are sent. They are too large
 * for the stack. */
typedef struct fw_events {
    eits_gestures gestures;
    eits_event found[EITS_MAX_EVENTS];
    eits_packet_event sent[EITS_MAX_EVENTS];
} fw_events;

/* Touches after each drive. The volatile fields are shared with the work of interrupts. */
typedef struct fw_tracks {
    volatile bool held;
    bool working;
    uint32_t reported; /* touches in the last packet */
} fw_tracks;

typedef struct fw_upload {
    bool active; /* the scan is stopped for it */
    bool begun;  /* erased for this announcement: may be resumed */
    uint32_t bank, bytes, crc, offset;
    uint32_t last_us; /* of its last command */
} fw_upload;

/* The last replies, which are repeated if their command is sent again. */
typedef struct fw_replies {
    bool answered, tare_answered, stats_answered;
    eits_packet_reply reply, tare;
    eits_packet_stats stats;
} fw_replies;

struct fw_host_link {
    const fw_board *board;
    struct fw_safety *safety;
    struct fw_acquire *acquire;
    struct fw_solve *solve;
    fw_tx_queue tx_queue;
    fw_stats stats;
    fw_stream stream;
    fw_events events;
    fw_tracks tracks;
    fw_upload upload;
    fw_replies replies;
    bool reset_wanted;
    uint32_t probe_request;
    uint32_t deadlines_missed;
    uint32_t uptime_ms, uptime_us;
    eits_link_decoder decoder;
    _Alignas(8) uint8_t received[(FW_RECEIVE_ROOM + 7u) / 8u * 8u];
    uint8_t chunk[FW_READ_BYTES];
};

#endif
