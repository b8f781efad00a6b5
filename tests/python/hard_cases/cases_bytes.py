"""The catalogue's group Bytes: whatever comes from outside as bytes. Fuzzed by libFuzzer
(tests/fuzz) and by hypothesis."""

from __future__ import annotations

from hard_case import Case

FUZZ = "tests/fuzz"

CASES = (
    Case(
        "bytes/model",
        "Any bytes as a model",
        "A model file is cut, flipped, spliced or made up, its checksum right or not.",
        "Lengths, indices and numbers in it reach into memory and arithmetic.",
        "Refused and nothing touched; or opened, and every number out of it is finite. C and Python"
        " agree on which.",
        (
            f"{FUZZ}/fuzz_model.c",
            "bytes/test_bytes_models.py::test_a_damaged_model_is_refused_in_a_line",
            "bytes/test_bytes_models.py::test_a_damaged_model_with_a_right_checksum_is_refused_or_used",
        ),
    ),
    Case(
        "bytes/endless-model",
        "A model that never ends",
        "A valid model's defaults ask for four thousand million iterations.",
        "Nothing is wrong with the bytes, and a board that runs its self-test hangs.",
        "Refused above 100,000.",
        ("bytes/test_bytes_models.py::test_iterations_without_end_are_refused",),
    ),
    Case(
        "bytes/wire",
        "Any bytes on the wire",
        "Noise, and packets cut, damaged and run together, in any pieces.",
        "A decoder keeps state between pieces, and trusts lengths.",
        "Whatever the pieces, the same packets come out; each stretch is counted once; nothing"
        " unchecked is used.",
        (
            f"{FUZZ}/fuzz_link.c",
            "bytes/test_bytes_packets.py::test_any_line_gives_packets_whatever_the_pieces",
        ),
    ),
    Case(
        "bytes/payloads",
        "Any payload, any command",
        "The checksum is right, the content is not.",
        "Counts and enumerations come from the other side.",
        "A payload is of its type or malformed, and said so on one line; a command is read as a"
        " board reads it, or not at all.",
        (
            "bytes/test_bytes_packets.py::test_any_payload_is_of_its_type_or_malformed",
            "bytes/test_bytes_packets.py::test_any_command_is_read_as_a_board_reads_it_or_not_at_all",
        ),
    ),
    Case(
        "bytes/frame",
        "Any numbers as a frame",
        "Frames of any float bits, with any options, masks and tares, in any order.",
        "Infinities, denormals and the ends of the range meet in sums.",
        "Finite results, a residual no worse than at zero, the same bits from portable and AVX2"
        " kernels.",
        (f"{FUZZ}/fuzz_frame.c", "tests/c/test_out_of_range.c", "tests/c/test_extremes.c"),
    ),
    Case(
        "bytes/descriptions",
        "Any text as a scene or a skin",
        "Values of other kinds, nested deep, huge, or no text at all.",
        "Parsers recurse, and numbers overflow.",
        "Read, or refused on one line.",
        (
            "bytes/test_bytes_descriptions.py::test_any_scene_is_read_or_refused_in_a_line",
            "bytes/test_bytes_descriptions.py::test_any_skin_is_read_or_refused_in_a_line",
            "bytes/test_bytes_descriptions.py::test_each_value_of_a_wrong_kind_is_refused_in_a_line",
        ),
    ),
    Case(
        "bytes/recording",
        "Any bytes as a recording",
        "Damage anywhere in a run, any JSON as its note.",
        "One bad packet must not cost the others.",
        "The others are read, or the file is refused on one line.",
        (
            "bytes/test_bytes_packets.py::test_any_recording_is_read_or_refused_in_a_line",
            "bytes/test_bytes_packets.py::test_any_head_of_a_recording",
        ),
    ),
    Case(
        "bytes/imported",
        "Any imported file",
        "Damaged archives, text tables and MATLAB files; fields that hold anything.",
        "Other people's parsers raise anything, and warn.",
        "Frames, or a refusal on one line; what the output file held before stays.",
        (
            "bytes/test_bytes_frames.py::test_any_archive_is_frames_or_refused",
            "bytes/test_bytes_frames.py::test_a_damaged_frames_file_is_refused",
            "bytes/test_bytes_frames.py::test_any_text_table_is_frames_or_refused",
            "bytes/test_bytes_frames.py::test_any_matlab_file_is_frames_or_refused",
            "bytes/test_bytes_frames.py::test_a_refused_import_leaves_what_was_there",
        ),
    ),
    Case(
        "bytes/results",
        "Any results to go on from",
        "A torn store of a long run, a front of other measurements, a damaged firmware image.",
        "Hours of work must not be lost by a last line that was cut.",
        "What is whole is used, the rest passed over or refused.",
        (
            "bytes/test_bytes_results.py::test_a_run_goes_on_from_any_store",
            "bytes/test_bytes_results.py::test_any_results_of_the_trade_off_are_read_or_refused",
            "bytes/test_bytes_results.py::test_any_firmware_image_is_checked_or_refused",
        ),
    ),
)
