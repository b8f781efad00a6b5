/* Flash: memory that behaves like it, and is empty when power comes. */
#include "boards/parts/nor_model.h"
#include "example.h"

static _Alignas(16) uint8_t banks[FW_BANKS][EXAMPLE_BANK_BYTES];

static const uint8_t *bank_start(void *ctx, uint32_t bank)
{
    (void)ctx;
    return banks[bank];
}

static fw_status erase(void *ctx, uint32_t bank)
{
    (void)ctx;
    return bank < FW_BANKS ? nor_model_erase(banks[bank], EXAMPLE_BANK_BYTES) : FW_E_ARGUMENT;
}

static fw_status program(void *ctx, uint32_t bank, uint32_t offset, const void *bytes, size_t size)
{
    (void)ctx;
    if (bank >= FW_BANKS)
        return FW_E_ARGUMENT;
    return nor_model_program(banks[bank], EXAMPLE_BANK_BYTES, offset, bytes, size);
}

const fw_store_ops example_store_ops = {bank_start, erase, program};
