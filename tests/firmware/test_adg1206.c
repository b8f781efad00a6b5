/* Four ADG1206: addresses of each, break before make, ranges, and failing lines. */
#include "check.h"
#include "fake_board.h"

static fake_board board;
static fake_write written[FAKE_SPI_LOG];

static fw_adg1206 fresh(void)
{
    fake_init(&board, 0);
    board.log = written;
    board.log_room = FAKE_SPI_LOG;
    return (fw_adg1206){board.board.multiplexers};
}

TEST(test_sequence)
{
    const fw_adg1206 bank = fresh();
    const uint8_t first[4] = {1, 2, 12, 15}, second[4] = {0, 8, 4, 5};
    CHECK_EQUAL(fw_adg1206_select(&bank, first), FW_OK);
    CHECK_EQUAL(board.monitor.lines, 0xFFC21); /* V-, V+, I-, I+ from the left, all enabled */
    CHECK_EQUAL(fw_adg1206_select(&bank, second), FW_OK);
    CHECK_EQUAL(board.monitor.lines, 0xF5480);
    CHECK_EQUAL(board.writes, 6);
    CHECK_EQUAL(written[3].a, 0xF0000); /* off */
    CHECK_EQUAL(written[3].b & 0xF0000u, 0);
    CHECK_EQUAL(written[4].a, 0x0FFFF); /* addresses, the enables untouched */
    CHECK_EQUAL(written[4].b, 0x05480);
    CHECK_EQUAL(written[5].a, 0xF0000); /* on */
    CHECK_EQUAL(written[5].b, 0xF0000);
    CHECK(written[4].at_ns - written[3].at_ns >= 140); /* tOFF(EN) of the data sheet */
    CHECK(written[4].at_ns - written[3].at_ns < 1000);
    CHECK(board.monitor.violation == NULL);
    CHECK_EQUAL(fw_adg1206_all_off(&bank), FW_OK);
    CHECK_EQUAL(board.monitor.lines & 0xF0000u, 0);
}

TEST(test_every_electrode)
{
    const fw_adg1206 bank = fresh();
    for (uint32_t place = 0; place < 4; ++place) {
        for (uint8_t e = 0; e < FW_ELECTRODES; ++e) {
            uint8_t electrodes[4] = {(uint8_t)((e + 1) % 16), (uint8_t)((e + 2) % 16),
                                     (uint8_t)((e + 3) % 16), (uint8_t)((e + 4) % 16)};
            electrodes[place] = e;
            CHECK_EQUAL(fw_adg1206_select(&bank, electrodes), FW_OK);
            for (uint32_t k = 0; k < 4; ++k)
                CHECK_EQUAL(board.monitor.lines >> (4 * k) & 15u, electrodes[k]);
        }
    }
    CHECK(board.monitor.violation == NULL);
}

TEST(test_range)
{
    const fw_adg1206 bank = fresh();
    const uint8_t good[4] = {1, 2, 3, 4}, bad[][4] = {{16, 2, 3, 4}, {1, 255, 3, 4}, {1, 2, 16, 4},
                                                      {1, 2, 3, 16}, {5, 5, 1, 2},   {1, 2, 7, 7}};
    CHECK_EQUAL(fw_adg1206_select(&bank, good), FW_OK);
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k)
        CHECK_EQUAL(fw_adg1206_select(&bank, bad[k]), FW_E_ARGUMENT);
    CHECK_EQUAL(board.monitor.lines, 0xF4321); /* as it was */
    CHECK_EQUAL(board.writes, 3);
}

TEST(test_lines_fail)
{
    const uint8_t before[4] = {1, 2, 3, 4}, after[4] = {5, 6, 7, 8};
    for (uint32_t at = 0; at < 3; ++at) {
        const fw_adg1206 bank = fresh();
        CHECK_EQUAL(fw_adg1206_select(&bank, before), FW_OK);
        board.lines_fail_from = 3 + at;
        board.lines_fails = 1;
        CHECK_EQUAL(fw_adg1206_select(&bank, after), FW_E_BUS);
        if (at > 0)
            CHECK_EQUAL(board.monitor.lines & 0xF0000u, 0); /* off again */
        CHECK(board.monitor.violation == NULL);
        board.lines_fails = 0;
        CHECK_EQUAL(fw_adg1206_select(&bank, after), FW_OK);
        CHECK_EQUAL(board.monitor.lines, 0xF8765);
    }
}

RUN_TESTS("adg1206")
