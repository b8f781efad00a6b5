"""``eitskin info``: show what a board is, which model it has, how it scans, and its counters."""

import argparse
from typing import Any

from eitskin.cli.arguments import option
from eitskin.cli.device_options import add_device, open_named
from eitskin.cli.printing import answer, table
from eitskin.device.check import scanned_pattern
from eitskin.device.wire.packets import BoardInfo, BoardStats
from eitskin.model.storage import STORAGES


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Show what a board is, which model it has, how it scans, which faults it reports, and its"
        " counters."
    )
    add_device(parser)
    option(parser, "--reset-statistics", "set the counters to zero afterwards")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    with open_named(options) as device:
        info, url = device.board, device.transport.url
        replays = device.replays
        stats = None if replays else device.stats(reset=options.reset_statistics)
        hashes = device.hashes().as_dict()
    counted = None if stats is None else stats.as_dict()
    facts = {"device": url, "board": info.as_dict(), "sha256": hashes, "statistics": counted}
    shown = _facts(info, url) | {f"{name} SHA": one for name, one in hashes.items() if one}
    if stats is None:
        return answer(options, facts, table(shown))
    stages = [
        f"{name:10} {one.count:8d} {one.last_us:9d} {one.p99_us:9d} {one.worst_us:9d}"
        for name, one in stats.stages.items()
    ]
    head = "stage         count   last us    p99 us  worst us"
    return answer(options, facts, table(shown | _counted(stats)), head, *stages)


def _facts(info: BoardInfo, url: str) -> dict[str, Any]:
    facts = {"device": url, "board": info.board, "firmware": info.firmware_text}
    facts["serial"] = info.serial
    facts["name"] = info.name or "none; give one with  eitskin board --name NAME"
    facts["processor"] = f"{info.f_cpu_hz / 1e6:g} MHz" if info.f_cpu_hz else "none (simulated)"
    if info.has_model:
        storage = STORAGES[info.storage] if info.storage < len(STORAGES) else info.storage
        facts["model"] = (
            f"{info.model_bytes} of {info.bank_bytes} bytes in bank {info.bank}, checksum"
            f" {info.model_crc:08x}; {info.n_pixels} pixels, rank {info.rank}, {storage}"
        )
        rows = f"{info.n_electrodes} electrodes, {info.n_rows} rows, {info.n_folded} folded"
        facts["protocol"] = f"{scanned_pattern(info)} ({info.protocol_hash:016x}): {rows}"
    else:
        facts["model"] = "none; upload one with  eitskin model upload MODEL.eitm"
    facts |= _scan(info)
    facts["reference"] = (
        "taken" if info.tared else "none; leave the skin untouched and run  eitskin tare"
    )
    step_uv = info.volts_per_code_nv / 1e3
    facts["converter"] = (
        f"{step_uv:.1f} uV per step at the electrodes"
        if step_uv
        else ("another instrument's" if info.frames_given else "none (simulated)")
    )
    kept = ", ".join(info.setting_names) or "none"
    always = " (it flows even if no program listens)" if info.settings & 1 else ""
    facts["current"] = f"{info.drive_name}{always}; the owner's settings: {kept}"
    facts["faults"] = (
        ", ".join(code.name.lower().replace("_", " ") for code in info.fault_codes) or "none"
    )
    return facts


def _scan(info: BoardInfo) -> dict[str, str]:
    if info.frames_given:
        return {"scan": f"another instrument's; {info.frame_us / 1e3:.2f} ms per frame"}
    sampling = f"{info.samples} samples at {info.sample_rate_hz} per second"
    return {
        "excitation": f"{info.excitation_millihz / 1e3:.3f} Hz",
        "sampling": f"{sampling}, {info.settle_us} us after switching",
        "scan": f"{_rows(info)}; {info.slot_us} us per row, {info.frame_us / 1e3:.2f} ms per frame",
    }


def _rows(info: BoardInfo) -> str:
    if info.check_every == 1:
        return "all rows"
    return "one row of each reciprocal pair" + (
        f", all in one frame of {info.check_every}" if info.check_every else ""
    )


def _used(used: int, total: int) -> str:
    return f"{used} of {total} bytes" if total else f"{used} bytes"


def _counted(stats: BoardStats) -> dict[str, Any]:
    return {
        "up": f"{stats.uptime_ms / 1e3:.1f} s",
        "frames": (
            f"{stats.frames_scanned} scanned, {stats.frames_solved} solved;"
            f" {stats.deadlines_missed} deadlines missed, {stats.slots_repeated} measurements"
            " repeated"
        ),
        "sent": f"{stats.packets_sent} packets, {stats.packets_dropped} dropped (buffer full)",
        "received": (
            f"{stats.link_packets} packets, {stats.link_crc_errors} bad checksums,"
            f" {stats.link_framing_errors} broken, {stats.link_overruns} too long"
        ),
        "stack": _used(stats.stack_used, stats.stack_bytes),
        "workspace": _used(stats.workspace_used, stats.workspace_bytes),
    }
