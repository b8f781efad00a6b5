"""Recordings (.eits): the packets of a link as they were received, one after another, each handed
to the system at once and brought to the disk every second: a killed recorder loses at most the
last, a machine that loses power two seconds. Reading one goes through the live decoder.
docs/reference/link-protocol.md, "Recordings", specifies the file.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from eitskin import __version__
from eitskin.core.results import Options, check_options
from eitskin.device.client import Device
from eitskin.device.recordings.new_file import RecordingFile
from eitskin.device.transport import Capabilities, SimulatedScene, Transport
from eitskin.device.wire.codec import Decoder, Packet, encode
from eitskin.device.wire.link_table import LINK_VERSION, PacketType, Stream
from eitskin.device.wire.packets import BoardHashes
from eitskin.device.wire.payloads import pack
from eitskin.errors import DeviceError, EitskinError, FileError
from eitskin.fileio import parse_json

FORMAT = "eits"
LOOP = "?loop=1"  # ends the noted URL of a scene that began again at its end
VERSION = 1
CHUNK = 1 << 16
MAX_HEAD = 4096
# recordings of versions with a whole-frame tracker note them
FORMER_OPTIONS = ("track_confirm", "track_hold", "track_smooth")
LOOKED_THROUGH = 64 * CHUNK  # the note of the solver is among the first packets


class Recorder:
    """Writes every packet that ``device`` receives to the new file ``path`` until it is closed,
    after the ``options`` that its solver has, so that the host can solve it again. The recorded
    board has the name ``name``, or else the device's. ``packets`` and ``bytes`` count. If writing
    fails, such as on a full disk, the stream ends with the error; with ``failed`` only the
    recording ends, and ``failed`` gets the error, in whatever thread.

    Raises:
        FileError: the file exists already (with ``overwrite``: is being recorded to), or cannot be
            written.
        DeviceError: the board does not answer.
    """

    def __init__(
        self,
        path: str | Path,
        device: Device,
        options: Options | None = None,
        *,
        name: str | None = None,
        overwrite: bool = False,
        failed: Callable[[FileError], object] | None = None,
    ) -> None:
        self.path, self._device = Path(path), device
        self._failed, self._over = failed, False
        self.packets = self.bytes = 0
        info = device.board if device.transport.capabilities.replays else device.info()
        info = replace(info, name=name or info.name)
        head = {
            "format": FORMAT,
            "version": VERSION,
            "eitskin": __version__,
            "url": device.transport.url + _loop_mark(device.transport.capabilities.scene),
            "model_crc": f"{info.model_crc:08x}",
            "sha256": device.hashes().as_dict(),
        }
        first = encode(PacketType.RECORDING, 0, json.dumps(head).encode())
        self._file = RecordingFile(self.path, first, overwrite=overwrite)
        self.bytes += len(first)
        try:

            def begin(last_sequence: int) -> None:
                self._write(PacketType.INFO, last_sequence, pack(info))

            device.link.begin_tap(begin, self._take)
            if options is not None:
                note = json.dumps({"solver": asdict(options)})
                self._write(PacketType.RECORDING, 0, note.encode())
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop recording; may be called twice."""
        self._device.link.end_tap(self._take)
        self._file.close()

    def _take(self, packet: Packet) -> None:
        if self._over:
            return
        try:
            self._write(packet.type, packet.sequence, packet.payload)
        except FileError as error:
            if self._failed is None:
                raise
            self._over = True
            self._failed(error)
            return
        self.packets += 1

    def _write(self, packet_type: int, sequence: int, payload: bytes) -> None:
        data = encode(packet_type, sequence, payload)
        self._file.write(data)
        self.bytes += len(data)
        self._file.sync_now_and_then()


class FileTransport(Transport):
    """A recording in place of a board: its bytes, and nothing to be asked.

    Raises:
        FileError: it cannot be read, or is no recording.
        DeviceError: it is of a newer version.
    """

    def __init__(self, path: str | Path) -> None:
        self.url, self.name = f"file:{path}", str(path)
        self.head = read_head(path)
        scene = _noted_scene(str(self.head.get("url", "")))
        self._capabilities = Capabilities(own_clock=True, replays=True, scene=scene)
        self._hashes = _noted_hashes(self.head.get("sha256"))
        self._file = Path(path).open("rb")  # noqa: SIM115 -- open as long as the device is
        self.ended = False

    @property
    def capabilities(self) -> Capabilities:
        return self._capabilities

    @property
    def known_hashes(self) -> BoardHashes:
        return self._hashes

    def read(self, timeout_s: float) -> bytes:
        """The next bytes; at the end once a zero, so that a packet cut short is counted."""
        if self.ended:
            return b""
        try:
            data = self._file.read(CHUNK)
        except (OSError, ValueError) as error:
            raise DeviceError(f"{self.name}: cannot be read any more ({error})") from None
        if not data:
            self.ended = True
            return b"\0"
        return data

    def write(self, data: bytes) -> None:
        raise DeviceError(f"{self.name} is a recording and takes no commands")

    def close(self) -> None:
        self.ended = True
        self._file.close()


def read_head(path: str | Path) -> dict[str, Any]:
    """The head of the recording in ``path``."""
    try:
        with Path(path).open("rb") as stream:
            data = stream.read(MAX_HEAD)
    except FileNotFoundError:
        raise FileError(f"{path}: no such recording; check the path") from None
    except OSError as error:
        raise FileError(f"{path}: cannot read this recording ({error.strerror})") from None
    decoder = Decoder()
    packets, other = decoder.feed(data), decoder.other_version
    if not packets and other is not None:
        advice = (
            "upgrade eitskin"
            if other > LINK_VERSION
            else "read it with the eitskin that recorded it, or record again"
        )
        raise DeviceError(
            f"{path}: packets of link version {other}, and this eitskin reads version"
            f" {LINK_VERSION}; {advice}"
        )
    if not packets or packets[0].type != PacketType.RECORDING:
        raise FileError(
            f"{path}: no eitskin recording (.eits), or cut in its first bytes; make one with "
            " eitskin record"
        )
    try:
        head = parse_json(packets[0].payload)
    except ValueError:
        head = None
    if (
        not isinstance(head, dict)
        or head.get("format") != FORMAT
        or not isinstance(head.get("version"), int)
    ):
        raise FileError(
            f"{path}: no eitskin recording (.eits): its first packet says something else"
        )
    if head["version"] > VERSION:
        raise DeviceError(
            f"{path}: recording version {head['version']}, this eitskin reads up to {VERSION};"
            " upgrade eitskin"
        )
    return head


def _noted_scene(url: str) -> SimulatedScene | None:
    """The scene before the recorded board; None if the skin was real."""
    scheme, _, name = url.removesuffix(LOOP).partition(":")
    if scheme not in ("sim", "emu"):
        return None
    return SimulatedScene(name, held=scheme == "emu", loop=url.endswith(LOOP), recorded=True)


def _loop_mark(scene: SimulatedScene | None) -> str:
    """Return the text that follows the URL of a scene which begins again at its end."""
    return LOOP if scene is not None and scene.loop and not scene.recorded else ""


def _noted_hashes(noted: Any) -> BoardHashes:
    """The hashes that the head notes; zero where it notes none, or no hash."""
    values = []
    for name in ("model", "firmware"):
        text = str(noted.get(name)) if isinstance(noted, dict) else ""
        known = re.fullmatch("[0-9a-f]{64}", text) is not None
        values.append(bytes.fromhex(text) if known else bytes(32))
    return BoardHashes(0, *values)


def recorded_options(path: str | Path) -> Options | None:
    """The solver's options that the recording notes; None if it notes none.

    Raises:
        FileError, DeviceError: as ``read_head``; or the note cannot be read.
    """
    read_head(path)
    for note in _notes(path):
        if "solver" in note:
            try:
                noted = {k: v for k, v in note["solver"].items() if k not in FORMER_OPTIONS}
                options = Options(**noted)
                check_options(options)
            except (TypeError, EitskinError) as error:
                raise FileError(
                    f"{path}: its note on the solver is not valid ({error}); record again"
                ) from None
            return options
    return None


def recorded_kinds(path: str | Path) -> Stream:
    """The kinds of packets of frames that the recording holds."""
    kinds, decoder = Stream(0), Decoder()
    try:
        with Path(path).open("rb") as stream:
            while data := stream.read(CHUNK):
                for packet in decoder.feed(data):
                    kinds |= _KIND_OF.get(packet.type, Stream(0))
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from None
    return kinds


_KIND_OF: dict[int, Stream] = {PacketType[kind.name or ""]: kind for kind in Stream}


def _notes(path: str | Path) -> Iterator[dict[str, Any]]:
    decoder, read = Decoder(), 0
    with Path(path).open("rb") as stream:
        while read < LOOKED_THROUGH and (data := stream.read(CHUNK)):
            read += len(data)
            for packet in decoder.feed(data):
                if packet.type == PacketType.RECORDING:
                    try:
                        note = parse_json(packet.payload)
                    except ValueError:
                        continue
                    if isinstance(note, dict):
                        yield note
