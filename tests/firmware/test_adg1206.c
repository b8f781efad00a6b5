/* ADG1206: addresses of each, break before make, more than 16 electrodes, and failing lines. */
#include "check.h"
#include "fake_board.h"

static fake_board board;
static fake_write written[FAKE_SPI_LOG];
static fw_adg1206 parts;

static void fresh(uint32_t electrodes)
{
    fake_init(&board, 0);
    board.log = written;
    board.log_room = FAKE_SPI_LOG;
    board.board.multiplexers = fw_adg1206_multiplexers(&parts, board.adg1206.lines, electrodes);
}

static fw_status join(uint32_t electrodes)
{
    return board.board.multiplexers.ops->join(board.board.multiplexers.ctx, electrodes);
}

static fw_status all_off(void)
{
    return board.board.multiplexers.ops->all_off(board.board.multiplexers.ctx);
}

TEST(test_sequence)
{
    fresh(16);
    CHECK_EQUAL(join(0x0F0C0201), FW_OK);
    CHECK_EQUAL(board.monitor.lines, 0xFFC21); /* V-, V+, I-, I+ from the left, all enabled */
    CHECK_EQUAL(join(0x05040800), FW_OK);
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
    CHECK_EQUAL(all_off(), FW_OK);
    CHECK_EQUAL(board.monitor.lines & 0xF0000u, 0);
}

TEST(test_every_electrode)
{
    for (uint32_t electrodes = 16; electrodes <= FW_MAX_ELECTRODES; electrodes += 16) {
        fresh(electrodes);
        for (uint32_t place = 0; place < 4; ++place) {
            for (uint32_t e = 0; e < electrodes; ++e) {
                uint8_t joined[4];
                uint32_t wanted = 0;
                for (uint32_t k = 0; k < 4; ++k)
                    wanted |= (e + 5 * (k + 4 - place)) % electrodes << 8 * k;
                CHECK_EQUAL(join(wanted), FW_OK);
                CHECK_EQUAL(drive_monitor_joined(board.monitor.lines, joined), 4);
                for (uint32_t k = 0; k < 4; ++k)
                    CHECK_EQUAL(joined[k], wanted >> 8 * k & 0xFFu);
            }
        }
        CHECK_EQUAL(all_off(), FW_OK);
        CHECK_EQUAL(board.monitor.lines & DRIVE_MONITOR_ENABLES, 0);
        CHECK(board.monitor.violation == NULL);
    }
}

TEST(test_lines_of_a_second_four)
{
    fresh(32);
    CHECK_EQUAL(join(0x1F000311), FW_OK); /* 17, 3, 0, 31 */
    CHECK_EQUAL(board.monitor.lines, 0x960000 | 0xF031);
    CHECK_EQUAL(written[0].a, 0xFF0000); /* all eight enables */
    CHECK_EQUAL(written[2].a, 0xFF0000);
}

TEST(test_electrodes_that_the_scan_refuses)
{
    static const uint32_t wrong[] = {0x04030210, 0x0403FF01, 0x04100201,
                                     0x10030201, 0x02010505, 0x07070201};
    fresh(16);
    CHECK(fw_can_join(&board.board, 0x04030201));
    for (size_t k = 0; k < sizeof wrong / sizeof wrong[0]; ++k)
        CHECK(!fw_can_join(&board.board, wrong[k]));
    fresh(32);
    CHECK(fw_can_join(&board.board, 0x04030210));
    CHECK(fw_can_join(&board.board, 0x1F1E1D1C));
    CHECK(!fw_can_join(&board.board, 0x201E1D1C));
}

TEST(test_lines_fail)
{
    for (uint32_t at = 0; at < 3; ++at) {
        fresh(16);
        CHECK_EQUAL(join(0x04030201), FW_OK);
        board.lines_fail_from = 3 + at;
        board.lines_fails = 1;
        CHECK_EQUAL(join(0x08070605), FW_E_BUS);
        if (at > 0)
            CHECK_EQUAL(board.monitor.lines & 0xF0000u, 0); /* off again */
        CHECK(board.monitor.violation == NULL);
        board.lines_fails = 0;
        CHECK_EQUAL(join(0x08070605), FW_OK);
        CHECK_EQUAL(board.monitor.lines, 0xF8765);
    }
}

RUN_TESTS("adg1206")
