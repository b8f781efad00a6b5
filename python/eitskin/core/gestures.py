"""Gesture events from touches over time, by the C core, as a board also makes them.
docs/guide/gestures.md describes each event."""

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import load_core
from eitskin.core.gestures_table import EventKind, EventPhase
from eitskin.errors import UsageError
from eitskin.threads import one_at_a_time, refuse_copy

# kinds of events that have a direction, and those that have a value
_DIRECTED = frozenset({EventKind.SWIPE})
_VALUED = frozenset(
    {EventKind.HOLD, EventKind.SWIPE, EventKind.PINCH, EventKind.SPREAD, EventKind.ROTATE}
)
_UNITS = {EventKind.HOLD: " s", EventKind.SWIPE: " mm", EventKind.ROTATE: " deg"}
_SIDES = ("right", "up", "left", "down")


@dataclass(frozen=True)
class GestureEvent:
    """One event, as in eits_event; fields that do not apply to its kind are 0. ``zone`` counts from
    1, and ``zone_name`` is the name of the zone."""

    kind: EventKind
    phase: EventPhase
    first_id: int
    second_id: int
    zone: int
    time_us: int
    x_mm: float
    y_mm: float
    direction_deg: float
    value: float
    zone_name: str | None = None

    @property
    def name(self) -> str:
        """The kind as a text such as "double-tap"."""
        return self.kind.name.lower().replace("_", "-")

    @property
    def touch_ids(self) -> tuple[int, ...]:
        """The ids of the one or two touches."""
        return (self.first_id, self.second_id) if self.second_id else (self.first_id,)

    @property
    def is_gesture(self) -> bool:
        """Return whether the event is more than a change of a finger's place, and so deserves a
        line of output."""
        return self.kind > EventKind.UP and self.phase != EventPhase.CHANGE

    @property
    def side(self) -> str | None:
        """The direction of a swipe (right, up, left or down); None for other kinds."""
        if self.kind != EventKind.SWIPE:
            return None
        return _SIDES[int(((self.direction_deg + 45) % 360) // 90)]

    def as_dict(self) -> dict[str, Any]:
        """Return the event for JSON; values that do not apply to its kind are None."""
        ring = self.kind == EventKind.PRESS and self.zone_name is not None
        return {
            "kind": self.name,
            "phase": self.phase.name.lower(),
            "touch_ids": list(self.touch_ids),
            "x_mm": self.x_mm,
            "y_mm": self.y_mm,
            "direction_deg": self.direction_deg if self.kind in _DIRECTED else None,
            "value": self.value if self.kind in _VALUED or ring else None,
            "zone": self.zone_name,
        }

    def text(self) -> str:
        """Return the event as a line of text."""
        words = [self.name]
        if self.phase != EventPhase.ONCE and self.kind != EventKind.PRESS:
            words.append(
                "begins" if self.phase == EventPhase.BEGIN else self.phase.name.lower() + "s"
            )
        if self.zone_name is not None:
            words.append(self.zone_name)
        if self.side is not None:
            words.append(f"{self.side} ({self.direction_deg:.0f} deg)")
        if self.kind in _VALUED:
            words.append(f"{self.value:.2f}{_UNITS.get(self.kind, ' times')}")
        words.append(f"at ({self.x_mm:.1f}, {self.y_mm:.1f}) mm")
        return " ".join(words)


@dataclass(frozen=True)
class Zone:
    """A named zone: a polygon with ``corners_mm``, or a disc (``inner_mm`` is 0) or ring around
    (``x_mm``, ``y_mm``)."""

    name: str
    corners_mm: tuple[tuple[float, float], ...] = ()
    x_mm: float = 0.0
    y_mm: float = 0.0
    inner_mm: float = 0.0
    outer_mm: float = 0.0


class Gestures:
    """Makes events from the tracked touches of each frame, including those of ``zones``.
    ``options`` replace defaults of eits_gesture_options by name. Threads may share one: each frame
    is taken as a whole, in the order of the calls.

    Raises:
    UsageError: an option or a zone is not valid.
    """

    def __init__(self, zones: Sequence[Zone] = (), **options: float) -> None:
        module = load_core("float32")
        self.lock = threading.RLock()
        self._lib, self._ffi = module.lib, module.ffi
        self._options = self._ffi.new("eits_gesture_options *")
        self._lib.eits_gestures_default(self._options)
        for name, value in options.items():
            try:
                setattr(self._options, name, value)
            except (AttributeError, TypeError, OverflowError) as error:
                raise UsageError(f"gestures: option {name} = {value!r}: {error}") from None
        self._state = self._ffi.new("eits_gestures *")
        self._room = int(self._lib.EITS_MAX_EVENTS)
        self._events = self._ffi.new("eits_event[]", self._room)
        self._touches = self._ffi.new("eits_touch[]", int(self._lib.EITS_MAX_TOUCHES))
        self._count = self._ffi.new("uint32_t *")
        self._zones = _ZoneState(zones, self._lib, self._ffi) if zones else None
        self.reset()

    def __reduce__(self) -> NoReturn:
        refuse_copy(
            "gestures, which remember the fingers that are down,",
            "make others of the same zones and options",
        )

    @one_at_a_time
    def reset(self) -> None:
        """Start again: no finger is down, no zone is pressed, and no event reports that anything
        ended."""
        if self._lib.eits_gestures_init(self._state, self._options):
            raise UsageError("gestures: every length and fraction must be a number, at least 0")
        if self._zones is not None:
            self._zones.reset()

    @property
    def dropped(self) -> int:
        """The number of events and touches that did not fit into their buffers."""
        return int(self._state.dropped)

    @one_at_a_time
    def update(self, touches: Iterable[Touch], time_us: int) -> list[GestureEvent]:
        """Return the events of the frame at ``time_us`` (modulo 2^32), those of zones last."""
        count = 0
        for touch in touches:
            if count == len(self._touches):
                break
            to = self._touches[count]
            to.id, to.x_mm, to.y_mm = touch.id, touch.x_mm, touch.y_mm
            to.strength_s_per_m_mm2, to.explained = touch.strength_s_per_m_mm2, touch.explained
            to.x_variance_mm2 = touch.x_variance_mm2 or 0.0
            to.y_variance_mm2 = touch.y_variance_mm2 or 0.0
            count += 1
        self._lib.eits_gestures_update(
            self._state,
            self._touches,
            count,
            time_us % 2**32,
            self._events,
            self._room,
            self._count,
        )
        made = int(self._count[0])
        events = [_event(self._events[k]) for k in range(made)]
        return events + ([] if self._zones is None else self._zones.update(self._events, made))

    @one_at_a_time
    def press_zones(self, events: Sequence[GestureEvent]) -> list[GestureEvent]:
        """Return the events of zones that ``events``, which come from a board, press and
        release."""
        if self._zones is None:
            return []
        given = [one for one in events if one.kind <= EventKind.UP]
        array = self._ffi.new("eits_event[]", max(len(given), 1))
        for to, one in zip(array, given, strict=False):
            for name in _NAMES:
                setattr(to, name, getattr(one, name))
        return self._zones.update(array, len(given))


class _ZoneState:
    """The zones of the core, with the memory that they point to."""

    def __init__(self, zones: Sequence[Zone], lib: Any, ffi: Any) -> None:
        self._given, self._lib, self._ffi = tuple(zones), lib, ffi
        if len(zones) > int(lib.EITS_MAX_ZONES):
            raise UsageError(f"zones: {len(zones)} are too many; at most {lib.EITS_MAX_ZONES}")
        self._state = ffi.new("eits_zones *")
        self._count = ffi.new("uint32_t *")
        self._room = int(lib.EITS_MAX_ZONE_EVENTS)
        self._out = ffi.new("eits_event[]", self._room)
        self._corners: list[Any] = []
        self._zones = ffi.new("eits_zone[]", len(zones))
        for to, zone in zip(self._zones, zones, strict=True):
            to.x_mm, to.y_mm = zone.x_mm, zone.y_mm
            to.inner_mm, to.outer_mm = zone.inner_mm, zone.outer_mm
            if zone.corners_mm:
                flat = [number for corner in zone.corners_mm for number in corner]
                self._corners.append(ffi.new("eits_real[]", flat))
                to.corners_mm, to.corners = self._corners[-1], len(zone.corners_mm)

    def reset(self) -> None:
        if self._lib.eits_zones_init(self._state, self._zones, len(self._given)):
            names = ", ".join(zone.name for zone in self._given)
            raise UsageError(
                f"zones: one of {names} is not valid: a polygon has 3 corners or more, a ring radii"
                " that ascend from 0, and every number is finite"
            )

    def update(self, events: Any, count: int) -> list[GestureEvent]:
        self._lib.eits_zones_update(self._state, events, count, self._out, self._room, self._count)
        return [
            _event(one, self._given[one.zone - 1].name)
            for one in (self._out[k] for k in range(self._count[0]))
        ]


_NAMES = (
    "kind", "phase", "first_id", "second_id", "zone", "time_us", "x_mm", "y_mm", "direction_deg",
    "value",
)  # fmt: skip


def _event(one: Any, zone_name: str | None = None) -> GestureEvent:
    kind, phase, *ids = (int(getattr(one, name)) for name in _NAMES[:6])
    x, y, direction, value = (float(getattr(one, name)) for name in _NAMES[6:])
    return GestureEvent(
        EventKind(kind), EventPhase(phase), ids[0], ids[1], ids[2], ids[3], x, y, direction, value,
        zone_name,
    )  # fmt: skip


def event_numbers(events: Iterable[GestureEvent]) -> FloatArray:
    """Return the numbers of the events (k, 10), to compare two lists bit by bit."""
    return np.array([[getattr(one, name) for name in _NAMES] for one in events]).reshape(-1, 10)
