/* Everything that the application keeps, and how its parts call each other. */
#ifndef FW_INSTRUMENT_H
#define FW_INSTRUMENT_H

#include "app/demodulate.h"
#include "app/diagnostics.h"
#include "app/engine.h"
#include "app/faults.h"
#include "app/quality.h"
#include "app/scan.h"
#include "app/stats.h"
#include "app/store.h"
#include "app/tare.h"
#include "app/tx_queue.h"
#include "drivers/ad9833.h"

#define FW_VERSION_MAJOR     0u
#define FW_VERSION_MINOR     1u
#define FW_VERSION_PATCH     0u
#define FW_DATA_BYTES        4096u /* most model bytes in one MODEL_DATA */
#define FW_RECEIVE_ROOM      (EITS_LINK_HEAD + sizeof(eits_command_model_data) + FW_DATA_BYTES + 4u)
#define FW_READ_BYTES        256u
#define FW_UPLOAD_TIMEOUT_US 10000000u /* without MODEL_DATA: the model in use goes on */
#define FW_RETRY_US          500000u   /* between attempts to start what failed */
#define FW_RECIPROCITY_FRAMES 3u       /* checked frames in a row that raise or clear the fault */

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
    fw_upload upload;
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

typedef struct fw_answer {
    eits_reply_status status;
    int32_t detail[2];
    bool later; /* no answer now: it comes when the command is done, or is a packet of its own */
} fw_answer;

static inline fw_answer fw_refuse(eits_reply_status why, int32_t a, int32_t b)
{
    return (fw_answer){.status = why, .detail = {a, b}};
}

/* Whether a model can be scanned here and its packets and memory have room: OK, MODEL_SCAN or
 * MODEL_SIZE. */
fw_answer fw_model_fits(const fw_instrument *instrument, const eits_model *model);

/* ---- instrument.c ---- */
void fw_instrument_init(fw_instrument *instrument, const fw_board *board);

/* One turn of the main loop; false: nothing was to be done. */
bool fw_instrument_step(fw_instrument *instrument);
int fw_instrument_run(fw_instrument *instrument, const fw_board *board);

uint32_t fw_now_us(const fw_instrument *instrument);

/* Start generator and scan where a model is open and no upload is under way; what cannot be started
 * is tried again. */
void fw_start_scan(fw_instrument *instrument);
void fw_stop_scan(fw_instrument *instrument);

/* Open the newest model that can be used; raises NO_MODEL where there is none. */
void fw_open_newest(fw_instrument *instrument);
void fw_report_no_model(fw_instrument *instrument);

/* A tare that cannot go on is answered, and the last reference put back. */
void fw_fail_tare(fw_instrument *instrument, eits_status why);

/* ---- stream.c ---- */
/* Judge a frame, give it to the tare or the solver, and send what is streamed. */
void fw_process_frame(fw_instrument *instrument, fw_frame *frame);

/* ---- upload.c ---- */
fw_answer fw_upload_begin(fw_instrument *instrument, uint32_t bytes, uint32_t crc);
fw_answer fw_upload_data(fw_instrument *instrument, uint32_t offset, const uint8_t *bytes,
                         size_t size);
fw_answer fw_upload_commit(fw_instrument *instrument);

/* An upload that the host has left: the model in use goes on; it may still be resumed. */
void fw_upload_check(fw_instrument *instrument);

/* ---- report.c ---- */
void fw_send_info(fw_instrument *instrument, uint32_t request);
void fw_send_stats(fw_instrument *instrument, uint32_t request, bool reset);
void fw_send_reply(fw_instrument *instrument, eits_packet_type command, uint32_t request,
                   fw_answer answer);
void fw_send_tare_reply(fw_instrument *instrument, fw_answer answer);

/* ---- commands.c ---- */
void fw_command(fw_instrument *instrument, const eits_link_packet *packet);

#endif
