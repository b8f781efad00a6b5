"""The way of bytes to a board and back: the interface of every kind of device, and the abilities
that it declares. No caller uses more of a transport than this."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from eitskin.device.wire.packets import BoardHashes
from eitskin.errors import DeviceError


@dataclass(frozen=True)
class SimulatedScene:
    """The scene before a simulated skin: its ``name`` as ``eitskin scene`` knows it, or a file.

    Attributes:
        held: the board shows the last frame that has begun, and holds the scene's last one; else it
            shows the frame that is nearest to the beginning of a scan, and the scene ends.
        loop: the scene begins again at its end.
        recorded: it was before the board whose recording this is.
        rate_hz: the frames per second that the scene asks of the board; None: whatever it scans.
    """

    name: str
    held: bool = False
    loop: bool = False
    recorded: bool = False
    rate_hz: float | None = None


@dataclass(frozen=True)
class Capabilities:
    """The capabilities of a kind of device.

    Attributes:
        own_clock: the board runs only while ``read`` is called (simulated, emulated, recorded). It
            is read by whoever asks, without a thread, so that runs can be repeated to the bit;
            timeouts count in the board's own time, and frames may be held back as long as anyone
            likes.
        replays: it is a recording: nothing can be asked of it.
        slow: its time passes more slowly than ours: ``watch`` says how far it is.
        baud: bits per second of the line, where a line limits how many frames come.
        scene: what a simulated skin is shown; None before a real one.
        finger_mm: the radius of the fingers that ``press`` puts on a simulated skin; None: the skin
            cannot be pressed by a program.
        offset, scale: an instrument's own number is a voltage after ``offset`` was added to it and
            it was multiplied by ``scale``.
        instrument: the frames come from another instrument, which no command can reset.
    """

    own_clock: bool = False
    replays: bool = False
    slow: bool = False
    baud: int | None = None
    scene: SimulatedScene | None = None
    finger_mm: float | None = None
    offset: float = 0.0
    scale: float = 1.0
    instrument: bool = False


@dataclass(frozen=True)
class LinkEvent:
    """Something happened to the link itself. ``kind``: "gap" (at least ``missing`` packets are
    missing by their numbers), "dropped" (the host's queue left out ``missing``), "unplugged",
    "reconnected", "restarted" (the board restarted), "skipped" (``missing`` lines of another
    instrument were not frames; without a text the event is only counted), "rows" (a tare leaves
    ``missing`` rows out).
    """

    kind: str
    missing: int = 0
    text: str = ""


class Transport(ABC):
    """A way to a board. A kind of device is a subclass; it overrides what it can do.

    Attributes:
        url: what it was opened by, such as "serial:/dev/ttyACM0".
        name: one word or two for messages, such as "/dev/ttyACM0".
        ended: a scene or a recording is over: no frame will come again. Commands are still
            answered, except by recordings. Never true of a real board.
    """

    url: str = ""
    name: str = ""
    ended: bool = False

    @property
    def capabilities(self) -> Capabilities:
        """The capabilities of this kind of device: by default a line without its own clock."""
        return Capabilities()

    @abstractmethod
    def read(self, timeout_s: float) -> bytes:
        """Bytes as soon as there are some; empty if none came within ``timeout_s``.

        Raises:
            DeviceError: the port is gone.
        """

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Send ``data``.

        Raises:
            DeviceError: the port is gone, or takes nothing.
        """

    def reopen(self) -> bool:
        """Try once to open the same board again after ``read`` or ``write`` failed; False if it is
        not there (yet)."""
        return False

    def take_events(self) -> list[LinkEvent]:
        """Return the events of the line since the last call."""
        return []

    @property
    def board_s(self) -> float | None:
        """The board's time, where it passes only while it is read and the board notices a host that
        falls silent; None: the host's time counts."""
        return None

    @property
    def known_hashes(self) -> BoardHashes | None:
        """The hashes of model and program that a recording keeps; None: ask the board."""
        return None

    def connect(self, fixture: str) -> bool:
        """Put a fixture of the bring-up ("nothing", "chain", "ring", "skin") on the electrodes;
        False: somebody has to."""
        return False

    def begin_scene(self) -> int | None:
        """Begin the touches of the scene: until then a simulated skin is untouched. Returns the
        board's clock at the scene's time 0, in us. None: that time is when the next scan begins, or
        the skin is real."""
        return None

    def press(self, places_mm: Sequence[tuple[float, float]]) -> None:
        """Put fingers on a simulated skin at ``places_mm``, beside the touches of its scene, from
        the next scan on and until the next call; none lifts them. A finger that is not on the skin
        touches nothing. May be called from any thread.

        Raises:
            DeviceError: the skin cannot be pressed by a program.
        """
        raise DeviceError(
            f"{self.name or self.url}: only the skin of  sim:  can be pressed by a program"
        )

    def watch(self, progress: Callable[[float], None] | None) -> None:  # noqa: B027 -- none is slow
        """Call ``progress`` with the board's time about once per second while a slow board is
        read; None: no longer."""

    @abstractmethod
    def close(self) -> None:
        """Close the port; may be called twice."""
