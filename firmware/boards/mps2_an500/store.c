/* Flash in memory: erased, or with the contents of "bank0.bin" and "bank1.bin" if they exist. */
#include "boards/parts/nor_model.h"
#include "mps2.h"

static _Alignas(16) uint8_t banks[FW_BANKS][MPS2_BANK_BYTES];

static const uint8_t *bank_start(void *ctx, uint32_t bank)
{
    (void)ctx;
    return banks[bank];
}

static fw_status erase(void *ctx, uint32_t bank)
{
    (void)ctx;
    return bank < FW_BANKS ? nor_model_erase(banks[bank], MPS2_BANK_BYTES) : FW_E_ARGUMENT;
}

static fw_status program(void *ctx, uint32_t bank, uint32_t offset, const void *bytes, size_t size)
{
    (void)ctx;
    if (bank >= FW_BANKS)
        return FW_E_ARGUMENT;
    return nor_model_program(banks[bank], MPS2_BANK_BYTES, offset, bytes, size);
}

void mps2_store_start(void)
{
    static const char *const names[FW_BANKS] = {"bank0.bin", "bank1.bin"};
    for (uint32_t bank = 0; bank < FW_BANKS; ++bank) {
        (void)erase(NULL, bank);
        (void)mps2_load(names[bank], banks[bank], MPS2_BANK_BYTES);
    }
}

const fw_store_ops mps2_store_ops = {bank_start, erase, program};
