"""The functions that ``import eitskin`` gives: they stream a skin's frames and load models."""

import inspect
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.config import nearest
from eitskin.core.options_table import CHOICES
from eitskin.device.settings import SolverSettings
from eitskin.errors import UsageError
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_or_prebuilt
from eitskin.session.frame import Frame, Notice
from eitskin.session.robot_session import AnySession, open_session
from eitskin.session.settings import SessionSettings, kinds_of
from eitskin.session.zones import load_zones
from eitskin.sinks.outputs import attached_outputs
from eitskin.threads import OneThreadAtATime
from eitskin.truth import observe_scene
from eitskin.tuning.for_model import operating_point_for
from eitskin.tuning.front import Preset, named_preset

PRESET_CHOOSES = {"solver", "iterations", "gap_rel", "mac_limit"}


def load_model(path: str | Path | None = None) -> Model:
    """The model in the file ``path``, or without one the prebuilt model of the paper's skin.

    Raises:
        FileError: it cannot be read.
        ModelError: it is truncated, corrupted, newer or foreign.
    """
    return load_or_prebuilt(None if path is None else Path(path))[0]


def preset(name: str, model: Model | None = None, *, snr_db: float | None = None) -> dict[str, Any]:
    """The options of a ``Reconstructor`` by name: "fast", "balanced" or "accurate", of what was
    measured on a host with ``model`` (None: the prebuilt one). ``snr_db`` is the SNR that a tare
    measured (``LearnedReference.snr_db``); without it, "balanced" and "accurate" take settings that
    are at least as accurate as the defaults at 40, 60 and 80 dB.

    Raises:
        UsageError: there is none of that name, or no measured point of such a model.
    """
    used = load_model() if model is None else model
    point = operating_point_for(
        named_preset(name, "host", snr_db=snr_db), used, default_options(used)
    )
    return point.configuration.solver_settings


def stream(
    url: str | Path = "auto",
    *,
    mode: str = "touches",
    model: str | Path | None = None,
    frames: int = 0,
    every: int = 0,
    tare: int | None = None,
    preset: str | None = None,
    to: str | Sequence[str] = (),
    record: str | Path | None = None,
    zones: str | Path | None = None,
    speed: float = 0.0,
    name: str | None = None,
    **solver: Any,
) -> Iterator[Frame]:
    """Yield a skin's frames with their touches as they arrive. The board is set up first, its
    reference is taken if necessary, and it is released when the loop ends.

    Args:
        url: as ``eitskin stream --device``: "auto", "serial:PORT", "sim:SCENE", "emu:SCENE",
            "file:RUN.eits", "robot:FILE" for all skins of a robot.
        mode: "touches", "image", "raw", "events", or several: "touches,image".
        model: a file, where the board's model is not the prebuilt one.
        frames: stop after so many of each skin; 0: go on until the scene or the recording ends.
        every: every n-th frame; 0: as many as the line carries.
        tare: take the reference from so many frames of the untouched skin.
        preset: "fast", "balanced" or "accurate": scan and solver by name, as ``--preset``.
        to: a sink, such as "udp://127.0.0.1:9000" (docs/guide/touches-out.md), or several.
        record: a new recording of every packet; of a robot a folder with one per skin. An existing
            file is written over.
        zones: a file of named places, whose presses are reported (docs/guide/gestures.md).
        speed: of what is simulated, emulated or recorded; 1 is as it was, 0 as fast as it can.
        name: of the board, skin or source in every message (None: the URL's, else the
            one in the board's settings, else its serial number).
        solver: ``sign``, ``iterations`` and what else SolverSettings has.

    Raises:
        EitskinError: the board cannot be opened or set up, its stream fails, or a sink cannot be
            opened.
    """
    if not isinstance(mode, str):
        raise UsageError(f'stream(mode={mode!r}): must be a text, such as "raw,touches"')
    _check_paths(url=url, model=model, record=record, zones=zones)
    _check_numbers(whole=True, frames=frames, every=every)
    _check_numbers(whole=False, speed=speed)
    to = [to] if isinstance(to, str) else to
    frames_of = _stream(
        str(url), mode, model, frames, every, tare, preset, to, record, zones, speed, name,
        solver,
    )  # fmt: skip
    return OneThreadAtATime(frames_of, f"the stream of {url}", "a board has one reader at a time")


def _check_paths(url: object, **optional: object) -> None:
    """Raise a UsageError unless ``url`` is a text or a path, and the others are, too, or None."""
    for name, value in {"url": url, **optional}.items():
        if not isinstance(value, str | Path) and (name == "url" or value is not None):
            raise UsageError(f"stream({name}={value!r}): must be a text or the path of a file")


def _check_numbers(*, whole: bool, **named: object) -> None:
    """Raise a UsageError unless all are numbers from 0 on, and ``whole`` ones where asked for."""
    kinds = (int, np.integer) if whole else (int, float, np.integer, np.floating)
    for name, value in named.items():
        if not isinstance(value, kinds) or not value >= 0:
            raise UsageError(
                f"stream({name}={value!r}): must be a {'whole ' * whole}number, 0 or more"
            )


def _stream(
    url: str,
    mode: str,
    model: str | Path | None,
    frames: int,
    every: int,
    tare: int | None,
    preset: str | None,
    to: Sequence[str],
    record: str | Path | None,
    zones: str | Path | None,
    speed: float,
    name: str | None,
    solver: dict[str, Any],
) -> Generator[Frame, None, None]:
    settings = SessionSettings(
        mode=kinds_of(mode, "mode"),
        every=every,
        frames=frames,
        model=None if model is None else Path(model),
        model_for="an image" if "image" in mode else "",
        solver=_solver(solver),
        preset=None if preset is None else _preset(preset, solver),
        tare=tare,
        record=None if record is None else Path(record),
        zones=() if zones is None else load_zones(zones),
        name=name,
    )
    with (
        open_session(url, settings, speed=speed, observe=observe_scene) as session,
        attached_outputs(session, to) as outputs,
    ):
        yield from _frames(session)
        session.finish()
        outputs.end(session.facts())


def _frames(session: AnySession) -> Iterator[Frame]:
    """Frames, each with the notices since the one before."""
    notices: list[Notice] = []
    messages = session.messages()
    try:
        for message in messages:
            if isinstance(message, Notice):
                notices.append(message)
            if isinstance(message, Frame):
                yield replace(message, notices=tuple(notices))
                notices.clear()
    finally:
        messages.close()


def _preset(name: str, solver: dict[str, Any]) -> Preset:
    for other in PRESET_CHOOSES & solver.keys():
        raise UsageError(
            f"stream(preset={name!r}, {other}=...): the preset chooses {other}; leave one out"
        )
    return named_preset(name, "f767")


def _solver(named: dict[str, Any]) -> SolverSettings:
    try:
        settings = SolverSettings(**named)
    except TypeError:
        solver = SolverSettings.__dataclass_fields__
        unknown = next(name for name in named if name not in solver)
        own = (name for name in inspect.signature(stream).parameters if name != "solver")
        raise UsageError(
            f"stream({unknown}=...): there is no such argument; {nearest(unknown, (*own, *solver))}"
        ) from None
    if settings.sign is not None and settings.sign not in CHOICES["sign"]:
        raise UsageError(
            f"stream(sign={settings.sign!r}): {nearest(settings.sign, CHOICES['sign'])}"
        )
    return settings
