#include "app/safety/owner_record.h"

#include "eitskin/model.h"

#include <string.h>

_Static_assert(sizeof(fw_kept) == FW_KEPT_BYTES, "a record is 32 bytes");

typedef struct place {
    uint32_t page, slot; /* the first slot behind the latest record that nothing was written to */
} place;

static const uint8_t *slot_at(const fw_store *store, uint32_t page, uint32_t slot)
{
    return store->ops->bank(store->ctx, FW_BANKS + page) + (size_t)slot * FW_KEPT_BYTES;
}

static bool erased(const uint8_t *slot)
{
    for (uint32_t k = 0; k < FW_KEPT_BYTES; ++k) {
        if (slot[k] != 0xFFu)
            return false;
    }
    return true;
}

/* A record that was cut while it was written is passed over, like one that has decayed. */
static fw_kept find(const fw_store *store, place *next)
{
    fw_kept latest = {0}, one;
    *next = (place){0};
    for (uint32_t page = 0; page < FW_PAGES - FW_BANKS; ++page) {
        uint32_t used = 0;
        bool here = latest.magic == 0 && page == 0;
        for (uint32_t slot = 0; slot < store->page_bytes / FW_KEPT_BYTES; ++slot) {
            const uint8_t *bytes = slot_at(store, page, slot);
            if (erased(bytes))
                continue;
            used = slot + 1u;
            memcpy(&one, bytes, sizeof one);
            if (one.magic != FW_KEPT_MAGIC || one.crc != eits_crc32(0, &one, FW_KEPT_BYTES - 4u))
                continue;
            if (latest.magic != 0 && (int32_t)(one.generation - latest.generation) < 0)
                continue;
            latest = one;
            here = true;
        }
        if (here)
            *next = (place){page, used};
    }
    return latest;
}

fw_kept fw_kept_load(const fw_store *store)
{
    place next;
    return find(store, &next);
}

fw_status fw_kept_save(const fw_store *store, uint32_t settings, uint32_t current_limit_ua_rms)
{
    place next;
    const fw_kept latest = find(store, &next);
    if (store->page_bytes < FW_KEPT_BYTES)
        return FW_E_RANGE;
    if (next.slot == store->page_bytes / FW_KEPT_BYTES) {
        next = (place){1u - next.page, 0};
        const fw_status status = store->ops->erase(store->ctx, FW_BANKS + next.page);
        if (status != FW_OK)
            return status;
    }
    fw_kept one = {.magic = FW_KEPT_MAGIC,
                   .generation = latest.generation + 1u,
                   .settings = settings,
                   .current_limit_ua_rms = current_limit_ua_rms};
    one.crc = eits_crc32(0, &one, FW_KEPT_BYTES - 4u);
    return store->ops->program(store->ctx, FW_BANKS + next.page, next.slot * FW_KEPT_BYTES, &one,
                               sizeof one);
}

uint32_t fw_current_limit_ua(const fw_kept *kept, uint32_t source_ua_rms)
{
    const uint32_t limit_ua = kept->current_limit_ua_rms;
    return limit_ua != 0 ? limit_ua : source_ua_rms + source_ua_rms / 4;
}
