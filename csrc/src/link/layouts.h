/* Payloads are copied as they lie in memory. Written by tables/make_tables.py from
 * tables/link.toml. */
_Static_assert(sizeof(eits_packet_info) == 216, "eits_packet_info has padding");
_Static_assert(sizeof(eits_packet_reply) == 16, "eits_packet_reply has padding");
_Static_assert(sizeof(eits_packet_raw) == 16, "eits_packet_raw has padding");
_Static_assert(sizeof(eits_packet_solved) == 104, "eits_packet_solved has padding");
_Static_assert(sizeof(eits_packet_touch) == 60, "eits_packet_touch has padding");
_Static_assert(sizeof(eits_packet_drive_touches) == 20, "eits_packet_drive_touches has padding");
_Static_assert(sizeof(eits_packet_drive_touch) == 40, "eits_packet_drive_touch has padding");
_Static_assert(sizeof(eits_packet_events) == 12, "eits_packet_events has padding");
_Static_assert(sizeof(eits_packet_event) == 28, "eits_packet_event has padding");
_Static_assert(sizeof(eits_stage_stats) == 16, "eits_stage_stats has padding");
_Static_assert(sizeof(eits_packet_stats) == 164, "eits_packet_stats has padding");
_Static_assert(sizeof(eits_packet_fault) == 36, "eits_packet_fault has padding");
_Static_assert(sizeof(eits_command_plain) == 4, "eits_command_plain has padding");
_Static_assert(sizeof(eits_command_stream) == 12, "eits_command_stream has padding");
_Static_assert(sizeof(eits_command_tare) == 8, "eits_command_tare has padding");
_Static_assert(sizeof(eits_command_scan) == 24, "eits_command_scan has padding");
_Static_assert(sizeof(eits_command_solver) == 40, "eits_command_solver has padding");
_Static_assert(sizeof(eits_command_model_begin) == 12, "eits_command_model_begin has padding");
_Static_assert(sizeof(eits_command_model_data) == 8, "eits_command_model_data has padding");
_Static_assert(sizeof(eits_command_get_stats) == 8, "eits_command_get_stats has padding");
_Static_assert(sizeof(eits_command_mask_row) == 8, "eits_command_mask_row has padding");
_Static_assert(sizeof(eits_command_keepalive) == 8, "eits_command_keepalive has padding");
_Static_assert(sizeof(eits_command_settings) == 52, "eits_command_settings has padding");
_Static_assert(sizeof(eits_packet_hashes) == 68, "eits_packet_hashes has padding");
_Static_assert(sizeof(eits_command_probe) == 20, "eits_command_probe has padding");
_Static_assert(sizeof(eits_packet_probed) == 16, "eits_packet_probed has padding");
