"""Compare each kernel of the C core on this processor with the machine's measured peaks.

A kernel can be no faster than its data can be read from where they lie, than its
multiply-accumulates can be done, or than its longest chain of dependent ones, since the order of
each sum is fixed. Each of the three is measured in the same run, in turns; the limit is the slowest
of the three.
"""

import subprocess
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.errors import UsageError
from eitskin_emulator.core_on_qemu import checkout_root, need_tools
from eitskin_studies.harness.machine import machine
from eitskin_studies.harness.sections import Filling, text_table

WIDTHS = ("f32", "f64")
PEAKS = ("fma", "chain", "read")
MAX_TIMES = 3.0
BEYOND = 64 << 20


@dataclass(frozen=True)
class Timing:
    """A case: multiply-accumulates and bytes of a call, bytes worked on, dependent FMAs, and
    nanoseconds of a call: median and quartiles over the rounds."""

    name: str
    storage: str
    macs: float
    bytes: float
    footprint: float
    chain: float
    ns: float
    quartiles_ns: tuple[float, float]


@dataclass(frozen=True)
class KernelAgainstLimit:
    """A kernel beside its limit: ``binds`` says which; ``times`` how many times slower it is."""

    timing: Timing
    limit_ns: float
    binds: str
    times: float

    @property
    def hot(self) -> bool:
        """Return whether a prepared context calls it in each frame; the others serve contexts
        without room for panels."""
        name = self.timing.name
        by_columns = (name, self.timing.storage) == ("mul, 48 columns", "f32")
        return by_columns or name.startswith(("panels", "dot", "axpy", "prox", "unpack"))


@dataclass(frozen=True)
class Width:
    """All kernels in one width. Peaks: 10^9 multiply-accumulates a second, ns of a dependent FMA,
    GB/s read by bytes read."""

    width: str
    kernels: str
    fma_per_ns: float
    chain_ns: float
    read_gb_s: dict[int, float]
    judged: tuple[KernelAgainstLimit, ...]


@dataclass(frozen=True)
class KernelTimes:
    """Both widths."""

    rank: int
    columns: int
    rounds: int
    machine: str
    widths: tuple[Width, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def run(
    rank: int = 64, columns: int = 812, rounds: int = 41, build: Path | None = None
) -> KernelTimes:
    """Build the two programs and run them.

    Raises:
        UsageError: no checkout, no compiler, or no AVX2.
    """
    root = checkout_root()
    need_tools("cc", "cmake", "ninja")
    with tempfile.TemporaryDirectory(prefix="eitskin-kernels-") as name:
        folder = build or Path(name)
        configure = [
            "cmake",
            "-S",
            str(root / "studies" / "bench"),
            "-B",
            str(folder),
            "-G",
            "Ninja",
            "-DCMAKE_BUILD_TYPE=Release",
        ]
        _run(configure)
        _run(
            [
                "cmake",
                "--build",
                str(folder),
                *(word for width in WIDTHS for word in ("--target", f"bench_kernels_{width}")),
            ]
        )
        programs = {width: folder / f"bench_kernels_{width}" for width in WIDTHS}
        outputs = {
            width: _run([str(program), *map(str, (rank, columns, rounds))])
            for width, program in programs.items()
        }
    return KernelTimes(
        rank,
        columns,
        rounds,
        machine(),
        tuple(judge(width, output) for width, output in outputs.items()),
    )


def _run(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UsageError(
            f"bench kernels: {command[0]} failed ({done.returncode}):"
            f" {(done.stdout + done.stderr).strip()[-400:]}"
        )
    return done.stdout


def parse(output: str) -> tuple[str, list[Timing]]:
    """The kernels' name and the cases that the program printed."""
    kernels, timings = "", []
    for line in output.splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "kernels":
            kernels = rest
        elif kind == "case":
            name, storage, *numbers, rounds = rest.split(";")
            macs, size, footprint, chain = map(float, numbers)
            ns = np.array([float(value) for value in rounds.split(",")])
            low, middle, high = (float(q) for q in np.percentile(ns, [25, 50, 75]))
            timings.append(Timing(name, storage, macs, size, footprint, chain, middle, (low, high)))
    return kernels, timings


def judge(width: str, output: str) -> Width:
    """Hold each kernel of a program's ``output`` against the peaks in it."""
    kernels, timings = parse(output)
    fma = next(t.ns / t.macs for t in timings if t.name == "fma")
    chain = next(t.ns / t.chain for t in timings if t.name == "chain")
    reads = {int(t.footprint): t.bytes / t.ns for t in timings if t.name == "read"}
    judged = []
    for t in timings:
        if t.name in PEAKS:
            continue
        near = min(reads, key=lambda size: abs(size - t.footprint))
        limits = {
            "memory": t.bytes / reads[near],
            "arithmetic": t.macs * fma,
            "chain": t.chain * chain,
        }
        binds = max(limits, key=lambda one: limits[one])
        judged.append(KernelAgainstLimit(t, limits[binds], binds, t.ns / limits[binds]))
    return Width(width, kernels, 1 / fma, chain, reads, tuple(judged))


HEAD = (
    "kernel", "storage", "f32: ns", "f32: limit", "f32: times", "f64: ns", "f64: limit",
    "f64: times",
)  # fmt: skip


def rows(result: KernelTimes) -> list[tuple[str, ...]]:
    """A row a kernel, both widths side by side."""
    found = []
    for pair in zip(*(width.judged for width in result.widths), strict=True):
        words = [pair[0].timing.name, pair[0].timing.storage]
        for j in pair:
            words += [f"{j.timing.ns:.0f}", f"{j.limit_ns:.0f} ({j.binds})", f"{j.times:.2f}"]
        found.append(tuple(words))
    return found


def peaks_text(width: Width) -> str:
    """One line."""
    inside = [rate for size, rate in width.read_gb_s.items() if 40_000 <= size < BEYOND]
    return (
        f"{width.width}: {width.fma_per_ns:.1f} billion multiply-accumulates a second,"
        f" {width.chain_ns:.2f} ns a dependent one; read {max(width.read_gb_s.values()):.0f} GB/s"
        f" at best, {np.median(inside):.0f} GB/s from 0.05 to 0.4 MB, {width.read_gb_s[BEYOND]:.0f}"
        " GB/s from 64 MiB"
    )


def missed(result: KernelTimes, hot: bool) -> list[str]:
    """The kernels beyond three times their limit, of those that a prepared context calls (``hot``)
    or of the others."""
    return [
        f"{j.timing.name} {j.timing.storage} ({width.width}) {j.times:.1f}"
        for width in result.widths
        for j in width.judged
        if j.times > MAX_TIMES and j.hot == hot
    ]


def as_text(result: KernelTimes) -> str:
    """For a terminal."""
    beyond = "; ".join(missed(result, True)) or "nothing"
    last = f"of what a prepared context calls, beyond {MAX_TIMES:g} times its limit: {beyond}"
    table = text_table(HEAD, rows(result))
    return "\n".join([_conditions(result), *map(peaks_text, result.widths), "", table, last])


def _conditions(result: KernelTimes) -> str:
    return (
        f"{result.columns} columns of {result.rank}, {result.widths[0].kernels} kernels,"
        f" {result.rounds} rounds; {result.machine}"
    )


def for_page(result: KernelTimes, command: str) -> Filling:
    """The marks of studies/results/benchmarks.md: of all kernels that a prepared context calls, how
    many times their limit they take."""
    said = []
    for width in result.widths:
        times = [one.times for one in width.judged if one.hot]
        said.append(f"{min(times):.1f} to {max(times):.1f} times their limit in {width.width}")
    beyond = "; ".join(missed(result, True)) or "none"
    text = (
        f"By `{command}`: {_conditions(result)}. The kernels that a frame calls take"
        f" {' and '.join(said)}. These take more than {MAX_TIMES:g} times: {beyond}."
    )
    return {"kernels-run": text}, {"kernels": (HEAD, rows(result))}
