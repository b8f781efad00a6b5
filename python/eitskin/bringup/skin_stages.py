"""The last two stages: a dish with salt water, and the skin itself, by the doctor's checks."""

from eitskin.bringup.findings import Finding, StageReport
from eitskin.bringup.stages import Bench
from eitskin.device.known_model import find_model
from eitskin.frames.doctor.examine import examine_case
from eitskin.frames.doctor.report import FAULT
from eitskin.session.checks.diagnose_board import board_findings, board_subject, measure

FRAMES = 8


def on_skin(bench: Bench, stage: str) -> StageReport:
    """Examine untouched frames, and whether source and amplifier serve the skin."""
    bench.connect("skin")
    device = bench.probe.device
    report = StageReport(stage)
    wrong = device.unserved()
    if wrong is not None:
        report.findings.append(Finding("greatest row", "out of range", "in range", wrong))
        return report
    known = find_model(device.board, None, device.transport.name)
    found = measure(device, FRAMES, touched=False, before_touches=lambda: None)
    doctor, _ = examine_case(board_subject(device, found, known, None))
    for one in board_findings(doctor, found).findings:
        if one.severity == FAULT:
            report.findings.append(Finding(one.name, "found", "none", one.text))
    if report.good:
        report.findings.append(Finding("electrodes, wires, order", "nothing wrong", "nothing"))
    return report
