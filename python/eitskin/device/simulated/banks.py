"""The model banks of a simulated board and uploads into them, by the rules of the firmware's
upload.c."""

from __future__ import annotations

import zlib

from eitskin.device.bank import ERASED, newest_bank, read_record, record_bytes, record_offset
from eitskin.device.simulated.checks import OK, Answer
from eitskin.device.simulated.solve import SimSolver, core_status
from eitskin.device.wire.commands import ModelBegin, ModelData
from eitskin.device.wire.packets import MAX_PAYLOAD
from eitskin.device.wire.packets import ReplyStatus as Status
from eitskin.device.wire.payloads import RAW_STRUCT, SOLVED_STRUCT
from eitskin.errors import EitskinError, ModelError

LEAST_MODEL = 64
E_MODEL_MAGIC = -4


class _Upload:
    """A model on its way into a bank."""

    def __init__(self, bank: int, size: int, crc: int) -> None:
        self.bank, self.size, self.crc, self.offset = bank, size, crc, 0


class SimBanks:
    """Two banks. ``in_use``: the one whose model is taken up, None without a model; ``active``: an
    upload stops the scan."""

    def __init__(self, banks: list[bytes], electrodes: int) -> None:
        self.banks = [bytearray(bank) for bank in banks]
        self.electrodes = electrodes
        self.in_use: int | None = None
        self.active = False
        self._upload: _Upload | None = None

    @property
    def room(self) -> int:
        """Most bytes of a model."""
        return record_offset(len(self.banks[0]))

    def restart(self) -> None:
        """Forget an upload that was under way."""
        self._upload, self.active = None, False

    def open_newest(self) -> tuple[SimSolver | None, int]:
        """The newest valid model taken up, or None and the eits_status of the newest."""
        self.in_use, why = None, E_MODEL_MAGIC
        newest = newest_bank([bytes(bank) for bank in self.banks])
        for number in [] if newest is None else [newest, 1 - newest]:
            record = read_record(bytes(self.banks[number]))
            if record is None:
                continue
            try:
                solver = SimSolver(bytes(self.banks[number][: record.model_bytes]))
            except ModelError as error:
                why = core_status(error)
                continue
            self.in_use = number
            return solver, 0
        return None, why

    def begin(self, command: ModelBegin) -> Answer:
        """MODEL_BEGIN: the bank that is not in use is erased, or an upload of the same model goes
        on where it was."""
        if command.bytes < LEAST_MODEL:
            return Answer(Status.RANGE, (4, LEAST_MODEL))
        if command.bytes > self.room:
            return Answer(Status.MODEL_SIZE, (self.room, 0))
        self.active = True
        now = self._upload
        if now is not None and (now.size, now.crc) == (command.bytes, command.crc):
            return Answer(Status.OK, (now.offset, 0))
        spare = (
            1 - self.in_use
            if self.in_use is not None
            else int(read_record(bytes(self.banks[0])) is not None)
        )
        self.banks[spare][:] = bytes([ERASED]) * len(self.banks[spare])
        self._upload = _Upload(spare, command.bytes, command.crc)
        return OK

    def data(self, command: ModelData) -> Answer:
        """MODEL_DATA: in order, whole words but at the end."""
        upload = self._upload
        if upload is None:
            return Answer(Status.OFFSET, (-1, 0))
        self.active = True
        if command.offset != upload.offset:
            return Answer(Status.OFFSET, (upload.offset, 0))
        size, left = len(command.data), upload.size - upload.offset
        if size > left:
            return Answer(Status.RANGE, (4, upload.size))
        if size % 4 and size != left:
            return Answer(Status.LENGTH, (8 + size - size % 4, 0))
        self.banks[upload.bank][upload.offset : upload.offset + size] = command.data
        upload.offset += size
        return OK

    def commit(self) -> Answer:
        """MODEL_COMMIT: OK once the model is verified and its record written; then take it up by
        ``open_newest``."""
        upload = self._upload
        if upload is None or upload.offset != upload.size:
            return Answer(Status.OFFSET, (-1 if upload is None else upload.offset, 0))
        self.restart()
        blob = bytes(self.banks[upload.bank][: upload.size])
        answer = self._tried(blob, upload.crc)
        if answer.status == Status.OK:
            other = read_record(bytes(self.banks[1 - upload.bank]))
            record = record_bytes(blob, 1 if other is None else other.generation + 1)
            self.banks[upload.bank][-len(record) :] = record
        return answer

    def _tried(self, blob: bytes, crc: int) -> Answer:
        if zlib.crc32(blob) != crc:
            return Answer(Status.MODEL_CRC)
        try:
            solver = SimSolver(blob)
        except ModelError as error:
            return Answer(Status.MODEL_INVALID, (core_status(error), 0))
        protocol = solver.model.protocol
        if protocol.n_electrodes > self.electrodes:
            return Answer(Status.MODEL_SCAN, (protocol.n_electrodes, self.electrodes))
        longest = max(
            RAW_STRUCT.size + 5 * protocol.n_rows,
            SOLVED_STRUCT.size + 4 * solver.model.grid.n_pixels,
        )
        if longest > MAX_PAYLOAD:
            return Answer(Status.MODEL_SIZE, (MAX_PAYLOAD, longest))
        return golden(solver)


def golden(solver: SimSolver) -> Answer:
    """Whether the model's golden frame gives its bits."""
    try:
        difference = solver.self_test()
    except EitskinError as error:
        return Answer(Status.CORE, (core_status(error), 0))
    return OK if difference == 0 else Answer(Status.SELF_TEST, (int(1e9 * min(difference, 2.0)), 0))
