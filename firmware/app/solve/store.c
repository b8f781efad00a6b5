#include "app/solve/store.h"

#include <string.h>

_Static_assert(sizeof(fw_record) == FW_RECORD_BYTES, "a record is 32 bytes");

static const uint8_t *bytes_of(const fw_store *store, uint32_t bank)
{
    return store->ops->bank(store->ctx, bank);
}

uint32_t fw_store_room(const fw_store *store)
{
    return store->bank_bytes - FW_RECORD_BYTES;
}

bool fw_store_record(const fw_store *store, uint32_t bank, fw_record *record)
{
    memcpy(record, bytes_of(store, bank) + fw_store_room(store), sizeof *record);
    return record->magic == FW_RECORD_MAGIC &&
           record->crc == eits_crc32(0, record, FW_RECORD_BYTES - 4u) &&
           record->model_bytes <= fw_store_room(store);
}

eits_status fw_store_open(const fw_store *store, uint32_t bank, const fw_record *record,
                          eits_model *model)
{
    const uint8_t *bytes = bytes_of(store, bank);
    if (eits_crc32(0, bytes, record->model_bytes) != record->model_crc)
        return EITS_E_MODEL_CRC;
    return eits_model_open(model, bytes, record->model_bytes);
}

uint32_t fw_store_newest(const fw_store *store, uint32_t banks[FW_BANKS])
{
    uint32_t generation[FW_BANKS], count = 0;
    for (uint32_t bank = 0; bank < FW_BANKS; ++bank) {
        fw_record record;
        if (!fw_store_record(store, bank, &record))
            continue;
        uint32_t place = count++;
        for (; place > 0 && (int32_t)(record.generation - generation[place - 1]) > 0; --place) {
            generation[place] = generation[place - 1];
            banks[place] = banks[place - 1];
        }
        generation[place] = record.generation;
        banks[place] = bank;
    }
    return count;
}

fw_status fw_store_commit(const fw_store *store, uint32_t bank, uint32_t generation,
                          uint32_t model_bytes, uint32_t model_crc)
{
    fw_record record = {.magic = FW_RECORD_MAGIC,
                        .generation = generation,
                        .model_bytes = model_bytes,
                        .model_crc = model_crc};
    record.crc = eits_crc32(0, &record, FW_RECORD_BYTES - 4u);
    fw_status status =
        store->ops->program(store->ctx, bank, fw_store_room(store), &record, sizeof record);
    if (status == FW_OK &&
        memcmp(bytes_of(store, bank) + fw_store_room(store), &record, sizeof record) != 0)
        status = FW_E_FLASH;
    return status;
}
