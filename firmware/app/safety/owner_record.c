#include "app/safety/owner_record.h"

#include "eitskin/model.h"

#include <string.h>

_Static_assert(sizeof(fw_owner_record) == FW_OWNER_RECORD_BYTES, "a record has its size");

typedef struct place {
    uint32_t page, slot; /* the first erased slot behind the latest record */
} place;

static const uint8_t *slot_at(const fw_store *store, uint32_t page, uint32_t slot)
{
    return store->ops->bank(store->ctx, FW_BANKS + page) + (size_t)slot * FW_OWNER_RECORD_BYTES;
}

static bool erased(const uint8_t *slot)
{
    for (uint32_t k = 0; k < FW_OWNER_RECORD_BYTES; ++k) {
        if (slot[k] != 0xFFu)
            return false;
    }
    return true;
}

/* A record that is not valid is skipped: power was cut while it was written, or it has decayed. */
static fw_owner_record find(const fw_store *store, place *next)
{
    fw_owner_record latest = {0}, one;
    *next = (place){0};
    for (uint32_t page = 0; page < FW_PAGES - FW_BANKS; ++page) {
        uint32_t used = 0;
        bool here = latest.magic == 0 && page == 0;
        for (uint32_t slot = 0; slot < store->page_bytes / FW_OWNER_RECORD_BYTES; ++slot) {
            const uint8_t *bytes = slot_at(store, page, slot);
            if (erased(bytes))
                continue;
            used = slot + 1u;
            memcpy(&one, bytes, sizeof one);
            if (one.magic != FW_OWNER_RECORD_MAGIC ||
                one.crc != eits_crc32(0, &one, FW_OWNER_RECORD_BYTES - 4u))
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

fw_owner_record fw_owner_record_load(const fw_store *store)
{
    place next;
    return find(store, &next);
}

fw_status fw_owner_record_save(const fw_store *store, const fw_owner_record *wanted)
{
    place next;
    const fw_owner_record latest = find(store, &next);
    if (store->page_bytes < FW_OWNER_RECORD_BYTES)
        return FW_E_RANGE;
    if (next.slot == store->page_bytes / FW_OWNER_RECORD_BYTES) {
        next = (place){1u - next.page, 0};
        const fw_status status = store->ops->erase(store->ctx, FW_BANKS + next.page);
        if (status != FW_OK)
            return status;
    }
    fw_owner_record one = *wanted;
    one.magic = FW_OWNER_RECORD_MAGIC;
    one.generation = latest.generation + 1u;
    one.crc = eits_crc32(0, &one, FW_OWNER_RECORD_BYTES - 4u);
    return store->ops->program(store->ctx, FW_BANKS + next.page, next.slot * FW_OWNER_RECORD_BYTES,
                               &one, sizeof one);
}
