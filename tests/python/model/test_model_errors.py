"""The section UNCE: drawn from random skins, by any number of processes the same, stored, read."""

import struct
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from two_readers import agreed

from eitskin.core.engine import CoreEngine
from eitskin.errors import ModelError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.grid import grid_for
from eitskin.fem.mesh import mesh_for_elements
from eitskin.model import monte_carlo
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import HEADER, decode_model, encode_model
from eitskin.model.eitm_sections import decode_sections, encode_sections
from eitskin.model.model import DATA_KINDS, Model
from eitskin.model.model_errors import (
    HEAD,
    ModelErrors,
    RowErrors,
    TarePlaces,
    as_covariance,
    decode_model_errors,
)
from eitskin.model.monte_carlo import draw_model_errors
from eitskin.model.random_skins import ROW_ERRORS, RandomSkins, Request
from eitskin.model.reduction import fold_rows
from eitskin.model.tare_places import metrics_of, row_errors, tare_places
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk, polygon
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import Skin
from eitskin.skin.uncertainty import Uncertainty
from small_models import prebuilt, tiny_blob

FEW = Uncertainty(samples=8)
CALM = replace(
    FEW,
    electrode_position_sd=0.0,
    electrode_width_log_sd=0.0,
    contact_log_sd=0.0,
    out_of_round=0.0,
    background_log_sd=0.0,
)
SKIN = Skin("tiny", disk(100.0), Electrodes(8, 3.0), conductivity_s_per_m=0.02, thickness_mm=5.0)


@cache
def request(data_kind: str = "difference", uncertainty: Uncertainty = FEW) -> Request:
    protocol = adjacent(8)
    fold = protocol.reciprocal_pairs()
    projection = np.random.default_rng(1).normal(size=(5, len(fold.first)))
    mesh, grid = mesh_for_elements(SKIN, 600), grid_for(SKIN.outline, 10)
    return Request(SKIN, protocol, mesh, fold, data_kind, projection, grid, uncertainty)


@cache
def errors() -> ModelErrors:
    return draw_model_errors(request(), jobs=1)


@cache
def joint_errors() -> ModelErrors:
    """The errors of a model that fits all touches at once."""
    return draw_model_errors(replace(request(), fits_jointly=True), jobs=1)


def is_covariance(matrix: np.ndarray) -> bool:
    low, high = np.linalg.eigvalsh(matrix.astype(np.float64))[[0, -1]]
    return bool(matrix.dtype == np.float32 and (matrix == matrix.T).all() and low >= 0 < high)


def test_any_number_of_processes_draws_the_same():
    seen: list[tuple[int, int]] = []

    def progress(drawn, total):
        for row in drawn:
            seen.append((len(seen) + 1, total))
            yield row

    alone = joint_errors()
    again = draw_model_errors(replace(request(), fits_jointly=True), jobs=2, progress=progress)
    assert again.encode() == alone.encode()
    assert again.places is not None and alone.places is not None
    assert again.places.encode() == alone.places.encode()
    assert again.rows is not None and alone.rows is not None
    assert again.rows.encode() == alone.rows.encode()
    assert seen == [(k, 8) for k in range(1, 9)]
    other = RandomSkins(request(uncertainty=replace(FEW, seed=2))).sample(0)
    assert not np.array_equal(other, RandomSkins(request()).sample(0))


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_every_kind_of_data(data_kind):
    skins = RandomSkins(request(data_kind))
    rows = np.array([skins.sample(k) for k in range(4)])
    assert is_covariance(skins.error(rows)) and is_covariance(skins.drift())
    assert (rows[:, -2:] > 1e-4).all() and (rows[:, -2:] < 1).all()


def test_a_skin_as_described_errs_by_shapes_alone():
    rows = np.array([RandomSkins(request(uncertainty=CALM)).sample(k) for k in range(3)])
    assert (rows[:, -2] < 1e-10).all() and (rows[:, -1] > 1e-3).all()
    assert np.abs(rows[:, :5]).max() < 1e-9


def test_row_gains_help_where_the_sheet_is_uneven():
    uneven = replace(CALM, background_log_sd=0.3)
    with_gains, without = (
        np.mean([RandomSkins(request(uncertainty=u)).sample(k)[-2] for k in range(6)])
        for u in (uneven, replace(uneven, row_gains=False))
    )
    assert with_gains < 0.7 * without


def test_drift_is_that_of_drawn_fields():
    """The covariance, taken to first order, against nonlinear solves."""
    skins, draw = RandomSkins(request()), np.random.default_rng(5)
    drawn = []
    for _ in range(200):
        field = skins._random_field(draw, draw.uniform(0.35, 1.0))
        v = skins._fold(skins.forward.voltages(skins.conductivity * np.exp(0.02 * field)))
        drawn.append(skins.request.projection @ skins._datum(v, skins.v_ref))
    moment = np.transpose(drawn) @ np.array(drawn) / len(drawn)
    assert np.trace(moment) == pytest.approx(np.trace(skins.drift()), rel=0.2)


def test_a_thin_skin_takes_what_fits():
    strip = Skin("strip", polygon([(0, 0), (300, 0), (300, 4), (0, 4)]), Electrodes(8, 2.0))
    fold = adjacent(8).reciprocal_pairs()
    mesh = mesh_for_elements(strip, 600)
    projection = np.eye(len(fold.first))[:3]
    grid = grid_for(strip.outline, 10)
    skins = RandomSkins(
        Request(strip, adjacent(8), mesh, fold, "difference", projection, grid, FEW)
    )
    assert np.isfinite([skins.sample(k) for k in range(4)]).all()


def test_build_model_draws_as_told():
    settings = BuildSettings(rank=5, pixels_across=8, elements=300)
    counted = []

    def built(skin: Skin, samples: int | None) -> Model:
        def progress(drawn, total):
            counted.append(total)
            return drawn

        return build_model(skin, adjacent(8), replace(settings, samples=samples), progress=progress)

    model = built(replace(SKIN, uncertainty=replace(FEW, samples=2)), None)
    assert model.model_errors is not None and counted == [2]
    assert built(replace(SKIN, uncertainty=None), None).model_errors is None
    assert built(SKIN, 0).model_errors is None and counted == [2]
    few = built(SKIN, 3)
    assert counted == [2, 3]
    bare = replace(few, model_errors=None)
    assert encode_model(bare) == encode_model(built(SKIN, 0))  # nothing else differs


def test_it_is_read_as_written():
    model = decode_model(tiny_blob(), "tiny")
    assert model.model_errors is None and HEADER.unpack_from(tiny_blob())[2] == 3
    for row_gains in (True, False):
        written = replace(errors(), row_gains=row_gains, places=None)
        blob = encode_model(replace(model, model_errors=written))
        assert HEADER.unpack_from(blob)[1:3] == (1, 4)
        assert len(blob) == len(tiny_blob()) + 16 + (16 + 2 * 4 * 15 + 15) // 16 * 16
        read = decode_model(blob, "made").model_errors
        assert read is not None and read.encode() == written.encode()
        assert (read.error == errors().error).all() and (read.drift == errors().drift).all()
        assert read.row_gains == row_gains
        assert encode_model(decode_model(blob, "made")) == blob


def test_what_the_tare_tells_of_places_is_read_as_written():
    model = decode_model(tiny_blob(), "tiny")
    bare, folds = replace(errors(), places=None), len(model.fold.first)
    places = made_places(folds)
    blob = encode_model(replace(model, model_errors=replace(bare, places=places)))
    assert HEADER.unpack_from(blob)[1:3] == (1, 10)
    read = decode_model(blob, "made").model_errors
    assert read is not None and read.places is not None
    assert read.places.encode() == places.encode()
    for change, said in (
        ({"left": places.left[:, :-1]}, "section 'GEOM' of a size"),
        ({"left": np.vstack([places.left] * 11)}, "section 'GEOM' of a size"),
        ({"left": places.left * 2e6}, "a number in section 'GEOM' that is out of range"),
        ({"left": np.full_like(places.left, np.nan)}, "GEOM"),
        ({"seen": places.seen[:, 1:]}, "section 'MOVE' of a size"),
        ({"seen": np.vstack([places.seen] * 17)}, "section 'MOVE' of a size"),
        ({"moves": places.moves[:, :5]}, "section 'MOVE' of a size"),
        ({"rest": np.vstack([places.rest] * 9)}, "section 'MOVE' of a size"),
        (
            {"rest": places.rest + np.float32(np.inf)},
            "a number in section 'MOVE' that is out of range",
        ),
        ({"moves": places.moves * -2e6}, "a number in section 'MOVE' that is out of range"),
    ):
        wrong = replace(bare, places=replace(places, **change))
        with pytest.raises(ModelError, match=said):
            decode_model(encode_model(replace(model, model_errors=wrong)), "made")


def made_rows(folds: int, terms: int = 6) -> RowErrors:
    draw = np.random.default_rng(8)
    shapes = ((3, folds), (2, folds), (2, 2, terms, 2))
    vectors, seen, moves = (draw.normal(size=shape).astype(np.float32) for shape in shapes)
    return RowErrors(vectors, float(np.float32(0.18)), seen, moves)


def made_places(folds: int) -> TarePlaces:
    draw = np.random.default_rng(3)
    shapes = ((3, folds), (2, folds), (2, 6, 2), (4, folds))
    return TarePlaces(*(draw.normal(size=shape).astype(np.float32) for shape in shapes))


def test_row_errors_are_read_as_written():
    model = decode_model(tiny_blob(), "tiny")
    folds = len(model.fold.first)
    places, rows = made_places(folds), made_rows(folds)
    with_rows = replace(errors(), places=places, rows=rows)
    blob = encode_model(replace(model, model_errors=with_rows))
    assert HEADER.unpack_from(blob)[1:3] == (1, 11)
    read = decode_model(blob, "made").model_errors
    assert read is not None and read.rows is not None
    assert read.rows.encode() == rows.encode() and read.rows.distance == rows.distance
    for part in ("vectors", "seen", "moves"):
        assert (getattr(read.rows, part) == getattr(rows, part)).all()
    assert encode_model(decode_model(blob, "made")) == blob
    assert agreed(blob, "row errors")
    # of no use, and refused, without the places that it corrects
    alone = encode_model(replace(model, model_errors=replace(with_rows, places=None)))
    assert HEADER.unpack_from(alone)[1:3] == (1, 4)


def test_row_errors_that_do_not_fit_are_refused_by_both_readers():
    model = decode_model(tiny_blob(), "tiny")
    folds = len(model.fold.first)
    places, rows = made_places(folds), made_rows(folds)
    size, value = "section 'ROWE' of a size", "a number in section 'ROWE' that is out of range"
    for change, said in (
        ({"vectors": rows.vectors[:0]}, size),
        ({"vectors": np.vstack([rows.vectors] * 11)}, size),
        ({"vectors": rows.vectors[:, 1:]}, size),
        ({"seen": rows.seen[:0]}, size),
        ({"seen": np.vstack([rows.seen] * 17)}, size),
        ({"moves": rows.moves[:, :, :3]}, size),
        ({"moves": rows.moves[:1]}, size),
        ({"vectors": rows.vectors * np.float32(3e6)}, value),
        ({"seen": np.full_like(rows.seen, np.nan)}, value),
        ({"moves": rows.moves + np.float32(np.inf)}, value),
        ({"distance": 0.0}, value),
        ({"distance": 5e-7}, value),
        ({"distance": 2e6}, value),
        ({"distance": float("nan")}, value),
    ):
        wrong = replace(errors(), places=places, rows=replace(rows, **change))
        blob = encode_model(replace(model, model_errors=wrong))
        with pytest.raises(ModelError, match=said) as refused:
            decode_model(blob, "made")
        assert "\n" not in str(refused.value)
        assert not agreed(blob, change)
    sections = encode_sections(replace(model, model_errors=replace(errors(), places=None)))
    with pytest.raises(ModelError, match=size):
        decode_sections(sections | {"ROWE": rows.encode()}, model.protocol.hash, "made")


def test_row_errors_are_the_strongest_of_the_drawn_ones():
    skins = RandomSkins(request())
    rank, folds = request().projection.shape
    rows = np.array([skins.sample(k) for k in range(8)])
    assert rows.shape[1] == 2 * rank + 2 * folds + 3
    drawn = rows[:, 2 * rank : 2 * rank + folds]
    shaped = rows[:, 2 * rank + folds : 2 * rank + 2 * folds]
    # discs explain a part, so the whole errors are larger than those that UNCE has
    assert (np.linalg.norm(drawn, axis=1) >= rows[:, -2]).all()
    vectors, distance = skins.row_errors(rows)
    assert 0 < len(vectors) <= ROW_ERRORS and vectors.shape[1] == folds
    moment = (drawn.T @ drawn + FEW.touch_shapes * shaped.T @ shaped) / len(rows)
    assert np.linalg.norm(vectors.T @ vectors - moment) < 1e-6 * np.linalg.norm(moment)
    sizes = np.linalg.norm(vectors, axis=1)
    assert (np.diff(sizes) <= 0).all()
    assert distance == pytest.approx(np.sqrt(np.mean(rows[:, -3] ** 2)))
    assert 0.001 < distance < 1


def test_a_skin_as_described_has_row_errors_that_a_file_can_hold():
    skins = RandomSkins(request(uncertainty=replace(CALM, touch_shapes=0.0)))
    vectors, distance = skins.row_errors(np.array([skins.sample(k) for k in range(2)]))
    assert len(vectors) >= 1 and np.abs(vectors).max() < 1e-6
    assert distance == 1e-6


def test_metrics_are_white_noise_and_white_noise_with_the_errors():
    vectors = np.random.default_rng(6).normal(size=(4, 20)) * 0.1
    white, with_errors = metrics_of(vectors)
    assert (white == np.eye(20)).all()
    covariance = np.eye(20) / 400**2 + 0.25 * vectors.T @ vectors
    np.testing.assert_allclose(with_errors.T @ with_errors @ covariance, np.eye(20), atol=1e-8)


def test_places_by_the_metric_of_the_reduced_data_are_those_of_the_reduced_data():
    skins = RandomSkins(request())
    folds = request().projection.shape[1]
    by_metric = tare_places(skins, [request().projection, np.eye(folds)])
    reduced = by_metric.reduced
    assert by_metric.moves.shape[:2] == (2, 2)
    draw = np.random.default_rng(2)
    for _ in range(3):
        y = 0.02 * draw.normal(size=folds)
        same, white = (moves @ (by_metric.seen @ y) for moves in by_metric.moves)
        expected = reduced.moves @ (reduced.seen @ y)
        assert np.abs(same - expected).max() < 0.05 * np.abs(expected).max()
        assert np.abs(white - expected).max() > 0.05 * np.abs(expected).max()


def test_a_model_that_fits_jointly_has_row_errors_and_others_have_none():
    assert errors().rows is None and joint_errors().rows is not None
    assert joint_errors().encode() == errors().encode()
    vectors, distance = np.ones((2, 3)), 0.5
    places = tare_places(RandomSkins(request()), [np.eye(request().projection.shape[1])])
    made = row_errors(vectors, distance, places)
    assert made.vectors.dtype == made.seen.dtype == made.moves.dtype == np.float32


def test_a_file_of_format_1_9_corrects_no_places():
    model, alone = decode_model(tiny_blob(), "tiny"), np.ones((2, 20), dtype=np.float32)
    sections = encode_sections(replace(model, model_errors=replace(errors(), places=None)))
    old = decode_sections(sections | {"GEOM": alone.tobytes()}, model.protocol.hash, "old")
    assert old.model_errors is not None and old.model_errors.places is None


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_the_tare_tells_shifted_electrodes_from_an_uneven_sheet(data_kind):
    """By the variance that each leaves of a place, for references equally far from the model."""
    asked = request(data_kind, replace(FEW, electrode_position_sd=0.02, background_log_sd=0.1))
    skins = RandomSkins(asked)
    places, draw = tare_places(skins).reduced.left, np.random.default_rng(4)
    assert places.dtype == np.float32 and places.shape == (16, len(skins.v_ref))
    apart = {}
    for shifted in (True, False):
        reported = []
        for _ in range(6):
            mesh = asked.mesh
            if shifted:
                mesh = skins.deformation.moved(
                    draw.normal(size=8), np.ones(8), np.zeros(len(skins.deformation.rim.nodes))
                )
            field = 0.0 if shifted else 0.05 * mesh.centroids_mm() @ draw.normal(size=2) / 50
            v = fold_rows(
                ForwardModel(mesh, SKIN, asked.protocol).voltages(0.02 * np.exp(field)), asked.fold
            )
            y = np.log(v / np.linalg.norm(v) / (skins.v_ref / np.linalg.norm(skins.v_ref)))
            reported.append(float(((places @ y) ** 2).sum() / np.mean(y**2)))
        apart[shifted] = np.median(reported)
    assert apart[True] > 2 * apart[False]


def test_a_skin_thinner_than_the_step_tells_of_places():
    """No place of the grid lies inside it; the mesh's own do."""
    skin = Skin(
        "thin",
        polygon([(0, 0), (600, 0), (600, 1), (0, 1)]),
        Electrodes(8, 1.0),
        conductivity_s_per_m=0.02,
        thickness_mm=5.0,
    )
    mesh = mesh_for_elements(skin, 600)
    grid = grid_for(skin.outline, 10)
    places = tare_places(RandomSkins(replace(request(), skin=skin, mesh=mesh, grid=grid))).reduced
    assert len(places.left) == 16
    assert all(np.isfinite(part).all() for part in (places.left, places.seen, places.moves))


def test_a_skin_that_is_as_described_has_nothing_to_correct():
    places = tare_places(RandomSkins(request(uncertainty=CALM))).reduced
    assert np.abs(places.left).max() == np.abs(places.moves).max() == 0


def test_the_core_takes_a_model_with_it():
    model = prebuilt()[0]
    unit = np.eye(model.rank, dtype=np.float32)
    blob = encode_model(replace(model, model_errors=ModelErrors(unit, unit, 0.04, 0.1)))
    assert CoreEngine(blob, "float32").self_test() == 0


WHOLE = HEAD.pack(1, 0.04, 0.1, 0.0) + np.array([1, 0.5, 1, 2, 0, 2], "<f4").tobytes()


def changed(at: int, value: float) -> bytes:
    return WHOLE[:at] + struct.pack("<f", value) + WHOLE[at + 4 :]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (WHOLE[:-4], "section 'UNCE' of 36 bytes instead of 40"),
        (WHOLE + bytes(4), "section 'UNCE' of 44 bytes instead of 40"),
        (changed(4, float("nan")), "a number in section 'UNCE' that is out of range"),
        (changed(8, -0.1), "a number in section 'UNCE' that is out of range"),
        (changed(20, float("inf")), "a number in section 'UNCE' that is out of range"),
        (changed(20, 1.5), "a matrix in section 'UNCE' that is not a covariance"),
        (changed(28, -2.0), "a matrix in section 'UNCE' that is not a covariance"),
    ],
)
def test_refused(content, said):
    assert decode_model_errors(WHOLE, 2, "x").error.tolist() == [[1, 0.5], [0.5, 1]]
    with pytest.raises(ModelError, match=f"x: holds {said}") as refused:
        decode_model_errors(content, 2, "x")
    assert "\n" not in str(refused.value)


def test_rounding_leaves_a_covariance():
    vectors = np.linalg.qr(np.random.default_rng(2).normal(size=(40, 40)))[0]
    for least in (1e-12, 0.0, -1e-3):
        spectrum = np.geomspace(1, 1e-14, 40)
        spectrum[-1] = least
        assert is_covariance(as_covariance((vectors * spectrum) @ vectors.T))
    assert (as_covariance(np.zeros((3, 3))) == 0).all()


def test_a_process_that_fails_is_named(monkeypatch):
    with pytest.raises(
        ModelError, match=r"random skins failed \(ValueError: matmul.*\);"
    ) as refused:
        draw_model_errors(replace(request(), projection=None), jobs=2)
    assert "\n" not in str(refused.value)
    monkeypatch.setattr(monte_carlo.sys, "executable", "/bin/false")
    with pytest.raises(ModelError, match="ended early"):
        draw_model_errors(request(), jobs=2)
