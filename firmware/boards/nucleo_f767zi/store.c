/* Two banks for models and two pages for settings in the program's own flash: 0x08040000 (sectors 5
 * and 6) and 0x080C0000 (7 and 8), 512 KB each; 0x08140000 (9) and 0x08180000 (10), 256 KB each.
 *
 * The flash is one bank (nDBANK set, as delivered): while it erases or programs, every read of
 * it waits, also the processor's (RM0410 3.3.6). A sector of 256 KB takes 1 s, at most 4 (data
 * sheet, table 52); DMA stores bytes that the host sends meanwhile. */
#include "nucleo.h"

#include <string.h>

enum { FIRST_SECTOR = 5, WORD_US = 1000, SECTOR_US = 6000000 };
#define BANKS_START  0x08040000u
#define SECTOR_BYTES (256u * 1024u)
#define ERRORS \
    (FLASH_SR_OPERR | FLASH_SR_WRPERR | FLASH_SR_PGAERR | FLASH_SR_PGPERR | FLASH_SR_ERSERR)
#define WORDS_OF_32_BITS (2u << FLASH_CR_PSIZE_POS) /* 2.7 to 3.6 V */

static const uint8_t *bank_start(void *ctx, uint32_t bank)
{
    (void)ctx;
    const uint32_t pages = bank < FW_BANKS ? 0 : bank - FW_BANKS;
    return (const uint8_t *)(BANKS_START + (bank - pages) * NUCLEO_BANK_BYTES +
                             pages * NUCLEO_PAGE_BYTES);
}

static uint32_t bytes_of(uint32_t bank)
{
    return bank < FW_BANKS ? NUCLEO_BANK_BYTES : NUCLEO_PAGE_BYTES;
}

static fw_status finished(uint32_t max_us)
{
    const uint32_t start = nucleo_time_us(NULL);
    while ((FLASH_SR & FLASH_SR_BSY) != 0)
        if (nucleo_time_us(NULL) - start > max_us)
            return FW_E_TIMEOUT;
    return (FLASH_SR & ERRORS) == 0 ? FW_OK : FW_E_FLASH;
}

static fw_status open_flash(void)
{
    if ((FLASH_OPTCR & FLASH_OPTCR_NDBANK) == 0) /* two banks: other sectors lie here */
        return FW_E_FLASH;
    if ((FLASH_CR & FLASH_CR_LOCK) != 0) {
        FLASH_KEYR = FLASH_KEY1;
        FLASH_KEYR = FLASH_KEY2;
    }
    const fw_status status = finished(WORD_US);
    FLASH_SR = ERRORS | FLASH_SR_EOP; /* earlier ones */
    return status == FW_E_TIMEOUT ? status : FW_OK;
}

static void close_flash(void)
{
    FLASH_CR = FLASH_CR_LOCK;
}

static bool all_ones(const uint8_t *start, size_t size)
{
    const uint32_t *word = (const uint32_t *)(const void *)start, *const end =
                                                                      word + size / sizeof *word;
    while (word < end)
        if (*word++ != 0xFFFFFFFFu)
            return false;
    return true;
}

static fw_status erase(void *ctx, uint32_t bank)
{
    if (bank >= FW_PAGES)
        return FW_E_ARGUMENT;
    const uint32_t first = ((uint32_t)bank_start(ctx, bank) - BANKS_START) / SECTOR_BYTES;
    fw_status status = open_flash();
    nucleo_watchdog_patient(true);
    for (uint32_t k = 0; k < bytes_of(bank) / SECTOR_BYTES && status == FW_OK; ++k) {
        nucleo_feed_watchdog(ctx);
        FLASH_CR = WORDS_OF_32_BITS | FLASH_CR_SER | (FIRST_SECTOR + first + k) << FLASH_CR_SNB_POS;
        FLASH_CR |= FLASH_CR_STRT;
        DSB();
        status = finished(SECTOR_US);
    }
    close_flash();
    nucleo_feed_watchdog(ctx);
    nucleo_watchdog_patient(false);
    nucleo_cache_forget(bank_start(ctx, bank), bytes_of(bank));
    return status == FW_OK && !all_ones(bank_start(ctx, bank), bytes_of(bank)) ? FW_E_FLASH
                                                                               : status;
}

static fw_status program(void *ctx, uint32_t bank, uint32_t offset, const void *bytes, size_t size)
{
    if (bank >= FW_PAGES || offset % 4u != 0 || size % 4u != 0 || offset > bytes_of(bank) ||
        size > bytes_of(bank) - offset)
        return FW_E_ARGUMENT;
    const uint8_t *const start = bank_start(ctx, bank) + offset;
    fw_status status = open_flash();
    FLASH_CR = WORDS_OF_32_BITS | FLASH_CR_PG;
    for (size_t at = 0; at < size && status == FW_OK; at += 4) {
        uint32_t word;
        memcpy(&word, (const uint8_t *)bytes + at, sizeof word);
        REG32((uint32_t)start + at) = word;
        /* one word at a time: two merged would not fit the parallelism (RM0410 3.3.7); and Arm's
         * erratum 1259864 */
        DSB();
        status = finished(WORD_US);
    }
    close_flash();
    nucleo_cache_forget(start, size);
    return status == FW_OK && memcmp(start, bytes, size) != 0 ? FW_E_FLASH : status;
}

const fw_store_ops nucleo_store_ops = {bank_start, erase, program};
