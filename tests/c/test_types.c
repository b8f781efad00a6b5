/* Status texts, version, checksums: against values known elsewhere. */
#include "check.h"

#include "base/arithmetic.h"
#include "eitskin/eitskin.h"

#include <string.h>

TEST(status_texts)
{
    static const struct {
        eits_status status;
        const char *word; /* that the text must hold */
    } known[] = {
        {EITS_OK, "ok"},
        {EITS_E_ARGUMENT, "argument"},
        {EITS_E_WORKSPACE, "workspace"},
        {EITS_E_MODEL_TRUNCATED, "ends before"},
        {EITS_E_MODEL_MAGIC, "not an .eitm"},
        {EITS_E_MODEL_VERSION, "newer major version"},
        {EITS_E_MODEL_CRC, "checksum"},
        {EITS_E_MODEL_SECTION, "section"},
        {EITS_E_MODEL_VALUE, "number"},
        {EITS_E_MODEL_ALIGNMENT, "boundary"},
        {EITS_E_FRAME_LENGTH, "length"},
        {EITS_E_FRAME_ROWS, "rows"},
        {EITS_E_FRAME_ZERO, "zero"},
        {EITS_E_NO_REFERENCE, "no reference"},
        {EITS_E_REFERENCE_SHORT, "too few frames"},
        {EITS_E_NOT_FINITE, "finite"},
        {EITS_E_ARITHMETIC, "-ffp-contract=off"},
        {EITS_E_REFERENCE_TOUCHED, "untouched"},
    };
    const int count = (int)COUNT_OF(known);
    for (int i = 0; i < count; ++i) {
        const char *text = eits_status_text(known[i].status);
        /* the numbers are part of the interface: errors are negative */
        CHECK_EQUAL(known[i].status, -i);
        CHECK(strstr(text, known[i].word) != NULL);
        CHECK(strchr(text, '\n') == NULL);
        for (int j = 0; j < i; ++j)
            CHECK(strcmp(text, eits_status_text(known[j].status)) != 0);
    }
    CHECK(strcmp(eits_status_text((eits_status)-99), "unknown status") == 0);
    CHECK(strcmp(eits_status_text((eits_status)1), "unknown status") == 0);
}

TEST(arithmetic_is_as_written)
{
    eits_real left[EITS_ARITHMETIC_TRIALS];
    eits_try_arithmetic(left);
    CHECK_OK(eits_judge_arithmetic(left));
    for (int k = 0; k < EITS_ARITHMETIC_TRIALS; ++k) {
        CHECK_NEAR(left[k], 0, 0);
        left[k] = (eits_real)1e-8;
        CHECK_EQUAL(eits_judge_arithmetic(left), EITS_E_ARITHMETIC);
        left[k] = 0;
    }
}

TEST(version_and_width)
{
    char text[32];
    (void)snprintf(text, sizeof text, "%d.%d.%d", EITS_VERSION_MAJOR, EITS_VERSION_MINOR,
                   EITS_VERSION_PATCH);
    CHECK(strcmp(eits_version_text(), text) == 0);
    CHECK_EQUAL(eits_real_size(), BOTH_WIDTHS(4, 8));
    CHECK_EQUAL(sizeof(eits_real), BOTH_WIDTHS(4, 8));
}

TEST(crc32_of_known_texts)
{
    static const char fox[] = "The quick brown fox jumps over the lazy dog";
    uint8_t zeros[32] = {0}, ones[32];
    memset(ones, 0xFF, sizeof ones);
    CHECK_EQUAL(eits_crc32(0, "", 0), 0);
    /* the check value of CRC-32/ISO-HDLC */
    CHECK_EQUAL(eits_crc32(0, "123456789", 9), 0xCBF43926u);
    CHECK_EQUAL(eits_crc32(0, fox, sizeof fox - 1), 0x414FA339u);
    CHECK_EQUAL(eits_crc32(0, zeros, 32), 0x190A55ADu);
    CHECK_EQUAL(eits_crc32(0, ones, 32), 0xFF6CAB0Bu);
    for (size_t cut = 0; cut < sizeof fox; ++cut) {
        const uint32_t first = eits_crc32(0, fox, cut);
        CHECK_EQUAL(eits_crc32(first, fox + cut, sizeof fox - 1 - cut), 0x414FA339u);
    }
}

TEST(protocol_hash_of_known_tables)
{
    static const uint8_t row[4] = {0, 1, 2, 3},
                         letters[8] = {'a', 'b', 'c', 'd', 'e', 'f', 'g', 'h'};
    /* FNV-1a, 64 bits, of 66 6F 00 00; of 08 00 01 00 00 01 02 03; of 34 12 02 00 "abcdefgh": from
     * an implementation in another language that gives 85944171F73967E8 for "foobar" */
    CHECK(eits_protocol_hash(0x6F66, 0, row) == 0xDD59CE790C625B92u);
    CHECK(eits_protocol_hash(8, 1, row) == 0xCCAA78479684F7D4u);
    CHECK(eits_protocol_hash(0x1234, 2, letters) == 0x90FF0487B130CAC1u);
    CHECK(eits_protocol_hash(8, 1, row) != eits_protocol_hash(9, 1, row));
}

RUN_TESTS("types")
