"""How bytes reach a board and come back: what every kind of device gives, and nothing more."""

from typing import Protocol, runtime_checkable


@runtime_checkable
class Transport(Protocol):
    """A way to a board.

    Attributes:
        url: what it was opened by, such as "serial:/dev/ttyACM0".
        name: one word or two for messages, such as "/dev/ttyACM0".
        synchronous: the board only runs while ``read`` is called (simulated, emulated, recorded).
            It is then pumped by whoever asks, without a thread, and runs are reproducible; timeouts
            count in the board's own time.
        replays: it is a recording: nothing can be asked of it.
        ended: a scene or a recording is over: no frame will come again. Commands are still
            answered, but by recordings. Never true of a real board.
    """

    @property
    def url(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def synchronous(self) -> bool: ...
    @property
    def replays(self) -> bool: ...
    @property
    def ended(self) -> bool: ...

    def read(self, timeout_s: float) -> bytes:
        """Bytes as soon as there are some; empty if none came within ``timeout_s``.

        Raises:
            DeviceError: the port is gone.
        """

    def write(self, data: bytes) -> None:
        """Send ``data``.

        Raises:
            DeviceError: the port is gone, or takes nothing.
        """

    def reopen(self) -> bool:
        """Try once to open the same board again after ``read`` or ``write`` failed; False if it is
        not there (yet)."""

    def begin_scene(self) -> None:
        """Begin what is to be touched: until then a simulated or emulated skin is untouched.
        Nothing on a real board."""

    def close(self) -> None:
        """Let go of the port; may be called twice."""
