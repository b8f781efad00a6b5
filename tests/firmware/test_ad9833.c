/* AD9833: words against the data sheet's and AN-1070's worked examples, the sequence, and failing
 * buses. */
#include "check.h"
#include "fake_board.h"

static fake_board board;
static fake_write written[FAKE_SPI_LOG];

TEST(test_tuning)
{
    /* AN-1070, "Programming the AD9833": 400 Hz from 25 MHz is 0x10C7 = 4295 */
    CHECK_EQUAL(fw_ad9833_tuning(25000000, 400000), 0x10C7);
    /* 5 MHz from 25 MHz, a fifth of 2^28; 2.5 MHz from 10 MHz, a quarter */
    CHECK_EQUAL(fw_ad9833_tuning(25000000, 5000000000u), 0x3333333);
    CHECK_EQUAL(fw_ad9833_tuning(10000000, 2500000000u), 0x4000000);
    /* 50 kHz from 8 MHz: 1677721.6, where truncation in single precision is a unit low */
    CHECK_EQUAL(fw_ad9833_tuning(8000000, 50000000), 1677722);
    /* 1 Hz from 25 MHz: 10.737; half a unit is rounded up */
    CHECK_EQUAL(fw_ad9833_tuning(25000000, 1000), 11);
    CHECK_EQUAL(fw_ad9833_tuning(64000000, 119), 0); /* 0.4991 */
    CHECK_EQUAL(fw_ad9833_tuning(64000000, 120), 1); /* 0.5033 */
    CHECK_EQUAL(fw_ad9833_tuning(25000000, 0), 0);
    CHECK_EQUAL(fw_ad9833_tuning(25000000, 12500000000u), 1 << 27);
    CHECK_EQUAL(fw_ad9833_tuning(25000000, 12500000001u), 0);
    CHECK_EQUAL(fw_ad9833_tuning(0, 0), 0);
    CHECK_EQUAL(fw_ad9833_tuning(64000001, 1000), 0);
}

TEST(test_inverse)
{
    CHECK_EQUAL(fw_ad9833_millihertz(8000000, 1677722), 50000012);
    CHECK_EQUAL(fw_ad9833_millihertz(25000000, 1 << 28), 0); /* 28 bits */
    CHECK_EQUAL(fw_ad9833_millihertz(64000001, 1), 0);
    /* back and forth within half a unit: 8 MHz / 2^28 is 29.8 mHz */
    for (uint32_t millihertz = 1000; millihertz < 250000000; millihertz += millihertz / 3 + 17) {
        const uint64_t back = fw_ad9833_millihertz(8000000, fw_ad9833_tuning(8000000, millihertz));
        CHECK_NEAR((double)back, millihertz, 15.41);
        CHECK_EQUAL(fw_ad9833_tuning(8000000, back), fw_ad9833_tuning(8000000, millihertz));
    }
}

TEST(test_phase)
{
    CHECK_EQUAL(fw_ad9833_phase(0), 0);
    CHECK_EQUAL(fw_ad9833_phase(90000), 1024);
    CHECK_EQUAL(fw_ad9833_phase(180000), 2048);
    CHECK_EQUAL(fw_ad9833_phase(360000), 0);
    CHECK_EQUAL(fw_ad9833_phase(450000), 1024);
    CHECK_EQUAL(fw_ad9833_phase(359990), 0); /* closer to a whole turn than to the last unit */
    CHECK_EQUAL(fw_ad9833_phase(359900), 4095);
    CHECK_EQUAL(fw_ad9833_phase(44), 1);
    CHECK_EQUAL(fw_ad9833_phase(43), 0);
}

TEST(test_words)
{
    uint16_t words[FW_AD9833_WORDS];
    fw_ad9833_words(0x10C7, 0, FW_SINE, words); /* AN-1070's sequence */
    const uint16_t note[] = {0x2100, 0x50C7, 0x4000, 0xC000, 0x2000};
    for (int k = 0; k < 5; ++k)
        CHECK_EQUAL(words[k], note[k]);
    fw_ad9833_words(0xFFFFFFF, 0xABC, FW_TRIANGLE, words);
    CHECK_EQUAL(words[1], 0x7FFF);
    CHECK_EQUAL(words[2], 0x7FFF);
    CHECK_EQUAL(words[3], 0xCABC);
    CHECK_EQUAL(words[4], 0x2002);
    fw_ad9833_words(0x4000, 0, FW_SQUARE, words); /* the first bit of the upper half */
    CHECK_EQUAL(words[1], 0x4000);
    CHECK_EQUAL(words[2], 0x4001);
    CHECK_EQUAL(words[4], 0x2028);
    fw_ad9833_words(1, 0, FW_SQUARE_HALF, words);
    CHECK_EQUAL(words[4], 0x2020);
}

/* The part on a board whose log is empty. */
static fw_generator fresh(fw_ad9833 *part)
{
    fake_init(&board, 0);
    board.log = written;
    board.log_room = FAKE_SPI_LOG;
    return fw_ad9833_generator(part, board.ad9833.spi, FAKE_MCLK_HZ);
}

TEST(test_start)
{
    fw_ad9833 part;
    (void)fresh(&part);
    CHECK_EQUAL(fw_ad9833_start(&part, 0x10C7, 0, FW_SINE), FW_OK);
    const uint16_t note[] = {0x2100, 0x50C7, 0x4000, 0xC000, 0x2000};
    CHECK_EQUAL(board.writes, 5);
    for (uint32_t k = 0; k < 5; ++k) {
        CHECK_EQUAL(written[k].a, note[k]);
        CHECK(k == 0 || written[k].at_ns > written[k - 1].at_ns);
    }
    CHECK_EQUAL(fw_ad9833_start(&part, 1677722, 77, FW_SINE), FW_OK);
    CHECK_NEAR(fake_generator_hz(&board), 50000, 0.02);
    CHECK_EQUAL(board.generator.phase, 77);
    CHECK_EQUAL(fw_ad9833_stop(&part), FW_OK);
    CHECK_NEAR(fake_generator_hz(&board), 0, 0);
    CHECK_EQUAL(fw_ad9833_start(&part, 1u << 28, 0, FW_SINE), FW_E_ARGUMENT);
    CHECK_EQUAL(fw_ad9833_start(&part, 1, 1u << 12, FW_SINE), FW_E_ARGUMENT);
    CHECK_EQUAL(board.writes, 11); /* nothing was written */
}

TEST(test_as_the_application_sees_it)
{
    fw_ad9833 part;
    const fw_generator generator = fresh(&part);
    const fw_tone tone = generator.ops->nearest(generator.ctx, 50000000);
    CHECK_EQUAL(tone.millihz, 50000012);
    CHECK(tone.turn_per_us == (uint64_t)1677722 * 8u << 36);
    CHECK_EQUAL(generator.ops->start(generator.ctx, 50000000), FW_OK);
    CHECK_NEAR(fake_generator_hz(&board), 50000.012, 0.001);
    CHECK_EQUAL(generator.ops->stop(generator.ctx), FW_OK);
    CHECK_NEAR(fake_generator_hz(&board), 0, 0);
    CHECK_EQUAL(generator.ops->nearest(generator.ctx, 4000000001u).millihz, 0); /* above 4 MHz */
    CHECK_EQUAL(generator.ops->start(generator.ctx, 4000000001u), FW_E_RANGE);
    CHECK_NEAR(fake_generator_hz(&board), 0, 0);
}

TEST(test_bus_fails_at_each_word)
{
    for (uint32_t at = 0; at < FW_AD9833_WORDS; ++at) {
        fw_ad9833 part;
        (void)fresh(&part);
        CHECK_EQUAL(fw_ad9833_start(&part, 999, 0, FW_SINE), FW_OK);
        board.spi_fail_from = FW_AD9833_WORDS + at;
        board.spi_fails = 1;
        CHECK_EQUAL(fw_ad9833_start(&part, 1677722, 0, FW_SINE), FW_E_BUS);
        /* the write after the failure succeeded */
        CHECK_EQUAL(board.generator.control, 0x2100);
        CHECK_NEAR(fake_generator_hz(&board), 0, 0);
        board.spi_fails = 100; /* from here on every write fails */
        CHECK_EQUAL(fw_ad9833_start(&part, 1677722, 0, FW_SINE), FW_E_BUS);
        CHECK_EQUAL(fw_ad9833_stop(&part), FW_E_BUS);
        board.spi_fails = 0;
        CHECK_EQUAL(fw_ad9833_start(&part, 1677722, 0, FW_SINE), FW_OK);
        CHECK_NEAR(fake_generator_hz(&board), 50000, 0.02);
    }
}

RUN_TESTS("ad9833")
