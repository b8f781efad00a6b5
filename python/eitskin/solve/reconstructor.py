"""Reconstruct images and touches from frames with one interface for all engines: the C core or the
numpy oracle."""

import threading
from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin.config import nearest
from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import CoreEngine
from eitskin.core.fast import FastCore
from eitskin.core.results import (
    LearnedReference,
    Options,
    Reconstruction,
    check_options,
    check_shape,
    frame_numbers,
)
from eitskin.errors import FrameError, ProtocolError, UsageError
from eitskin.model.eitm import decode_model, encode_model, load_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.oracle.engine import OracleEngine
from eitskin.skin.protocol import Protocol, pattern_name
from eitskin.threads import OneReader, OneThreadAtATime

ENGINES = ("c", "c64", "numpy")
MIN_CORRELATION = 0.9
OTHERS = "use a Reconstructor per stream, or let that one end"


class Reconstructor:
    """The reconstruction of one skin: tare on untouched frames, then reconstruct images and touches
    from frames.

    ``engine`` is "c" (the float32 core, as on the board), "c64" (the same source in float64) or
    "numpy" (the oracle: what an image is by definition, each frame by itself, slow; its touches are
    fitted in its own way and have no confidence). Problems of a frame are detected, affected rows
    are left out if that helps, and ``info.found`` names them (docs/reference/diagnostics.md); the
    option ``diagnostics`` chooses what is checked.

    Threads may share one: each call is carried out as a whole, and touches are followed in the
    order of the calls. Streams that should not share touches need a reconstructor each, so a second
    thread cannot begin a stream beside another's. Pickled or copied, it keeps model, options,
    masked rows and reference as they were given; tracked touches, and what the reference has
    learned since the tare, stay behind.

    Raises:
        ModelError: the C core rejects the model.
        UsageError: the engine is unknown, an option is out of range, or the core is not built.
    """

    def __init__(
        self,
        model: Model,
        *,
        engine: str = "c",
        options: Options | None = None,
        blob: bytes | None = None,
    ) -> None:
        if not isinstance(model, Model):
            raise UsageError(
                f"Reconstructor({model!r}): not a model; write  Reconstructor("
                "eitskin.load_model(PATH)) , or without PATH for the prebuilt one"
            )
        if engine not in ENGINES:
            raise UsageError(f"engine {engine!r} is not known; use one of {', '.join(ENGINES)}")
        self.model, self.engine = model, engine
        self._engine: CoreEngine | OracleEngine
        if engine == "numpy":
            self._engine = OracleEngine(model)
        else:
            self._engine = CoreEngine(
                blob or encode_model(model), "float32" if engine == "c" else "float64"
            )
        self.lock: threading.RLock = self._engine.lock
        self._blob, self._masked = blob, np.zeros(model.protocol.n_rows, dtype=bool)
        self._untouched: FloatArray | None = None
        engine_of_c = self.c_engine
        self._tracker = None if engine_of_c is None else FastCore(engine_of_c)
        self._begun = False  # drives are followed
        self._found: Sequence[Touch] | None = None  # the tracker gets them at the next frame
        self._streams = OneReader("the touches of this Reconstructor's stream", OTHERS)
        self._options = default_options(model)
        self.set_options(options or self._options)

    @classmethod
    def from_file(cls, path: str | Path, *, engine: str = "c") -> "Reconstructor":
        """Return a reconstructor with the model in the file ``path``; also raises the errors of
        ``load_model``."""
        model, blob = load_model(path)
        return cls(model, engine=engine, blob=blob)

    def __reduce__(self) -> tuple[Any, ...]:
        with self.lock:
            blob = self._blob or encode_model(self.model)
            return _again, (blob, self.engine, self._options, self._masked, self._untouched)

    @property
    def c_engine(self) -> CoreEngine | None:
        """The context of the C core, for other code that works on it; None for other engines."""
        return self._engine if isinstance(self._engine, CoreEngine) else None

    @property
    def options(self) -> Options:
        """The current options."""
        return self._options

    def set_options(self, options: Options | None = None, /, **changes: Any) -> None:
        """Use ``options`` (None: the current ones) with ``changes`` to them by name from now on.

        Raises:
            UsageError: an option is unknown or out of range; the old options stay.
        """
        known = [entry.name for entry in fields(Options)]
        for name in changes:
            if name not in known:
                raise UsageError(f"options: {name!r} is unknown; {nearest(name, known)}")
        with self.lock:
            wanted = replace(self._options if options is None else options, **changes)
            check_options(wanted)
            self._engine.set_options(wanted)
            self._options = wanted

    def check_protocol(self, protocol: Protocol) -> None:
        """Check that ``protocol`` is the model's.

        Raises:
            ProtocolError: the tables differ.
        """
        if protocol.hash != self.model.protocol.hash:
            own = self.model.protocol
            raise ProtocolError(
                f"frames scanned with {pattern_name(protocol)} (protocol {protocol.hash:016x},"
                f" {protocol.n_electrodes} electrodes, {protocol.n_rows} rows) do not match the"
                f" model's {pattern_name(own)} ({own.hash:016x}, {own.n_electrodes} electrodes,"
                f" {own.n_rows} rows); import the frames in the model's order, or build a model"
                " of their rows:  eitskin model build SKIN.toml --rows-of FRAMES.npz -o MODEL.eitm"
            )

    def tare(self, untouched_v: npt.ArrayLike) -> LearnedReference:
        """Take the reference from untouched frames (k, m) or one (m,), in V. Four or more also give
        the noise, and single readings that contradict the others are left out (``outliers``).

        Raises:
            FrameError: a frame has the wrong length or cannot be used.
        """
        frames = np.atleast_2d(frame_numbers(untouched_v, "reference"))
        check_shape(frames, self.model.protocol.n_rows, "reference", least=1)
        with self.lock:
            learned = self._engine.set_reference(frames)
            self._untouched = frames.copy()
            self._forget_touches()
        return learned

    def mask_rows(self, rows: BoolArray) -> None:
        """Leave the rows of the protocol where ``rows`` (m,) is true out of every frame; call this
        before ``tare``.

        Raises:
            UsageError: ``rows`` is not one truth value per row.
        """
        given, count = np.asarray(rows), self.model.protocol.n_rows
        if given.shape != (count,) or given.dtype != np.bool_:
            raise UsageError(
                f"mask: is {given.dtype} {given.shape}, but must be one truth value for each of"
                f" {count} rows"
            )
        with self.lock:
            self._engine.mask_rows(given)
            self._masked = given.copy()

    def reconstruct(self, frame_v: npt.ArrayLike, *, touches: bool = True) -> Reconstruction:
        """Reconstruct one frame (m,) in V by itself: ids number its touches.

        Raises:
            FrameError: the frame cannot be used, or no reference has been taken.
        """
        result = self._engine.reconstruct(frame_numbers(frame_v, "frame"), touches=touches)
        return replace(result, model=self.model)

    def follow(
        self, frame_v: npt.ArrayLike, row_time_s: npt.ArrayLike | None = None
    ) -> Reconstruction:
        """Reconstruct the next frame (m,) of a stream: a touch keeps its id from frame to frame, is
        ``confirmed`` by its second frame, and reported only then if it is doubtful
        (docs/guide/tracking.md). The numpy engine follows nothing.

        With ``row_time_s`` (m,), when each row was measured by a clock that goes on from frame to
        frame, touches are followed through the scan, and the frame is reconstructed as of its last
        drive. This needs a model with fields, and noise from a tare of four frames; without these
        the times are not used. A frame with drives that nothing explains has the touches of the
        tracker, the solver's image of its rows as they are, and no diagnostics.

        Raises:
            FrameError: the frame or the times cannot be used, or no reference has been taken.
        """
        with self.lock:
            if row_time_s is not None and self._follows_drives():
                frame, times = frame_numbers(frame_v, "frame"), frame_numbers(row_time_s, "times")
                check_shape(np.array([frame, times]), self.model.protocol.n_rows, "frame, times")
                return self._follow_drives(frame, times)
            result = self.reconstruct(frame_v)
            return result if self._tracker is None else self._tracker.followed(result)

    def _follows_drives(self) -> bool:
        """Return whether drives are followed; the tracker begins at the first."""
        if self._tracker is None or not self._tracker.rows:
            return False
        if not self._begun:
            try:
                self._tracker.begin()
            except FrameError:  # the noise is not known
                return False
        self._begun = True
        return True

    def _follow_drives(self, frame_v: FloatArray, time_s: FloatArray) -> Reconstruction:
        tracker = self._tracker
        assert tracker is not None
        middles = [(float(time_s[rows].mean()), k) for k, rows in enumerate(tracker.rows)]
        for middle_s, number in sorted(middles):
            tracker.drive(number, frame_v[tracker.rows[number]], middle_s)
        if self._found is not None:
            tracker.confirm(self._found)
        self._found = None
        aligned = tracker.aligned(frame_v)
        if not aligned.trusted:
            result = self.reconstruct(frame_v, touches=False)
            touches = tracker.report(None)
            info = replace(
                result.info, touches=len(touches), diagnostics=0, open_electrodes=(),
                bridged_electrodes=(), noisy_electrodes=(),
            )  # fmt: skip
            return replace(result, touches=touches, info=info)
        try:
            result = self.reconstruct(aligned.volts)
        except FrameError:
            tracker.report(None)
            raise
        self._found = result.touches
        reported = tracker.followed(result)
        return replace(reported, info=tracker.named(reported.info))

    def _forget_touches(self) -> None:
        self._begun, self._found = False, None
        if self._tracker is not None:
            self._tracker.forget()

    def stream(self, frames_v: Iterable[npt.ArrayLike]) -> Iterator[Reconstruction]:
        """Reconstruct frames one after another as :meth:`follow` does.

        Raises:
            FrameError: a frame cannot be used, or no reference has been taken.
            UsageError: another thread streams.
        """
        return OneThreadAtATime(self._streamed(frames_v), "this stream", OTHERS)

    def _streamed(self, frames_v: Iterable[npt.ArrayLike]) -> Generator[Reconstruction, None, None]:
        mine = object()
        self._streams.begin(mine)
        try:
            for frame in frames_v:
                yield self.follow(frame)
        finally:
            self._streams.end(mine)

    def forget(self) -> None:
        """Forget the coefficients for the warm start and the followed touches, so that the next
        frame does not depend on earlier ones."""
        self._engine.forget()
        self._forget_touches()


def _again(
    blob: bytes, engine: str, options: Options, masked: BoolArray, untouched: FloatArray | None
) -> Reconstructor:
    """The reconstructor that was pickled."""
    made = Reconstructor(
        decode_model(blob, "a pickled Reconstructor"), engine=engine, options=options, blob=blob
    )
    if masked.any():
        made.mask_rows(masked)
    if untouched is not None:
        made.tare(untouched)
    return made
