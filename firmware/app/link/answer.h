/* The answer to a command. */
#ifndef FW_ANSWER_H
#define FW_ANSWER_H

#include "eitskin/link.h"

#include <stdbool.h>

typedef struct fw_answer {
    eits_reply_status status;
    int32_t detail[2];
    bool
        later; /* no reply now: it comes when the command is done, or another packet is the reply */
} fw_answer;

static inline fw_answer fw_refuse(eits_reply_status why, int32_t a, int32_t b)
{
    return (fw_answer){.status = why, .detail = {a, b}};
}

#endif
