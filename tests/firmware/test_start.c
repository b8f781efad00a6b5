/* Starting: without a model, on another model than before, and how the main loop ends. */
#include "steps.h"

#include "app/instrument.h"

TEST(test_no_model)
{
    bench_start(&b, NULL);
    const eits_packet_fault *fault = host_fault(&b.host, EITS_FAULT_NO_MODEL, true, 0);
    CHECK(fault != NULL);
    eits_packet_info info = host_info(&b.host);
    CHECK_EQUAL(info.model_bytes, 0);
    CHECK_EQUAL(info.n_rows, 0);
    CHECK_EQUAL(info.faults, 1u << EITS_FAULT_NO_MODEL);
    CHECK_EQUAL(info.electrodes, 16);
    CHECK_EQUAL(info.bank_bytes, FAKE_BANK - 32);
    CHECK_EQUAL(host_tare(&b.host, 1).status, EITS_REPLY_NO_MODEL);
    CHECK_EQUAL(host_stream(&b.host, EITS_STREAM_RAW, 1, 0).status, EITS_REPLY_NO_MODEL);
    STREAM(0, 1, 0);
    CHECK_EQUAL(host_plain(&b.host, EITS_PACKET_SELF_TEST).status, EITS_REPLY_NO_MODEL);
    host_run(&b.host, 3000);
    CHECK_EQUAL(b.board.bursts, 0);
    CHECK_EQUAL(b.board.monitor.lines & DRIVE_MONITOR_ENABLES, 0);
    CHECK_NEAR(fake_generator_hz(&b.board), 0, 0);
    CHECK((b.board.leds & 4u) != 0);
    skin_model model = skin_model_make(&SKIN_ADJACENT);
    TAKEN(host_upload(&b.host, model.blob, model.size, model.crc, 4096));
    CHECK(host_fault(&b.host, EITS_FAULT_NO_MODEL, false, 0) != NULL);
    TARE(4);
    info = host_info(&b.host);
    CHECK_EQUAL(info.model_bytes, (long long)model.size);
    CHECK_EQUAL(info.model_crc, model.crc);
    CHECK_EQUAL(info.n_rows, 208);
    CHECK_EQUAL(info.n_folded, 104);
    CHECK_EQUAL(info.faults, 0);
    skin_model_free(&model);
}

/* After a change of the model the new table is scanned, also in reciprocal scans, and the old
 * reference is gone. */
TEST(test_model_change)
{
    bench_start(&b, &SKIN_ADJACENT);
    check_each(3);
    TARE(4);
    STREAM(7, 1, 0);
    host_run(&b.host, 70);
    skin_model other = skin_model_make(&SKIN_OPPOSITE);
    TAKEN(host_upload(&b.host, other.blob, other.size, other.crc, 1000));
    skin_model_free(&b.model);
    b.model = other;
    CHECK_OK(eits_model_open(&b.open, other.blob, other.size));
    const eits_packet_info info = host_info(&b.host);
    CHECK_EQUAL(info.n_rows, 192);
    CHECK(info.n_electrodes == b.open.n_electrodes && info.n_folded == b.open.n_folded &&
          info.rank == b.open.rank && info.n_pixels == b.open.n_pixels && info.nx == b.open.nx &&
          info.ny == b.open.ny && info.storage == (uint32_t)b.open.sensitivity.storage);
    CHECK(info.protocol_hash == b.open.protocol_hash);
    CHECK_EQUAL(info.bank, 1);
    CHECK_EQUAL(info.tared, 0);
    CHECK_EQUAL(info.streaming, 0);
    CHECK_EQUAL(host_stream(&b.host, EITS_STREAM_IMAGE, 1, 0).status, EITS_REPLY_NOT_TARED);
    STREAM(EITS_STREAM_RAW, 1, 0);
    hear(100);
    CHECK(host_count(&b.host, EITS_PACKET_RAW) >= 5);
    for (uint32_t k = 0; k < host_count(&b.host, EITS_PACKET_RAW); ++k) {
        const host_packet *packet = host_packet_of(&b.host, EITS_PACKET_RAW, k);
        float volts[256];
        memcpy(volts, packet->payload + sizeof(eits_packet_raw), 4 * 192);
        for (uint32_t i = 0; i < 192; ++i)
            CHECK_NEAR(volts[i], bench_volts(&b, i), 0.5 * fake_lsb_v(&b.board));
    }
    bench_restart(&b); /* the newer one is opened */
    CHECK_EQUAL(host_info(&b.host).n_rows, 192);
    CHECK_EQUAL(host_info(&b.host).bank, 1);
}

TEST(test_starts_and_ends)
{
    bench_start(&b, &SKIN_ADJACENT);
    CHECK_EQUAL(b.host.packet[0].type,
                EITS_PACKET_INFO); /* sent without a request, so with number 0 */
    const eits_packet_info *info = (const void *)b.host.packet[0].payload;
    CHECK_EQUAL(info->request, 0);
    CHECK(strcmp(info->board, "fake") == 0);
    CHECK(memcmp(info->serial, "00112233445566778899AABB", 24) == 0);
    CHECK_EQUAL(info->excitation_millihz, 50000012);
    CHECK_EQUAL(info->volts_per_code_nv, 805664);
    CHECK_NEAR(eits_get_options(b.host.instrument.solve.engine.ctx)->noise_floor_v, 73.547e-6,
               1e-9);
    CHECK_EQUAL(info->slot_us, 100);
    fake_restart(&b.board);
    b.board.ended = true;
    CHECK_EQUAL(fw_instrument_run(&b.host.instrument, &b.board.board), 0);
    eits_command_plain reset = {77};
    for (int k = 0; k < 60;
         ++k) /* more bytes than one read takes: the loop ends once all are read */
        host_send(&b.host, EITS_PACKET_GET_INFO, &reset, sizeof reset);
    host_send(&b.host, EITS_PACKET_RESET, &reset, sizeof reset);
    CHECK_EQUAL(fw_instrument_run(&b.host.instrument, &b.board.board), 2);
    CHECK_EQUAL(b.board.resets, 1);
    CHECK_EQUAL(b.board.monitor.lines & DRIVE_MONITOR_ENABLES, 0);
    CHECK_NEAR(fake_generator_hz(&b.board), 0, 0);
    fw_board wrong = b.board.board;
    wrong.workspace = b.board.workspace + 4;
    CHECK_EQUAL(fw_instrument_run(&b.host.instrument, &wrong), 1);
    wrong = b.board.board;
    wrong.multiplexers.electrodes = FW_MAX_ELECTRODES + 1;
    CHECK_EQUAL(fw_instrument_run(&b.host.instrument, &wrong), 1);
}

RUN_TESTS("start", bench_stop(&b))
