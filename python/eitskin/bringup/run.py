"""Run all stages in their order, up to the first one that fails."""

from collections.abc import Iterator

from eitskin.bringup.findings import STAGES, AskDone, AskNumber, Connect, StageReport
from eitskin.bringup.measuring import Prober
from eitskin.bringup.skin_stages import on_skin
from eitskin.bringup.stages import MEASURED, Bench
from eitskin.device.client import Device
from eitskin.errors import DeviceError

FIXTURES = {
    "nothing": "take everything off the electrode connector",
    "chain": "connect 1 kohm (1 %) from electrode 0 to 1, and 10 kohm from electrode 1 to 2",
    "ring": "connect 1 kohm (1 %) between each electrode and the next one, and from 15 to 0",
    "skin": "connect the dish or the skin, all 16 electrodes, and leave it untouched",
}


def bring_up(
    device: Device,
    connect: Connect,
    number: AskNumber,
    done: AskDone,
    *,
    first: str = STAGES[0],
    last: str = STAGES[-1],
) -> Iterator[StageReport]:
    """The report of each stage from ``first`` to ``last``; it ends with the first one that fails.
    ``connect`` puts a fixture of ``FIXTURES`` on the electrodes, or has somebody do it; ``number``
    and ``done`` ask for what only a person can read or do.

    Raises:
        DeviceError: the board does not know PROBE, or sends frames of another instrument.
    """
    info = device.info()
    if info.frames_given or not info.gain_ppm:
        raise DeviceError(
            f"{device.transport.name}: not the instrument of docs/guide/hardware.md, or simulated;"
            " bring-up needs a board, or  emu:"
        )
    now: list[str] = []

    def connect_once(fixture: str) -> None:
        if now != [fixture]:
            connect(fixture)
            now[:] = [fixture]

    bench = Bench(Prober(device), connect_once, number, done)
    for stage in STAGES[STAGES.index(first) : STAGES.index(last) + 1]:
        report = MEASURED[stage](bench) if stage in MEASURED else on_skin(bench, stage)
        yield report
        if not report.good:
            return
