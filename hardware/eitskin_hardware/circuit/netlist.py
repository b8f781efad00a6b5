"""The KiCad netlist and the electrical rules check, by SKiDL."""

import logging
import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

from eitskin_hardware.circuit.instrument import build_circuit


@dataclass(frozen=True)
class Checked:
    """The netlist, and ``messages`` with the errors and warnings of the electrical rules
    check."""

    netlist: str
    messages: tuple[str, ...]


class _Kept(logging.Handler):
    """Keeps messages of at least a warning."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


def check() -> Checked:
    """Build the circuit, check it by SKiDL's electrical rules, and return its KiCad netlist.

    It has no dates and paths, so that it is the same in every run."""
    skidl, circuit, _ = build_circuit()
    kept = _Kept()
    logger = logging.getLogger("ERC_Logger")
    logger.addHandler(kept)
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            others = [handler for handler in logger.handlers if handler is not kept]
            for handler in others:
                logger.removeHandler(handler)
            circuit.ERC()
            messages = tuple(kept.messages)
            logging.disable(logging.CRITICAL)
            circuit.generate_netlist(file_="instrument.net", tool=skidl.KICAD8)
            text = Path("instrument.net").read_text(encoding="utf-8")
        finally:
            logging.disable(logging.NOTSET)
            logger.removeHandler(kept)
            for handler in others:
                logger.addHandler(handler)
            os.chdir(here)
    return Checked(_repeatable(text), messages)


def _repeatable(text: str) -> str:
    text = re.sub(r'\(date "[^"]*"\)', '(date "")', text)
    text = re.sub(r'\(source "[^"]*"\)', '(source "circuit/instrument.py")', text)
    text = re.sub(r'\s*\(field\s*\(name "SKiDL Line"\)[^)]*\)', "", text)
    text = re.sub(r'\s*\(field\s*\(name "(Description|Datasheet)"\)\)', "", text)
    return re.sub(r'\s*\(comment\s*\(number "\d"\)\s*\(value ""\)\)', "", text)
