/* The numbers of this module that are a choice, with their reasons. Written by
 * tables/make_tables.py from tables/constants.toml. */
#ifndef EITSKIN_FIRMWARE_CONSTANTS_H
#define EITSKIN_FIRMWARE_CONSTANTS_H

/* clang-format off */

/* ---- Chosen: the numbers of diagnostics, for a frame without a reference; not measured by
 * themselves. Check: ctest --preset host -R fw_quality */

/* least expected size of a row that shows whether an electrode is connected [of the rms of all
 * rows]. as ROW_SIGNIFICANT */
#define FW_OPEN_SIGNIFICANT 0.3f

/* a row with less is dead [of what is expected]. as ROW_DEAD_FRACTION */
#define FW_OPEN_FRACTION 0.02f

/* at least this many rows must be dead, and no other row alive [rows]. as ROWS_TO_JUDGE */
#define FW_OPEN_MIN_ROWS 3

/* ---- Chosen: by hand. On the scene real_board, channels whose gains differ by a few per cent give
 * 0.054; electrodes that are mixed up give far more. Check: ctest --preset host -R fw_quality */

/* reciprocal rows that differ by more are a fault [of the frame's rms]. larger: electrodes that are
 * mixed up pass; smaller: unequal channels raise a fault */
#define FW_RECIPROCITY_FRACTION 0.1f

/* this many frames in a row raise or clear the fault [frames]. larger: a late fault; smaller: a
 * touch that lands within a scan raises it */
#define FW_RECIPROCITY_FRAMES 3

/* clang-format on */

#endif
