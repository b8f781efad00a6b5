/* Checks what the drivers write to multiplexers and generator, on boards without hardware. These
 * are violations: current although no host was heard within the last second; an address that
 * changes before the multiplexer is open; two electrodes on one of I+, I-, V+, V-; both ends of a
 * pair on one electrode; a generator that changes while current flows. The first violation is kept
 * as a sentence. The lines are those of drivers/adg1206.h, for up to 64 electrodes. */
#ifndef DRIVE_MONITOR_H
#define DRIVE_MONITOR_H

#include "boards/parts/ad9833_model.h"

#include <stddef.h>

#define DRIVE_MONITOR_OPEN_NS   140u        /* the slowest ADG1206 (data sheet, table 1) */
#define DRIVE_MONITOR_SILENT_NS 1000000000u /* what is promised */
#define DRIVE_MONITOR_ENABLES   0xFFFF0000u
#define DRIVE_MONITOR_NOTHING   0xFFu /* in place of an electrode */

typedef struct drive_monitor {
    uint32_t lines;
    uint64_t opened_ns, heard_ns;
    bool needs_host; /* false: silence is allowed */
    bool heard;      /* ever, since power came */
    bool runs;       /* the generator does */
    const char *violation;
} drive_monitor;

/* The electrodes that the lines join to I+, I-, V+ and V-. Returns how many of these are joined;
 * more than four if one of them has two. */
static inline uint32_t drive_monitor_joined(uint32_t lines, uint8_t electrodes[4])
{
    uint32_t joined = 0;
    for (uint32_t k = 0; k < 4; ++k) {
        electrodes[k] = DRIVE_MONITOR_NOTHING;
        for (uint32_t part = 0; part < 4; ++part) {
            if ((lines >> (16u + 4u * part + k) & 1u) == 0)
                continue;
            joined += electrodes[k] == DRIVE_MONITOR_NOTHING ? 1u : 5u;
            electrodes[k] = (uint8_t)(16u * part + (lines >> 4u * k & 15u));
        }
    }
    return joined;
}

static inline void drive_monitor_note(drive_monitor *m, bool wrong, const char *what)
{
    if (wrong && m->violation == NULL)
        m->violation = what;
}

/* Call before each write; may be called at any time. */
static inline void drive_monitor_look(drive_monitor *m, uint64_t now_ns)
{
    const bool drives = m->runs && (m->lines & DRIVE_MONITOR_ENABLES) != 0;
    drive_monitor_note(m, drives && m->needs_host && !m->heard,
                       "current flows and no host has ever asked");
    drive_monitor_note(m,
                       drives && m->needs_host && now_ns > m->heard_ns &&
                           now_ns - m->heard_ns > DRIVE_MONITOR_SILENT_NS,
                       "current flows more than 1 s after the host's last packet");
}

static inline void drive_monitor_heard(drive_monitor *m, uint64_t now_ns)
{
    m->heard = true;
    m->heard_ns = now_ns;
}

static inline void drive_monitor_lines(drive_monitor *m, uint32_t mask, uint32_t levels,
                                       uint64_t now_ns)
{
    const uint32_t before = m->lines, after = (before & ~mask) | (levels & mask);
    const uint32_t on = after & DRIVE_MONITOR_ENABLES;
    uint8_t four[4];
    const uint32_t joined = drive_monitor_joined(after, four);
    drive_monitor_note(m,
                       ((before ^ after) & 0xFFFFu) != 0 && (before & DRIVE_MONITOR_ENABLES) != 0,
                       "a multiplexer's address changes while it is enabled");
    drive_monitor_note(m,
                       ((before ^ after) & 0xFFFFu) != 0 && on == 0 &&
                           now_ns - m->opened_ns < DRIVE_MONITOR_OPEN_NS,
                       "a multiplexer's address changes before it is open");
    drive_monitor_note(m, joined > 4, "one of I+, I-, V+ and V- is on two electrodes");
    drive_monitor_note(m, joined == 4 && four[0] == four[1], "I+ and I- are on the same electrode");
    drive_monitor_note(m, joined == 4 && four[2] == four[3], "V+ and V- are on the same electrode");
    if ((before & DRIVE_MONITOR_ENABLES) != 0 && on == 0)
        m->opened_ns = now_ns;
    m->lines = after;
    drive_monitor_look(m, now_ns);
}

/* After a word to the generator, with its present state. */
static inline void drive_monitor_word(drive_monitor *m, const ad9833_model *part, uint16_t word,
                                      uint64_t now_ns)
{
    const bool stops = (word >> 14) == 0 && (word & AD9833_MODEL_RESET) != 0;
    drive_monitor_note(m, !stops && (m->lines & DRIVE_MONITOR_ENABLES) != 0,
                       "the generator changes while multiplexers are enabled");
    m->runs = ad9833_model_runs(part);
    drive_monitor_look(m, now_ns);
}

#endif
