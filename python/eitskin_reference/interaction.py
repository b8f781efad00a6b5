"""The numpy reference of csrc/src/touch/interaction.c: what touches do to each other's field, as
data on the folded rows."""

from collections.abc import Sequence

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.model.model import Model
from eitskin_reference.constants_table import NO_DIPOLE_MM2
from eitskin_reference.disc_fit import Disc


def interplay(model: Model, discs: Sequence[Disc]) -> FloatArray:
    """What the interplay of ``discs`` adds to the folded data (k,), in the model's volts; see
    csrc/src/touch/interaction.h.

    The model must have fields.
    """
    assert model.fields is not None
    electrodes, fields = model.protocol.n_electrodes, model.fields
    seen = np.array([_over_disc(model, disc) for disc in discs])
    field = seen[:, :electrodes] + 1j * seen[:, electrodes : 2 * electrodes]
    mirror_a, mirror_b = (seen[:, -4 + 2 * k] + 1j * seen[:, -3 + 2 * k] for k in (0, 1))
    moment = np.array([_moment(model, disc) for disc in discs])
    rows = model.protocol.drive_measure.astype(np.int64)[model.fold.first]
    added = np.zeros(len(rows))
    for i, here in enumerate(discs):
        bent = np.zeros(electrodes, dtype=np.complex128)
        for j, other in enumerate(discs):
            if j == i:
                continue
            apart = complex(here.x_mm - other.x_mm, here.y_mm - other.y_mm)
            share = min(1.0, abs(apart) / (here.radius_mm + other.radius_mm))
            direct = share**2 * _inverse_square(apart)
            mirrored = _inverse_square(mirror_a[j] - mirror_b[j] * complex(here.x_mm, here.y_mm))
            bent += np.conj(
                moment[j] * fields.per_sheet * (direct * field[j] - mirrored * np.conj(field[j]))
            )
        drive, measure = (
            bent[rows[:, 0]] - bent[rows[:, 1]],
            field[i][rows[:, 2]] - field[i][rows[:, 3]],
        )
        added -= fields.volts * moment[i] * (drive * np.conj(measure)).real
    return added


def turned_dipoles(model: Model, disc: Disc) -> FloatArray:
    """What ``disc`` adds to the folded data as a dipole that turns (2, k), in the model's volts: Re
    and Im of E_drive E_measure, as an ellipse adds to its disc's Re E_drive conj(E_measure)."""
    assert model.fields is not None
    electrodes, seen = model.protocol.n_electrodes, _over_disc(model, disc)
    field = seen[:electrodes] + 1j * seen[electrodes : 2 * electrodes]
    rows = model.protocol.drive_measure.astype(np.int64)[model.fold.first]
    turned = (field[rows[:, 0]] - field[rows[:, 1]]) * (field[rows[:, 2]] - field[rows[:, 3]])
    answer = -model.fields.volts * _moment(model, disc) * turned
    return np.array([answer.real, answer.imag])


def _moment(model: Model, disc: Disc) -> float:
    """S/m mm^2: what ``disc`` adds to a dipole's strength."""
    return float(disc.change * np.pi * (disc.radius_mm**2 + model.grid.pixel_mm**2 / 12))


def _over_disc(model: Model, disc: Disc) -> FloatArray:
    """The fields' columns averaged over the disc's covers."""
    assert model.fields is not None
    offset = model.grid.centres_mm() - (disc.x_mm, disc.y_mm)
    cover = np.clip(
        0.5 + (disc.radius_mm - np.hypot(offset[:, 0], offset[:, 1])) / model.grid.pixel_mm,
        0.0,
        1.0,
    )
    cover = np.where(model.column_weight != 0, cover, 0.0)
    whole = cover.sum()
    return np.asarray(
        cover @ model.fields.columns.astype(np.float64) / (whole if whole > 0 else 1.0)
    )


def _inverse_square(a: complex) -> complex:
    return 1 / a**2 if abs(a) ** 2 > NO_DIPOLE_MM2 else 0j
