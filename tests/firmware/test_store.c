/* Model banks: which one is opened, and uploads. Power cuts are tested by the fuzzer (tests/fuzz)
 * and on the emulated board (tests/python/emulator/test_power_cuts.py). */
#include "steps.h"

static skin_model adjacent, opposite;

static eits_packet_reply begin_with(uint32_t bytes, uint32_t crc)
{
    eits_command_model_begin c = {.bytes = bytes, .crc = crc};
    return host_command(&b.host, EITS_PACKET_MODEL_BEGIN, &c, sizeof c);
}

static void start_with_adjacent(void)
{
    bench_start(&b, NULL);
    fake_put_model(&b.board, 0, 1, adjacent.blob, adjacent.size);
    bench_restart(&b);
}

TEST(test_newest)
{
    const struct {
        const char *name;
        uint32_t first, second, bank; /* generations, and the newest bank */
    } cases[] = {{"second is newer", 1, 2, 1},
                 {"first is newer", 2, 1, 0},
                 {"second is newer over the wrap", 0xFFFFFFFFu, 0, 1},
                 {"first is newer over the wrap", 0, 0xFFFFFFFFu, 0},
                 {"second is newer by 2^31 - 1", 0x80000006u, 5, 1},
                 {"first is newer by 2^31 - 4", 0x80000001u, 5, 0},
                 {"both are as new", 7, 7, 0}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        CASE(cases[k].name);
        bench_start(&b, NULL);
        fake_put_model(&b.board, 0, cases[k].first, adjacent.blob, adjacent.size);
        fake_put_model(&b.board, 1, cases[k].second, opposite.blob, opposite.size);
        bench_restart(&b);
        CHECK_EQUAL(host_info(&b.host).bank, cases[k].bank);
        CHECK_EQUAL(host_info(&b.host).n_rows, cases[k].bank == 0 ? 208 : 192);
        /* the newest's content or record is damaged: the other one is opened */
        b.board.bank[cases[k].bank][k % 2 ? 4000 : FAKE_BANK - 20] ^= 1;
        bench_restart(&b);
        CHECK_EQUAL(host_info(&b.host).bank, 1 - cases[k].bank);
        CHECK_EQUAL(host_info(&b.host).faults, 0);
        /* only the record's checksum covers byte 6 */
        b.board.bank[1 - cases[k].bank][k % 3 ? 5000 : 6] ^= 1;
        bench_restart(&b);
        CHECK_EQUAL(host_info(&b.host).n_rows, 0);
        CHECK(host_fault(&b.host, EITS_FAULT_NO_MODEL, true, 0) != NULL);
    }
}

static void test_upload(size_t piece)
{
    start_with_adjacent();
    TARE(4);
    TAKEN(host_upload(&b.host, opposite.blob, opposite.size, opposite.crc, piece));
    CHECK_EQUAL(b.board.rewrites, 0);
    CHECK_EQUAL(b.board.erases, 1);
    CHECK_EQUAL(host_info(&b.host).n_rows, 192);
    /* the old one is still there */
    CHECK(memcmp(b.board.bank[0], adjacent.blob, adjacent.size) == 0);
    TAKEN(host_upload(&b.host, adjacent.blob, adjacent.size, adjacent.crc, piece));
    CHECK_EQUAL(host_info(&b.host).bank, 0);
    bench_restart(&b);
    CHECK_EQUAL(host_info(&b.host).n_rows, 208);
    CHECK_EQUAL(host_info(&b.host).bank, 0);
}

static void still_adjacent(int tared)
{
    const eits_packet_info info = host_info(&b.host);
    CHECK_EQUAL(info.n_rows, 208);
    CHECK_EQUAL(info.model_crc, adjacent.crc);
    CHECK_EQUAL(info.bank, 0);
    CHECK_EQUAL(info.tared, tared);
    hear(60);
    CHECK(host_count(&b.host, EITS_PACKET_RAW) >= 2); /* scanning, and still streamed */
    if (tared)
        CHECK(host_count(&b.host, EITS_PACKET_IMAGE) >= 2);
    const host_packet *image = host_last(&b.host, EITS_PACKET_IMAGE);
    if (image != NULL)
        CHECK_EQUAL(((const eits_packet_solved *)(const void *)image->payload)->status, 0);
}

/* An upload that is refused leaves the model, the reference and the stream as they were. */
TEST(test_refused)
{
    start_with_adjacent();
    TARE(4);
    STREAM(7, 1, 0);
    eits_packet_reply reply = begin_with(FAKE_BANK - 31, 0);
    CHECK_EQUAL(reply.status, EITS_REPLY_MODEL_SIZE);
    CHECK_EQUAL(reply.detail[0], FAKE_BANK - 32);
    CHECK_EQUAL(begin_with(63, 0).status, EITS_REPLY_RANGE);
    reply = host_model_data(&b.host, 0, adjacent.blob, 100);
    CHECK_EQUAL(reply.status, EITS_REPLY_OFFSET); /* no upload has begun */
    CHECK_EQUAL(reply.detail[0], -1);
    CHECK_EQUAL(host_plain(&b.host, EITS_PACKET_MODEL_COMMIT).status, EITS_REPLY_OFFSET);
    still_adjacent(1);
    CHECK_EQUAL(host_upload(&b.host, opposite.blob, opposite.size, opposite.crc + 1, 4096).status,
                EITS_REPLY_MODEL_CRC);
    still_adjacent(1);
    /* a damaged model whose CRC was announced correctly */
    static uint8_t damaged[FAKE_BANK];
    memcpy(damaged, opposite.blob, opposite.size);
    damaged[1000] ^= 4;
    reply =
        host_upload(&b.host, damaged, opposite.size, eits_crc32(0, damaged, opposite.size), 4096);
    CHECK_EQUAL(reply.status, EITS_REPLY_MODEL_INVALID);
    CHECK_EQUAL(reply.detail[0], EITS_E_MODEL_CRC);
    still_adjacent(1);
    skin_spec spec = SKIN_ADJACENT;
    spec.electrodes = 17;
    skin_model bad = skin_model_make(&spec);
    reply = host_upload(&b.host, bad.blob, bad.size, bad.crc, 4096);
    CHECK_EQUAL(reply.status, EITS_REPLY_MODEL_SCAN);
    CHECK_EQUAL(reply.detail[0], 17);
    CHECK_EQUAL(reply.detail[1], 16);
    still_adjacent(1);
    fake_put_model(&b.board, 1, 7, bad.blob, bad.size); /* written by a programmer: not opened */
    bench_restart(&b);
    CHECK_EQUAL(host_info(&b.host).bank, 0);
    TARE(4);
    STREAM(7, 1, 0);
    skin_model_free(&bad);
    spec = SKIN_ADJACENT;
    spec.wrong_golden = 1;
    bad = skin_model_make(&spec);
    reply = host_upload(&b.host, bad.blob, bad.size, bad.crc, 4096);
    CHECK_EQUAL(reply.status, EITS_REPLY_SELF_TEST);
    CHECK(reply.detail[0] > 0);
    still_adjacent(1);
    /* written by a programmer: only SELF_TEST tests it */
    fake_put_model(&b.board, 1, 9, bad.blob, bad.size);
    fake_restart(&b.board);
    host_start(&b.host, &b.board);
    reply = host_plain(&b.host, EITS_PACKET_SELF_TEST);
    CHECK_EQUAL(reply.status, EITS_REPLY_SELF_TEST);
    skin_model_free(&bad);
}

/* A model that needs more memory than the board has is refused at once; at start-up the other bank
 * is opened. */
TEST(test_memory)
{
    start_with_adjacent();
    TARE(4);
    STREAM(7, 1, 0);
    skin_spec spec = SKIN_ADJACENT;
    spec.rank = 60;
    spec.side = 16;
    skin_model big = skin_model_make(&spec);
    eits_model model;
    CHECK_OK(eits_model_open(&model, big.blob, big.size));
    TAKEN(host_upload(&b.host, big.blob, big.size, big.crc, 4096));
    const size_t needs = fw_engine_needs(&model);
    CHECK(needs < FAKE_WORKSPACE);
    const size_t enough = (needs + 15) / 16 * 16;
    const struct {
        const char *name;
        size_t bytes;
        uint16_t status;
        uint32_t rank; /* of the open model afterwards */
    } cases[] = {{"just enough memory", enough, EITS_REPLY_OK, 60},
                 {"16 bytes too few", enough - 16, EITS_REPLY_MODEL_SIZE, 24}};
    for (size_t k = 0; IN_TABLE(k, cases); ++k) {
        CASE(cases[k].name);
        TAKEN(host_upload(&b.host, adjacent.blob, adjacent.size, adjacent.crc, 4096));
        b.board.board.workspace_bytes = cases[k].bytes;
        bench_restart(&b);
        const eits_packet_reply reply = host_upload(&b.host, big.blob, big.size, big.crc, 4096);
        CHECK_EQUAL(reply.status, cases[k].status);
        CHECK_EQUAL(host_info(&b.host).rank, cases[k].rank);
        CHECK(reply.status == EITS_REPLY_OK || reply.detail[0] == (long long)cases[k].bytes);
    }
    fake_put_model(&b.board, 0, 100, big.blob, big.size);
    fake_put_model(&b.board, 1, 99, adjacent.blob, adjacent.size);
    bench_restart(&b);
    CHECK_EQUAL(host_info(&b.host).rank, 24);
    CHECK_EQUAL(host_info(&b.host).faults, 0);
    fake_put_model(&b.board, 1, 99, big.blob, big.size);
    bench_restart(&b);
    const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_NO_MODEL, true, 0);
    CHECK(fault != NULL && fault->value == EITS_E_WORKSPACE);
    skin_model_free(&big);
}

TEST(test_offsets)
{
    start_with_adjacent();
    const uint32_t size = (uint32_t)opposite.size;
    TAKEN(begin_with(size, opposite.crc));
    TAKEN(host_model_data(&b.host, 0, opposite.blob, 1000));
    eits_packet_reply reply = host_model_data(&b.host, 0, opposite.blob, 1000);
    CHECK_EQUAL(reply.status, EITS_REPLY_OFFSET);
    CHECK_EQUAL(reply.detail[0], 1000);
    reply = host_model_data(&b.host, 2000, opposite.blob + 2000, 1000);
    CHECK_EQUAL(reply.detail[0], 1000);
    reply = host_model_data(&b.host, 1000, opposite.blob + 1000, 1001);
    CHECK_EQUAL(reply.status,
                EITS_REPLY_LENGTH); /* the detail is a length that would be accepted */
    CHECK_EQUAL(reply.detail[0], sizeof(eits_command_model_data) + 1000);
    reply = host_plain(&b.host, EITS_PACKET_MODEL_COMMIT);
    CHECK_EQUAL(reply.status, EITS_REPLY_OFFSET);
    CHECK_EQUAL(reply.detail[0], 1000);
    CHECK_EQUAL(host_stream(&b.host, 1, 1, 0).status, EITS_REPLY_BUSY);
    reply = host_tare(&b.host, 1);
    CHECK_EQUAL(reply.status, EITS_REPLY_BUSY);
    CHECK_EQUAL(reply.detail[0], EITS_PACKET_MODEL_BEGIN);
    /* after ten seconds without a command the old model is used again; then the host resumes the
     * upload */
    host_run(&b.host, 9000);
    CHECK_EQUAL(b.host.instrument.acquire.scan.running, 0);
    host_run(&b.host, 1500);
    CHECK_EQUAL(b.host.instrument.acquire.scan.running, 1);
    TARE(1);
    reply = begin_with(size, opposite.crc);
    TAKEN(reply);
    CHECK_EQUAL(reply.detail[0], 1000);
    CHECK_EQUAL(b.board.erases, 1);
    TAKEN(host_upload(&b.host, opposite.blob, size, opposite.crc, 3000));
    CHECK_EQUAL(b.board.erases, 1);
    CHECK_EQUAL(b.board.rewrites, 0);
    CHECK_EQUAL(host_info(&b.host).n_rows, 192);
    /* another announcement starts over */
    TAKEN(begin_with(size, opposite.crc));
    TAKEN(host_model_data(&b.host, 0, opposite.blob, 1000));
    reply = begin_with(size, opposite.crc ^ 1);
    CHECK_EQUAL(reply.detail[0], 0);
    CHECK_EQUAL(b.board.erases, 3);
    TAKEN(host_model_data(&b.host, 0, opposite.blob, 4));
    TAKEN(begin_with(100, 7));
    CHECK_EQUAL(host_model_data(&b.host, 0, opposite.blob, 104).status, EITS_REPLY_RANGE);
    TAKEN(host_model_data(&b.host, 0, opposite.blob, 100));
    CHECK_EQUAL(host_plain(&b.host, EITS_PACKET_MODEL_COMMIT).status, EITS_REPLY_MODEL_CRC);
    CHECK_EQUAL(host_info(&b.host).n_rows, 192);
}

/* The last piece may have any number of bytes. */
TEST(test_odd_end)
{
    start_with_adjacent();
    static uint8_t longer[FAKE_BANK];
    memcpy(longer, opposite.blob, opposite.size);
    memset(longer + opposite.size, 0x5A, 3); /* bytes behind the model are ignored */
    const size_t size = opposite.size + 3;
    TAKEN(host_upload(&b.host, longer, size, eits_crc32(0, longer, size), 4096));
    CHECK_EQUAL(host_info(&b.host).n_rows, 192);
    CHECK_EQUAL(host_info(&b.host).model_bytes, (long long)size);
    CHECK_EQUAL(b.board.bank[1][size], 0xFF);
    bench_restart(&b);
    CHECK_EQUAL(host_info(&b.host).n_rows, 192);
}

TEST(test_flash_fails)
{
    start_with_adjacent();
    TARE(4);
    STREAM(7, 1, 0);
    b.board.erase_status = FW_E_FLASH;
    CHECK_EQUAL(begin_with((uint32_t)opposite.size, opposite.crc).status, EITS_REPLY_FLASH);
    still_adjacent(1);
    b.board.erase_status = FW_OK;
    TAKEN(begin_with((uint32_t)opposite.size, opposite.crc));
    TAKEN(host_model_data(&b.host, 0, opposite.blob, 400));
    b.board.program_status = FW_E_FLASH;
    const eits_packet_reply reply = host_model_data(&b.host, 400, opposite.blob + 400, 400);
    CHECK_EQUAL(reply.status, EITS_REPLY_FLASH);
    CHECK_EQUAL(reply.detail[0], 400);
    still_adjacent(1);
    b.board.program_status = FW_OK;
    /* the upload has ended: it cannot be continued */
    const eits_packet_reply late = host_model_data(&b.host, 400, opposite.blob + 400, 400);
    CHECK_EQUAL(late.status, EITS_REPLY_OFFSET);
    CHECK_EQUAL(late.detail[0], -1);
    still_adjacent(1);
    TAKEN(host_upload(&b.host, opposite.blob, opposite.size, opposite.crc, 4096));
    CHECK_EQUAL(b.board.rewrites, 0);
    CHECK_EQUAL(host_info(&b.host).n_rows, 192);
}

int main(void)
{
    adjacent = skin_model_make(&SKIN_ADJACENT);
    opposite = skin_model_make(&SKIN_OPPOSITE);
    run_tests();
    test_upload(4096);
    test_upload(52);
    skin_model_free(&adjacent);
    skin_model_free(&opposite);
    bench_stop(&b);
    return checks_report("store");
}
