#include "track.h"

#include "vec.h"

void eits_track(eits_context *ctx, eits_touch *touches, uint32_t count)
{
    const eits_real limit = ctx->options.follow_mm * ctx->options.follow_mm;
    uint8_t taken[EITS_MAX_TOUCHES] = {0};
    for (uint32_t k = 0; k < count; ++k)
        touches[k].id = 0;
    for (;;) { /* at most EITS_MAX_TOUCHES pairs */
        eits_real nearest = limit;
        uint32_t from = EITS_MAX_TOUCHES, to = EITS_MAX_TOUCHES;
        for (uint32_t k = 0; k < count; ++k) {
            for (uint32_t l = 0; touches[k].id == 0 && l < ctx->last_count; ++l) {
                const eits_real dx = touches[k].x_mm - ctx->last[l].x_mm, dy = touches[k].y_mm - ctx->last[l].y_mm;
                const eits_real squared = eits_fma(dx, dx, dy * dy);
                if (!taken[l] && squared <= nearest) {
                    nearest = squared;
                    from = l;
                    to = k;
                }
            }
        }
        if (to == EITS_MAX_TOUCHES)
            break;
        touches[to].id = ctx->last[from].id;
        taken[from] = 1;
    }
    for (uint32_t k = 0; k < count; ++k) {
        if (touches[k].id == 0) {
            touches[k].id = ctx->next_id;
            ctx->next_id = ctx->next_id == UINT32_MAX ? 1 : ctx->next_id + 1; /* 0 is never an id */
        }
        ctx->last[k] = touches[k];
    }
    ctx->last_count = count;
}
