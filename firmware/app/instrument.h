/* Everything that the application keeps. */
#ifndef FW_INSTRUMENT_H
#define FW_INSTRUMENT_H

#include "app/acquire/demodulate.h"
#include "app/acquire/scan.h"
#include "app/link/stats.h"
#include "app/link/tx_queue.h"
#include "app/safety/faults.h"
#include "app/safety/owner_record.h"
#include "app/solve/diagnostics.h"
#include "app/solve/engine.h"
#include "app/solve/quality.h"
#include "app/solve/store.h"
#include "app/solve/tare.h"
#include "drivers/ad9833.h"

#define FW_VERSION_MAJOR     0u
#define FW_VERSION_MINOR     1u
#define FW_VERSION_PATCH     0u
#define FW_DATA_BYTES        4096u /* most model bytes in one MODEL_DATA */
#define FW_RECEIVE_ROOM      (EITS_LINK_HEAD + sizeof(eits_command_model_data) + FW_DATA_BYTES + 4u)
#define FW_READ_BYTES        256u
#define FW_UPLOAD_TIMEOUT_US 10000000u /* without MODEL_DATA: the model in use goes on */
#define FW_RETRY_US          500000u   /* between attempts to start what failed */

typedef struct fw_stream {
    uint16_t what, every; /* EITS_STREAM_* */
    uint32_t left;        /* streamed frames until it stops; 0: none, if `counted` */
    bool counted;
    uint32_t phase; /* frames until the next one that is streamed */
} fw_stream;

typedef struct fw_upload {
    bool active; /* the scan is stopped for it */
    bool begun;  /* erased for this announcement: may be resumed */
    uint32_t bank, bytes, crc, offset;
    uint32_t last_us; /* of the last command of it */
} fw_upload;

typedef struct fw_drive {
    eits_drive state;
    uint32_t heard_us; /* last packet from the host */
    uint32_t settling; /* frames that are still dropped */
    uint32_t sensed_us, current_ua;
} fw_drive;

/* Touches after each drive (follow.h). */
typedef struct fw_follow {
    volatile bool held;              /* the main loop is at what is shared */
    volatile bool owed;              /* drives wait until owed_frame is brought to one instant */
    volatile bool at_frame;          /* the main loop has a frame */
    bool working, running;           /* drives are being looked at; none was left out since begun */
    uint32_t owed_frame, begun;      /* numbers of frames */
    uint32_t next_first, next_frame; /* of the next drive */
    uint32_t told;                   /* touches in the last packet */
    bool found_any;
    uint32_t found_count;
    eits_touch found[EITS_MAX_TOUCHES]; /* in the last frame that was solved */
} fw_follow;

typedef struct fw_instrument {
    const fw_board *board;
    fw_tx_queue tx_queue;
    fw_faults faults;
    fw_stats stats;
    fw_ad9833 generator;
    fw_demodulator demodulator;
    fw_scan_settings settings;
    fw_scan scan;
    fw_engine engine;
    fw_tare tare;
    fw_stream stream;
    fw_follow follow;
    eits_gestures gestures;
    /* of the frame under way, as they come and as they are sent: too much for the stack */
    eits_event events[EITS_MAX_EVENTS];
    eits_packet_event events_sent[EITS_MAX_EVENTS];
    fw_upload upload;
    fw_drive drive;
    fw_kept kept;     /* the owner's settings */
    fw_record record; /* of the open model's bank */
    uint32_t bank;
    eits_status no_model_why;
    bool reset_wanted;
    bool touched; /* the last solved frame had a touch */
    uint32_t tried_us;
    uint32_t frames_solved, deadlines_missed, last_frame;
    uint32_t outliers;           /* rows, of all frames that the core looked at */
    uint32_t doubtful, agreeing; /* checked frames in a row */
    uint32_t uptime_ms, uptime_us;
    /* the last answer, to be given again when its command is sent again */
    bool answered, tare_reported;
    eits_packet_reply reply, tare_reply;
    bool stats_reported;
    eits_packet_stats last_stats;
    eits_link_decoder decoder;
    _Alignas(8) uint8_t received[(FW_RECEIVE_ROOM + 7u) / 8u * 8u];
    uint8_t chunk[FW_READ_BYTES];
} fw_instrument;

static inline uint32_t fw_now_us(const fw_instrument *instrument)
{
    return instrument->board->system->time_us(instrument->board->system_ctx);
}

#endif
