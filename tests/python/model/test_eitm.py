"""The .eitm file: a written model is read again, its bytes are where docs/reference/eitm-format.md
has them, and damage is refused."""

import json
import struct
import zlib
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from eitm_bytes import HEADER_SIZE, entry_place, patched, sealed, sections_of
from eitskin.core.engine import CoreEngine
from eitskin.errors import EitskinError, FileError, FrameError, ModelError
from eitskin.model import eitm_sections
from eitskin.model.build import BuildSettings, Linearisation, make_model
from eitskin.model.eitm import decode_model, encode_model, encode_tested, load_model, save_model
from eitskin.skin.protocol import in_order, table
from small_models import DATA_KINDS, STORAGES, prebuilt, small, small_blob, small_model, tiny_blob

ITEM = {"f32": "<f4", "f16": "<f2", "i16": "<i2", "i8": "i1"}


def refusal(blob: bytes) -> str:
    """The text with which ``blob`` is refused; a fault of the test where it is not, or not in one
    line."""
    with pytest.raises(ModelError) as caught:
        decode_model(blob, "x.eitm")
    text = str(caught.value)
    assert text.startswith("x.eitm: ") and "\n" not in text
    return text


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", STORAGES)
def test_round_trip(storage, data_kind):
    blob = small_blob(storage, data_kind)
    first = decode_model(blob, "first")
    again = decode_model(encode_model(first), "again")
    assert encode_model(first) == blob
    for model in (first, again):
        assert (model.stored.storage, model.data_kind, model.rank) == (storage, data_kind, 37)
        assert model.protocol.hash == small().protocol.hash
        assert model.protocol.current_a == small().protocol.current_a
        assert model.skin == small().skin
        assert (model.grid.index == small().linear.grid.index).all()
        assert model.grid.pixel_mm == pytest.approx(small().linear.grid.pixel_mm, rel=1e-7)
    for name in ("v_ref_v", "projection", "column_weight", "sensitivity"):
        assert (getattr(first, name) == getattr(again, name)).all()
    pairs = small().protocol.reciprocal_pairs()
    for name in ("first", "second", "sign"):
        assert (getattr(first.fold, name) == getattr(pairs, name)).all()
    for name in ("reference_v", "frame_v", "image"):
        assert (getattr(first.golden, name) == getattr(again.golden, name)).all()
    assert first.defaults == again.defaults
    assert first.defaults.lambda_rel == 0.03  # not 0.029999999329
    assert first.meta == again.meta


def test_the_order_of_drives_is_kept_and_only_whole_ones_are_read():
    made = replace(prebuilt()[0], protocol=in_order(prebuilt()[0].protocol, "by 7"))
    blob = encode_model(made)
    assert struct.unpack_from("<2H", blob, 4) == (1, 11)
    again = decode_model(blob, "x")
    assert again.protocol.drive_order == made.protocol.drive_order
    assert encode_model(again) == blob
    at, size, flags = sections_of(blob)["ORDR"]
    assert (size, flags) == (4 * 208, 0)
    words = np.frombuffer(blob, "<u2", 2 * 208, at).reshape(2, 208)
    assert np.array_equal(words, [made.protocol.scan_rows, made.protocol.scan_places])
    assert CoreEngine(blob).self_test() == 0
    for place, value in ((0, 208), (0, 91), (208, 1), (415, 900)):
        broken = bytearray(blob)
        struct.pack_into("<H", broken, at + 2 * place, value)
        assert "'ORDR'" in refusal(sealed(broken))
        with pytest.raises(EitskinError):
            CoreEngine(sealed(broken))


def test_the_factor_of_places_is_kept_and_only_a_number_is_read():
    blob = encode_model(replace(small_model(), place_factor=4.5))
    assert struct.unpack_from("<2H", blob, 4) == (1, 8)
    assert decode_model(blob, "x").place_factor == 4.5
    at, size, flags = sections_of(blob)["PLAC"]
    assert (size, flags) == (4, 0)
    for value in (-1.0, float("nan"), 2e30):
        broken = bytearray(blob)
        struct.pack_into("<f", broken, at, value)
        assert "'PLAC'" in refusal(sealed(broken))
        with pytest.raises(EitskinError):
            CoreEngine(sealed(broken))


def test_header_as_documented():
    blob = small_blob()
    assert blob[:4] == b"EITM"
    assert struct.unpack_from("<HH", blob, 4) == (1, 3)
    total, crc, count, zero = struct.unpack_from("<4I", blob, 8)
    assert total == len(blob) and total % 16 == 0
    assert crc == zlib.crc32(blob[16:])
    assert count == 13 and zero == 0
    assert struct.unpack_from("<Q", blob, 24)[0] == small().protocol.hash
    assert blob[32:64] == bytes(32)


@pytest.mark.parametrize("storage", STORAGES)
def test_sections_as_documented(storage):
    """Every section's size and content, read by offsets alone."""
    blob, model, linear = small_blob(storage), small_model(storage), small().linear
    sections = sections_of(blob)
    required = {"DIMS", "PROT", "FOLD", "VREF", "REDU", "SENS", "COLW", "GRID", "DEFS", "GOLD"}
    required |= {"SCAL"} if storage in ("i16", "i8") else set()
    assert set(sections) == required | {"META", "FLDS", "WHIT"}
    for name, place in sections.items():
        assert place.offset % 16 == 0 and place.offset >= HEADER_SIZE + 16 * len(sections)
        assert place.flags == (1 if name in required else 0)
    body = {name: blob[p.offset : p.offset + p.size] for name, p in sections.items()}
    m, k, r, stride, n = 208, 104, 37, 40, linear.grid.n_pixels
    dims = struct.unpack("<10I6f", body["DIMS"])
    grid = linear.grid
    assert dims[:10] == (16, m, k, r, stride, n, grid.nx, grid.ny, STORAGES.index(storage), 0)
    numbers = grid.pixel_mm, *grid.origin_mm, 1e-3, model.lipschitz, model.noise_gain
    assert dims[10:] == pytest.approx(numbers, rel=1e-6)
    assert (np.frombuffer(body["PROT"], "u1").reshape(m, 4) == small().protocol.drive_measure).all()
    fold = np.frombuffer(body["FOLD"], "<u2").reshape(k, 4)
    assert (fold[:, 0] == model.fold.first).all() and (fold[:, 1] == model.fold.second).all()
    assert (fold[:, 2] == 1).all() and not fold[:, 3].any()
    v_ref = linear.v0_v[model.fold.first]
    assert np.frombuffer(body["VREF"], "<f4") == pytest.approx(v_ref, rel=1e-6)
    projection = np.frombuffer(body["REDU"], "<f4").reshape(k, stride)
    assert (model.projection == projection[:, :r].T).all() and not projection[:, r:].any()
    columns = np.frombuffer(body["SENS"], ITEM[storage]).reshape(n, stride)
    scale = np.frombuffer(body["SCAL"], "<f4")[:, None] if "SCAL" in body else 1.0
    assert (model.sensitivity == (columns[:, :r].astype(float) * scale).T).all()
    assert not columns[:, r:].any()
    assert (np.frombuffer(body["COLW"], "<f4") == model.column_weight).all()
    assert (np.frombuffer(body["GRID"], "<u2").reshape(n, 2) == grid.index).all()
    defaults = struct.unpack("<2I12fIf", body["DEFS"])
    assert defaults[:14] == pytest.approx(tuple(asdict(model.defaults).values())[:14], rel=1e-6)
    assert model.defaults.solver == "working-set" and defaults[14:] == (1, 0)
    gold = np.frombuffer(body["GOLD"], "<f4")
    assert gold[:m] == pytest.approx(linear.v0_v, rel=1e-6)
    assert (gold[m : 2 * m] == model.golden.frame_v).all()
    assert (gold[2 * m :] == model.golden.image).all()
    assert json.loads(body["META"])["skin"]["skin"]["name"] == "disk"


def fold_section(blob: bytes) -> np.ndarray:
    """Section FOLD as (k, 4) numbers of 16 bits."""
    place = sections_of(blob)["FOLD"]
    return np.frombuffer(blob, "<u2", place.size // 2, place.offset).reshape(-1, 4)


def test_reciprocals_of_the_other_sign():
    """Opposite drive is repeated the other way round half a turn later."""
    blob = small_blob(outline="l", kind="opposite")
    fold = fold_section(blob)
    assert fold.shape == (96, 4) and (fold[:, 1] == fold[:, 0] + 96).all()
    assert (fold.view(np.int16)[:, 2] == -1).all()
    assert (decode_model(blob, "x").fold.sign == -1).all()


def test_rows_without_a_reciprocal_are_marked():
    s = small("l", "opposite")
    whole = s.linear
    half = Linearisation(whole.grid, whole.jacobian[:96], whole.v0_v[:96], whole.elements)
    protocol = table(16, s.protocol.drive_measure[:96])
    blob = encode_model(make_model(s.skin, protocol, half, BuildSettings(rank=20)))
    assert (fold_section(blob)[:, 1] == 0xFFFF).all()
    model = decode_model(blob, "x")
    assert (model.fold.second == -1).all() and len(model.fold.first) == 96
    assert CoreEngine(blob).self_test() == 0


REWRITE = """the core's bits are others: raise EITS_SELF_TEST_REVISION unless that was done since
the last release, and write the prebuilt model's checksums again:
python -c "from eitskin.model import eitm; p='python/eitskin/model/paper.eitm'
eitm.save_model(p, eitm.load_model(p)[0])" """


def test_the_prebuilt_model_is_written_again_bit_for_bit():
    model, blob = prebuilt()
    assert encode_tested(model) == blob, REWRITE
    assert len(blob) < 384 * 1024


def test_bytes_after_the_end_do_not_belong_to_the_model():
    assert encode_model(decode_model(tiny_blob() + b"and more", "x")) == tiny_blob()


def test_a_truncation_is_said_to_be_one():
    blob = tiny_blob()
    for length in range(4, len(blob), 7):
        assert "truncated" in refusal(blob[:length])


def of_major_2() -> bytes:
    blob = bytearray(tiny_blob())
    blob[4] = 2
    blob[100] ^= 1  # said before the checksum
    return bytes(blob)


def with_extra_section(tag: bytes, flags: int) -> bytes:
    """The tiny model with one section more, moved behind a table that is one entry longer."""
    blob = tiny_blob()
    places = sections_of(blob)
    count, shift = len(places) + 1, 16
    table = b"".join(
        struct.pack("<4sIII", name.encode(), p.offset + shift, p.size, p.flags)
        for name, p in places.items()
    )
    start = HEADER_SIZE + 16 * len(places)
    body = blob[start:]
    table += struct.pack("<4sIII", tag, len(blob) + shift, 5, flags)
    whole = blob[:HEADER_SIZE] + table + body + b"extra" + bytes(11)
    return sealed(whole, total=len(whole), count=count)


def test_an_unknown_optional_section_is_skipped():
    model = decode_model(with_extra_section(b"NEWS", 0), "x")
    assert encode_model(model) == tiny_blob()


def without(name: str, storage: str = "f32") -> bytes:
    """The tiny model whose section ``name`` is one that nobody knows or needs."""
    blob = bytearray(tiny_blob(storage))
    place = entry_place(blob, name)
    blob[place : place + 4], blob[place + 12] = b"NONE", 0
    return sealed(blob)


def meta(content: bytes) -> bytes:
    """The tiny model with other META."""
    blob = tiny_blob()
    whole = bytearray(blob + content + bytes(-len(content) % 16))
    struct.pack_into("<2I", whole, entry_place(blob, "META") + 4, len(blob), len(content))
    return sealed(bytes(whole), total=len(whole))


# by section: offset, format and value of a wrong number, and the error that names it
WRONG = {
    "DIMS": (0, "<I", 0, "holds a dimension out of range; build the model again"),
    "PROT": (0, "<4B", (0, 0, 0, 0), "protocol: row 0 (from 0) is [0, 0, 0, 0]: a pair needs two"
             " different electrodes; build the model again"),
    "FOLD": (4, "<h", 2, "holds a fold of rows that do not exist, or a sign that is not 1 or -1"),
    "GRID": (0, "<H", 0xFFFF, "holds a pixel outside the image; build the model again"),
    "DEFS": (0, "<I", 0, "holds a default out of range; build the model again"),
    "WHIT": (0, "<f", -1.0, "holds a section 'WHIT' that does not fit section 'REDU'"),
    "FLDS": (0, "<f", float("inf"), "holds a number in section 'FLDS' that is out of range"),
}  # fmt: skip


def wrong(tag: str) -> bytes:
    """The tiny model with one wrong number in section ``tag``."""
    at, layout, value, _ = WRONG[tag]
    values = value if isinstance(value, tuple) else (value,)
    blob = tiny_blob()
    return patched(blob, sections_of(blob)[tag].offset + at, layout, *values, rehash=tag == "PROT")


def resized(tag: str) -> bytes:
    """The tiny model with section ``tag`` four bytes shorter."""
    blob = tiny_blob()
    return patched(blob, entry_place(blob, tag) + 8, "<I", sections_of(blob)[tag].size - 4)


FOREIGN = (b"", b"E", b"PK\x03\x04" + bytes(200), b"[skin]\nname = 'x'\n" * 20)
NO_OBJECT = (
    b"", b"{", b"[]", b"3", b'"x"', b"\xff\xfe", b'{"skin": 3}', b'{"skin": {"skin": []}}',
    b"[" * 100_000,
)  # fmt: skip
REFUSED = {
    **{f"foreign {content[:4]!r}": (lambda content=content: content, "not an .eitm model")
       for content in FOREIGN},
    "a newer major": (of_major_2, "format is 2.3, this eitskin reads 1.x"),
    "unknown and required": (lambda: with_extra_section(b"NEWS", 1),
                             "needs section 'NEWS', which this eitskin does not know"),
    "twice": (lambda: with_extra_section(b"COLW", 1), "'COLW' is misplaced or repeated"),
    **{f"no {name}": (lambda name=name: without(name), f"section {name!r} is missing")
       for name in eitm_sections.REQUIRED},
    **{f"{tag} with one wrong number": (lambda tag=tag: wrong(tag), said)
       for tag, (_, _, _, said) in WRONG.items()},
    **{f"{tag} of another size": (lambda tag=tag: resized(tag), f"holds section {tag!r} of ")
       for tag in ("DIMS", "PROT", "FOLD", "VREF", "REDU", "SENS", "COLW", "GRID", "DEFS", "GOLD",
                   "WHIT", "FLDS")},
    "integers without scales": (lambda: without("SCAL", "i8"), "section 'SCAL' of no bytes"),
    "floats with scales": (lambda: with_extra_section(b"SCAL", 1), "section 'SCAL' of 5 bytes"),
    **{f"META {content[:12]!r}": (lambda content=content: meta(content), "'META'")
       for content in NO_OBJECT},
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_model_is_refused_by_what_is_wrong(name):
    make, said = REFUSED[name]
    assert said in refusal(make())


def test_save_and_load(tmp_path):
    path = tmp_path / "small.eitm"
    size = save_model(path, small_model())
    assert path.stat().st_size == size
    model, blob = load_model(path)
    assert blob == encode_tested(small_model()) == encode_tested(model)
    assert encode_model(model) == small_blob()
    assert [entry.name for entry in tmp_path.iterdir()] == ["small.eitm"]


def test_another_core_than_the_one_that_wrote_the_checksums_is_told():
    blob = encode_tested(small_model())
    sums = CoreEngine(blob).self_test_sums()
    assert blob.count(sums) == 1 and blob[6] == 7
    for place, reported in ((0, False), (4, True), (len(sums) - 1, True)):  # revision; first, last
        changed = bytearray(sums)
        changed[place] ^= 1
        engine = CoreEngine(encode_model(small_model(), bytes(changed)))
        if reported:
            with pytest.raises(FrameError, match="other bits"):
                engine.self_test()
        else:
            assert engine.self_test() == 0


def test_a_failed_save_leaves_the_old_file_and_nothing_beside(tmp_path, monkeypatch):
    path = tmp_path / "small.eitm"
    path.write_bytes(b"old")

    def full(self: Path, content: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(FileError, match="No space left on device"):
        save_model(path, small_model())
    assert [entry.name for entry in tmp_path.iterdir()] == ["small.eitm"]
    assert path.read_bytes() == b"old"


def test_a_failed_rename_leaves_nothing_beside(tmp_path):
    (tmp_path / "folder.eitm").mkdir()
    with pytest.raises(FileError, match="cannot write it"):
        save_model(tmp_path / "folder.eitm", small_model())
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder.eitm"]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda folder: load_model(folder / "none.eitm"), "no such model"),
        (load_model, "cannot read this model"),
        (lambda folder: save_model(folder / "none" / "x.eitm", small_model()),
         "cannot write there"),
    ],
    ids=["missing", "a folder", "in no folder"],
)  # fmt: skip
def test_files_that_cannot_be(call, said, tmp_path):
    with pytest.raises(FileError, match=said):
        call(tmp_path)
