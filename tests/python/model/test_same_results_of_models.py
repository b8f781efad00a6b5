"""Numbers and words of the room that makes, writes and reads models, on fixed inputs."""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitm_bytes import entry_place, sealed, sections_of
from eitskin.model import force_law, model_errors, reduction, row_form, storage
from eitskin.model.build import BuildSettings, make_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.model.model import DATA_KINDS, Model
from eitskin.model.options import default_options, tracking
from eitskin.skin.uncertainty import DEFAULT_UNCERTAINTY
from same_results import check_same, outcome
from small_models import STORAGES, prebuilt, sheet_without_mesh

STORE = Path(__file__).with_suffix(".json")
SKINS = {
    "l": ("l", "adjacent", 8),
    "rounded": ("rounded", "opposite", 10),
    "disk": ("disk", "skip", 9),
}


NUMBERS = (bytes(4), b"\xff\xff\xff\xff", b"\0\0\x80\x7f", b"\5\0\0\0")


def made(skin: str = "l", **settings: Any) -> Model:
    sheet = sheet_without_mesh(*SKINS[skin])
    chosen = BuildSettings(**{"rank": 13} | settings)
    return make_model(sheet.skin, sheet.protocol, sheet.linear, chosen)


def of(model: Model) -> list[Any]:
    """What a model says; P and S by products in which no direction's sign is left."""
    p, s = model.projection.astype(float), model.sensitivity
    meta = {key: value for key, value in model.meta.items() if key != "made_by"}
    of_rows = row_form.row_form(model.projection, model.stored)
    return [
        [p.T @ p, p.T @ s, (s**2).sum(axis=0), model.column_weight, model.v_ref_v],
        [model.rank, model.lipschitz, model.noise_gain, model.data_kind, model.fold, model.grid],
        [model.golden, model.defaults, model.fields, meta, of_rows],
        [default_options(model), tracking(default_options(model))],
    ]


def law(order: int = 2) -> force_law.LoadLaw:
    terms = len(force_law.terms_of(order))
    gain = np.r_[1.0, np.linspace(-0.4, 0.5, terms - 1)].astype(np.float32)
    strength, force = np.array([[0, 1, 4, 9], [0, 0.5, 1.5, 4]], dtype=np.float32)
    return force_law.LoadLaw(strength, force, gain, order, 60.0, 0.8, 0.1)


def loads(order: int) -> list[Any]:
    places = 25 * np.array([(k % 5 - 2, k // 5 - 2) for k in range(25)], dtype=float)
    found = [law(order).forces_at(places, np.full(25, s)) for s in (-1, 0, 0.5, 3, 8, 9, 12, 90)]
    return [law(order).gains_at(places), *found, force_law.terms_of(order)]


def read_again(content: bytes, at: int, value: bytes) -> Any:
    """A load law of which some bytes are others."""
    return force_law.decode_load(content[:at] + value + content[at + len(value) :], "file")


def words_of(blob: bytes) -> Any:
    return outcome(lambda: decode_model(blob, "file").rank)


def damaged(tag: str) -> list[Any]:
    """What is said of a section of which one number is another, in turn."""
    blob = encode_model(replace(made(rank=5), load=law()))
    place, said = sections_of(blob)[tag], []
    for at in range(place.offset, place.offset + min(place.size, 48), 4):
        for value in NUMBERS:
            other = blob[:at] + value + blob[at + 4 :]
            said.append(words_of(sealed(other, rehash=tag in ("DIMS", "PROT"))))
    return said


def taught() -> Model:
    """A model of another form: a precision in place of rows that are orthogonal."""
    folded = len(made(rank=5).fold.first)
    precision = np.eye(folded)[np.tril_indices(folded)].astype(np.float32)
    return replace(made(rank=5), load=law(), row_form=None, precision=precision, place_factor=1.5)


def of_other_sizes() -> list[Any]:
    """What is said where a section has four bytes less or more."""
    said = []
    for blob in (encode_model(taught()), encode_model(replace(made(rank=5), load=law()))):
        for tag in sections_of(blob):
            at = entry_place(blob, tag) + 8
            for change in (-4, 4):
                size = int.from_bytes(blob[at : at + 4], "little") + change
                other = blob[:at] + size.to_bytes(4, "little") + blob[at + 4 :]
                said.append([tag, words_of(sealed(other))])
    return said


def cut() -> list[Any]:
    blob = encode_model(made(rank=5))
    ends = [0, 3, 15, 63, 64, 200, len(blob) // 2, len(blob) - 1]
    return [words_of(blob[:end]) for end in ends] + [words_of(blob + b"\0" * 16)]


def stored(kind: str) -> list[Any]:
    matrix = np.random.default_rng(3).normal(size=(13, 21)) * np.logspace(-3, 2, 21)
    matrix[:, 4] = 0
    of_kind = storage.store(matrix, kind)
    return [of_kind, of_kind.decode(13), [storage.stride_for(k) for k in range(20)]]


def reduced(regularisation: float, power: float) -> list[Any]:
    draw = np.random.default_rng(5)
    jacobian = draw.normal(size=(20, 31)) * np.logspace(0, -2, 20)[:, None]
    jacobian[:, 7] = 0
    found = reduction.reduce_jacobian(
        jacobian, 11, regularisation=regularisation, column_power=power
    )
    p, s = found.projection, found.sensitivity
    return [p.T @ p, np.abs(p), p.T @ s, found.column_weight, reduction.noise_gain(p, s)]


def errors_of(seed: int) -> list[Any]:
    draw = np.random.default_rng(seed)
    of_all, of_drift = draw.normal(size=(2, 40, 6))
    found = model_errors.ModelErrors(
        model_errors.as_covariance(of_all.T @ of_all),
        model_errors.as_covariance(of_drift.T @ of_drift),
        *prebuilt_errors()[2:5],
    )
    content = found.encode()
    return [content, model_errors.decode_model_errors(content, 6, "file")]


def prebuilt_errors() -> list[Any]:
    errors = prebuilt()[0].model_errors
    return [getattr(errors, name) for name in errors.__dataclass_fields__]


CALLS: dict[str, Callable[[], Any]] = {
    **{f"model of {s}": lambda s=s: of(made(s)) for s in SKINS},
    **{
        f"{kind}, {data}, read": lambda kind=kind, data=data: of(
            decode_model(encode_model(made(storage=kind, data_kind=data)), "file")
        )
        for kind in STORAGES
        for data in DATA_KINDS
    },
    "usual rank": lambda: of(made(rank=0)),
    "another regularisation": lambda: of(made(regularisation=0.1, column_power=0.5)),
    "no such rank": lambda: made(rank=300),
    "no such storage": lambda: made(storage="f8"),
    "prebuilt": lambda: of(prebuilt()[0])[1:],
    "prebuilt's errors": prebuilt_errors,
    "uncertainty": lambda: asdict(DEFAULT_UNCERTAINTY),
    **{f"loads of order {order}": lambda order=order: loads(order) for order in range(5)},
    "a load law": lambda: force_law.encode_load(law()),
    "damaged load laws": lambda: [
        outcome(lambda at=at, value=value: read_again(force_law.encode_load(law()), at, value))
        for at in (0, 4, 8, 12, 16, 32, 36, 44, 48, 60, 64, 84)
        for value in NUMBERS
    ],
    "a load law cut off": lambda: force_law.decode_load(force_law.encode_load(law())[:-4], "file"),
    **{
        f"damaged {tag}": lambda tag=tag: damaged(tag)
        for tag in sections_of(prebuilt()[1])
        if tag in ("DIMS", "PROT", "FOLD", "GRID", "DEFS", "META", "WHIT", "FLDS")
    },
    "damaged LOAD": lambda: damaged("LOAD"),
    "taught, read": lambda: of(decode_model(encode_model(taught()), "file")),
    "sections of other sizes": of_other_sizes,
    "cut off": cut,
    **{f"stored as {kind}": lambda kind=kind: stored(kind) for kind in STORAGES},
    **{
        f"reduced {r:g} {p:g}": lambda r=r, p=p: reduced(r, p)
        for r, p in ((0.01, 1.0), (0.1, 0.5), (1e-4, 0.0))
    },
    "model errors": lambda: errors_of(3),
}


@pytest.mark.parametrize("name", CALLS)
def test_same_results_of_models(name):
    check_same(STORE, name, CALLS[name])
