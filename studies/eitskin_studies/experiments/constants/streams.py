"""Streams of frames with fingers that land, press, move and lift, and their truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import GeometryError
from eitskin.scene.description import Scene
from eitskin.scene.laws import ShortCircuit
from eitskin.scene.random_touches import rim_distance_mm
from eitskin.scene.simulate import Measurement
from eitskin.scene.streams import stream
from eitskin.scene.touch_path import Keyframe, TouchTrack, TrackSamples, sample
from eitskin.skin.outline import Outline

RATE_HZ = 48.0  # of a board that scans both rows of each pair (docs/guide/board.md)
FRAMES = 72
ELEMENTS = 11_000
LIGHT = 0.3  # of full contact, as a finger lands and lifts
LANDING_S = 2.5 / RATE_HZ  # from there to full contact
GAP_MM, RIM_MM = 12.0, 4.0  # as random_touches
CONTACTS = {"mean_ohm_m2": 0.01, "spread": Measurement.contact_spread}
SHORTEST_S = 0.4
TRIES = 2_000


@dataclass(frozen=True, eq=False)
class TouchStream:
    """Fingers that all move at ``speed_mm_s``, by the names ``tracks`` (their order) and at the
    frames' times."""

    name: str
    speed_mm_s: float
    tracks: tuple[TouchTrack, ...]

    @cached_property
    def samples(self) -> tuple[TrackSamples, ...]:
        """Each finger at the frames' times."""
        return tuple(sample(track, np.arange(FRAMES) / RATE_HZ) for track in self.tracks)

    def true_mm(self, frame: int) -> tuple[tuple[int, ...], FloatArray, FloatArray]:
        """Return the fingers that are there in a frame, their places (k, 2) and radii (k,)."""
        there = tuple(i for i, one in enumerate(self.samples) if one.there[frame])
        places = np.array(
            [(self.samples[i].x_mm[frame], self.samples[i].y_mm[frame]) for i in there]
        ).reshape(-1, 2)
        return there, places, np.array([self.samples[i].radius_mm[frame] for i in there])

    def facts(self) -> list[object]:
        """All that tells it from another, for JSON."""
        return [self.name, FRAMES, RATE_HZ,
            [[list(vars(key).values()) for key in track.keyframes] for track in self.tracks],
                [vars(track.law) for track in self.tracks], CONTACTS]  # fmt: skip

    def scene(self, elements: int = ELEMENTS) -> Scene:
        """For the forward model: without noise, one untouched frame; contacts that differ, as in
        every other set."""
        return Scene(
            self.name, touches=self.tracks, frames=FRAMES, rate_hz=RATE_HZ, quiet_frames=1,
            elements=elements, solver="update", frozen=True,
            effects={"contact_impedance": CONTACTS},
        )  # fmt: skip


def random_streams(
    outline: Outline, seed: int, role: str, speed_mm_s: float, count: int
) -> tuple[TouchStream, ...]:
    """``count`` streams of one to four fingers that come and go at random times; they move along
    straight lines between random places, or stay. No two are nearer than 12 mm, edge to edge, at
    any time.

    Raises:
        GeometryError: they do not fit on this skin.
    """
    names = [f"{role}-{speed_mm_s:g}-{k}" for k in range(count)]
    return tuple(
        _random(outline, names[k], speed_mm_s, stream(seed, f"stream {role} {speed_mm_s:g}", k))
        for k in range(count)
    )


def passing_streams(seed: int, speed_mm_s: float, count: int) -> tuple[TouchStream, ...]:
    """Two fingers each that pass one another in opposite directions, 5 mm apart, edge to edge."""
    made = []
    for k in range(count):
        generator = stream(seed, f"passing {speed_mm_s:g}", k)
        radii, contrasts = generator.uniform(6.0, 9.0, 2), generator.uniform(3.0, 10.0, 2)
        angle, middle_s = generator.uniform(0, 2 * np.pi), FRAMES / RATE_HZ / 2
        aside = (radii.sum() + 5.0) / 2
        times = np.array([0.0, FRAMES / RATE_HZ])
        tracks = []
        for direction, radius, contrast in zip((1, -1), radii, contrasts, strict=True):
            reach = min(speed_mm_s * middle_s, 60.0)
            along = np.array([-reach, reach]) * direction
            middle = np.array([middle_s - reach / speed_mm_s, middle_s + reach / speed_mm_s])
            x = along * np.cos(angle) - direction * aside * np.sin(angle)
            y = along * np.sin(angle) + direction * aside * np.cos(angle)
            keys = [
                (times[0], x[0], y[0]),
                (middle[0], x[0], y[0]),
                (middle[1], x[1], y[1]),
                (times[1], x[1], y[1]),
            ]
            tracks.append(
                _track(
                    [(float(t), float(u), float(v)) for t, u, v in keys],
                    float(radius),
                    float(contrast),
                )
            )
        made.append(TouchStream(f"passing-{speed_mm_s:g}-{k}", speed_mm_s, tuple(tracks)))
    return tuple(made)


def _random(
    outline: Outline, name: str, speed_mm_s: float, generator: np.random.Generator
) -> TouchStream:
    for _ in range(TRIES):
        tracks: list[TouchTrack] = []
        samples: list[TrackSamples] = []
        for _ in range(int(generator.integers(1, 4, endpoint=True))):
            track = _finger(outline, speed_mm_s, generator)
            here = sample(track, np.arange(FRAMES) / RATE_HZ)
            if all(_apart(here, other) for other in samples):
                tracks.append(track)
                samples.append(here)
        if tracks:
            return TouchStream(name, speed_mm_s, tuple(tracks))
    raise GeometryError(f"{name}: no finger fits on this skin; take a larger one")


def _apart(one: TrackSamples, other: TrackSamples) -> bool:
    both = one.there & other.there
    distance = (
        np.hypot(one.x_mm - other.x_mm, one.y_mm - other.y_mm) - one.radius_mm - other.radius_mm
    )
    return bool((distance[both] >= GAP_MM).all())


def _finger(outline: Outline, speed_mm_s: float, generator: np.random.Generator) -> TouchTrack:
    """From place to place at one speed while it is there; at once where one is reached, to the
    next."""
    radius, contrast = float(generator.uniform(6.0, 12.0)), float(generator.uniform(3.0, 10.0))
    span_s = FRAMES / RATE_HZ
    start = float(generator.uniform(0.05, span_s - SHORTEST_S - 0.1))
    end = float(generator.uniform(start + SHORTEST_S, span_s - 0.05))
    x, y = _place(outline, radius, generator)
    keys = [(start, x, y)]
    while speed_mm_s > 0 and keys[-1][0] < end:
        u, v = _place(outline, radius, generator)
        keys.append((keys[-1][0] + float(np.hypot(u - x, v - y)) / speed_mm_s, u, v))
        x, y = u, v
    if speed_mm_s == 0:
        keys.append((end, x, y))
    at = np.array(keys)
    last = (
        end,
        float(np.interp(end, at[:, 0], at[:, 1])),
        float(np.interp(end, at[:, 0], at[:, 2])),
    )
    return _track([*[key for key in keys if key[0] < end], last], radius, contrast)


def _place(
    outline: Outline, radius_mm: float, generator: np.random.Generator
) -> tuple[float, float]:
    x0, y0, x1, y1 = outline.bounding_box_mm
    while True:
        x, y = float(generator.uniform(x0, x1)), float(generator.uniform(y0, y1))
        if rim_distance_mm(outline, (x, y))[0] >= radius_mm + RIM_MM:
            return x, y


def _track(
    keys: Sequence[tuple[float, float, float]], radius_mm: float, contrast: float
) -> TouchTrack:
    """With its landing and lifting: lightly at the ends, fully between."""
    at = np.array(keys)
    start, end = keys[0][0], keys[-1][0]
    times = sorted({*at[:, 0].tolist(), start + LANDING_S, end - LANDING_S})
    press = [
        LIGHT + (1 - LIGHT) * min(1.0, (t - start) / LANDING_S, (end - t) / LANDING_S)
        for t in times
    ]
    return TouchTrack(
        tuple(
            Keyframe(
                t,
                float(np.interp(t, at[:, 0], at[:, 1])),
                float(np.interp(t, at[:, 0], at[:, 2])),
                radius_mm,
                p,
            )
            for t, p in zip(times, press, strict=True)
        ),
        ShortCircuit(contrast),
    )
