"""Meanings of numbers: an offset, potentials against ground, differences, a first line that counts.
The doctor finds each before it advises teaching, and the command that it prints repairs it."""

import shlex

import numpy as np
import pytest
from made_sources import UNTOUCHED, noisy, potentials, volts, written

from eitskin.cli.main import main
from eitskin.errors import UsageError
from eitskin.frames.frames import load_frames
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.orders import source_table
from eitskin.frames.source import SourceOptions
from eitskin.skin.protocol import adjacent, opposite
from eitskin.skin.skin import paper_skin

VOLTS = volts()
ADJACENT = ["--protocol", "adjacent", "--electrodes", "16"]
QUIET = ["--reference-frames", "0:8"]
ROTATING = [
    adjacent(16).drive_measure.tolist().index(row)
    for row in source_table("rotating", adjacent(16)).tolist()
]


def doctor(capsys, path, *words):
    code = main(["doctor", str(path), *words])
    return code, capsys.readouterr().out


def repaired(capsys, tmp_path, out):
    """Run the command that the doctor printed; return the frames, and the doctor's new findings."""
    line = next(line for line in out.splitlines() if line.startswith("  all in one: "))
    command = shlex.split(line.partition(": ")[2])
    made = tmp_path / "repaired.npz"
    command[command.index("-o") + 1] = str(made)
    assert command[0] == "eitskin"
    assert main(command[1:]) == 0
    capsys.readouterr()
    return load_frames(made), main(["doctor", str(made)])


def like(frames, wanted, least=0.99):
    change = frames.voltage_v - frames.reference_v
    true = wanted[UNTOUCHED:] - wanted[:UNTOUCHED].mean(axis=0)
    strongest = int(np.argmax(np.linalg.norm(true, axis=1)))
    return np.corrcoef(change[strongest], true[strongest])[0, 1] >= least


COUNTS = VOLTS / np.abs(VOLTS).max()


@pytest.mark.parametrize(
    ("counts", "offset", "more"),
    [
        (np.round(2048 + 1800 * COUNTS), -2048, ""),
        (np.round(512 + 450 * noisy(COUNTS, 2, 50)), -512, ""),
        (np.round(32768 + 20000 * COUNTS), -32768, ""),
        (np.round(2048 - 1800 * COUNTS), -2048, "--sign reversed"),
        (np.round(2048 + 1800 * COUNTS)[:, ROTATING], -2048, "--order rotating"),
        (1.65 + COUNTS, -1.65, ""),
        (1650 + 800 * COUNTS, -1650, ""),
        (0.4 * COUNTS - 0.9, 0.9, ""),
    ],
    ids=[
        "12 bits",
        "10 bits",
        "16 bits",
        "reversed",
        "rotating",
        "volts",
        "millivolts",
        "negative",
    ],
)
def test_an_offset_is_found_and_taken_out(tmp_path, capsys, counts, offset, more):
    path = written(tmp_path / "counts.csv", counts)
    code, out = doctor(capsys, path, *ADJACENT, *QUIET)
    assert code == 11 and "teach" not in out
    assert f"--offset {offset:.10g}" in out and more in out
    frames, code = repaired(capsys, tmp_path, out)
    assert code == 0 and (like(frames, VOLTS, 0.8) or more == "--sign reversed")


def test_an_offset_is_in_the_units_of_the_source(tmp_path, capsys):
    path = written(tmp_path / "counts.csv", np.round(2048 + 1800 * COUNTS))
    options = [*ADJACENT, *QUIET, "--scale", "0.0008"]
    assert "--offset -2048" in doctor(capsys, path, *options)[1]
    wrong = doctor(capsys, path, *options, "--offset", "-1024")[1]
    assert "--offset -2048" in wrong and "--offset -1024" not in wrong
    assert doctor(capsys, path, *options, "--offset", "-2048")[0] == 0


def test_an_offset_in_a_frames_file_is_taken_out_there(tmp_path, capsys):
    path, out = written(tmp_path / "c.csv", 2048 + 1800 * COUNTS), tmp_path / "c.npz"
    assert main(["import", str(path), "-o", str(out), *ADJACENT, *QUIET]) == 0
    _, said = doctor(capsys, out)
    assert "--offset -2048" in said and repaired(capsys, tmp_path, said)[1] == 0


def test_healthy_frames_have_no_offset(tmp_path, capsys):
    for frames in (VOLTS, -VOLTS, volts(seed=3, snr_db=40)):
        out = doctor(capsys, written(tmp_path / "v.csv", frames), *ADJACENT, *QUIET)[1]
        assert "offset" not in out


def test_pairs_have_the_offset_in_both_parts(tmp_path):
    table = np.empty((12, 416))
    table[:, 0::2], table[:, 1::2] = 2048 + 100 * COUNTS, 2048 + 10 * COUNTS
    path = written(tmp_path / "iq.csv", table)
    source = SourceOptions(
        complex_part="real", pairs="real-imag", offset=-2048.0, reference_frames="0:8"
    )
    frames = import_frames(path, ImportOptions(source=source), adjacent(16), None)
    assert np.allclose(frames.reference_voltage_v, 100 * COUNTS[:8], atol=1e-5)
    np.savez(tmp_path / "z.npz", v=VOLTS * 1j)
    source = SourceOptions(complex_part="imag", offset=-1.0, reference_frames="0:8")
    with pytest.raises(UsageError, match="--offset -1 goes with real numbers"):
        import_frames(tmp_path / "z.npz", ImportOptions(source=source), adjacent(16), None)


@pytest.mark.parametrize("given", ([], ["--order", "fixed-all"], ["--order", "rotating-all"]))
@pytest.mark.parametrize("rotating", (False, True))
def test_potentials_are_found_and_subtracted(tmp_path, capsys, given, rotating):
    path = written(tmp_path / "p.csv", potentials(rotating=rotating))
    code, out = doctor(capsys, path, *ADJACENT, *QUIET, *given)
    order = "rotating" if rotating else "fixed"
    assert code == 11 and f"--order {order} --potentials" in out and "teach" not in out
    frames, code = repaired(capsys, tmp_path, out)
    assert code == 0 and like(frames, VOLTS, 0.95)


def test_potentials_of_other_protocols_and_with_blanks_at_the_drives(tmp_path, capsys):
    values = potentials(opposite(16))
    n = len(np.unique(opposite(16).drive_measure[:, :2], axis=0))
    for k, (a, b) in enumerate(np.unique(opposite(16).drive_measure[:, :2], axis=0).tolist()):
        values[:, 16 * k + a] = values[:, 16 * k + b] = np.nan
    assert values.shape == (12, 16 * n)
    path, out = written(tmp_path / "o.csv", values), tmp_path / "o.npz"
    words = ["--protocol", "opposite", "--electrodes", "16", *QUIET, "--potentials"]
    assert main(["import", str(path), "-o", str(out), *words]) == 0
    wanted = volts(opposite(16).drive_measure)
    assert like(load_frames(out), wanted, 0.95)
    capsys.readouterr()


def test_ground_in_a_table_of_rows(tmp_path):
    rows = source_table("fixed", adjacent(16), potentials=True)
    table = tmp_path / "rows.csv"
    table.write_text("\n".join(f"{a + 1},{b + 1},{c + 1},ground" for a, b, c, _ in rows.tolist()))
    path = written(tmp_path / "p.csv", potentials())
    source = SourceOptions(reference_frames="0:8", table_base=1)
    options = ImportOptions(source=source, order="table", table_file=str(table))
    assert like(import_frames(path, options, adjacent(16), None), VOLTS, 0.95)


def test_differences_are_found_and_the_reference_is_predicted(tmp_path, capsys):
    change = noisy(VOLTS - VOLTS[:8].mean(axis=0), 4, 60)
    path = written(tmp_path / "dv.csv", change, form="%.9e")
    code, out = doctor(capsys, path, *ADJACENT)
    assert code == 11 and "--differences" in out and "teach" not in out
    frames, code = repaired(capsys, tmp_path, out)
    assert code == 0
    strongest = int(np.argmax(np.linalg.norm(change, axis=1)))
    got = frames.voltage_v[strongest] - frames.reference_v
    assert np.corrcoef(got, change[strongest])[0, 1] > 0.999
    rotating = written(tmp_path / "dr.csv", change[:, ROTATING], form="%.9e")
    assert "--order rotating --differences" in doctor(capsys, rotating, *ADJACENT, *QUIET)[1]
    zeros = written(tmp_path / "dz.csv", np.vstack([np.zeros(208), change]), form="%.9e")
    assert "--differences" in doctor(capsys, zeros, *ADJACENT, "--reference-frames", "0")[1]


def test_differences_of_a_known_skin_are_in_volts(tmp_path):
    change = VOLTS - VOLTS[:8].mean(axis=0)
    path = written(tmp_path / "dv.csv", change, form="%.12e")
    skin = paper_skin()
    options = ImportOptions(source=SourceOptions(scale=1.0), differences=True)
    frames = import_frames(path, options, adjacent(16), skin)
    assert np.allclose(frames.voltage_v - frames.reference_v, change, atol=1e-12)
    assert "notes" not in frames.meta
    relative = change / VOLTS[:8].mean(axis=0)
    path = written(tmp_path / "r.csv", relative, form="%.12e")
    frames = import_frames(path, ImportOptions(relative_differences=True), adjacent(16), skin)
    assert np.allclose(frames.voltage_v / frames.reference_v - 1, relative, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"differences": True, "relative_differences": True}, "contradict each other"),
        ({"differences": True, "sign": "magnitude"}, "differences need their signs"),
        ({"potentials": True, "sign": "magnitude"}, "potentials need their signs"),
        ({"differences": True, "equalise": True}, "no reference of their own"),
    ],
)
def test_contradictions_are_refused(tmp_path, options, said):
    path = written(tmp_path / "v.csv", VOLTS)
    with pytest.raises(UsageError, match=said):
        import_frames(path, ImportOptions(**options), adjacent(16), None)


HEADERS = {
    "from 0": ",".join(map(str, range(208))),
    "from 1": ",".join(map(str, range(1, 209))),
    "as floats": ",".join(f"{k}.0" for k in range(208)),
    "quoted": ",".join(f'"{k}"' for k in range(208)),
}


@pytest.mark.parametrize("header", HEADERS.values(), ids=HEADERS)
def test_a_first_line_that_counts_is_a_header(tmp_path, header):
    body = written(tmp_path / "b.csv", VOLTS).read_text()
    (tmp_path / "h.csv").write_text(f"{header}\n{body}")
    frames = import_frames(tmp_path / "h.csv", QUIET_SOURCE, adjacent(16), None)
    assert frames.n_frames == 4 and np.allclose(frames.voltage_v, VOLTS[8:])
    assert "line 1 counts the columns" in frames.meta["notes"][0]


QUIET_SOURCE = ImportOptions(source=SourceOptions(reference_frames="0:8"))


@pytest.mark.parametrize("first", ("", "index", "frame"))
def test_an_index_beside_the_numbers_is_left_out(tmp_path, first):
    rows = [f"{first}," + HEADERS["from 0"]]
    rows += [f"{k}," + ",".join(f"{v:.9g}" for v in row) for k, row in enumerate(VOLTS)]
    (tmp_path / "i.csv").write_text("\n".join(rows))
    frames = import_frames(tmp_path / "i.csv", QUIET_SOURCE, adjacent(16), None)
    assert np.allclose(frames.voltage_v, VOLTS[8:])
    columns = [first + "," + ",".join(map(str, range(12)))]
    columns += [f"{k}," + ",".join(f"{v:.9g}" for v in row) for k, row in enumerate(VOLTS.T)]
    (tmp_path / "c.csv").write_text("\n".join(columns))
    frames = import_frames(tmp_path / "c.csv", QUIET_SOURCE, adjacent(16), None)
    assert np.allclose(frames.voltage_v, VOLTS[8:])


def test_one_column_below_its_number(tmp_path):
    text = "0\n" + "\n".join(f"{v:.9g}" for v in VOLTS[0])
    (tmp_path / "s.csv").write_text(text)
    source = SourceOptions(reference_frames="0")
    frames = import_frames(tmp_path / "s.csv", ImportOptions(source=source), adjacent(16), None)
    assert np.allclose(frames.reference_voltage_v, VOLTS[:1])


def test_counts_in_the_numbers_stay(tmp_path):
    (tmp_path / "n.csv").write_text("\n".join(f"{k},{2 * k}" for k in range(208)))
    source = SourceOptions(reference_frames="0")
    frames = import_frames(tmp_path / "n.csv", ImportOptions(source=source), adjacent(16), None)
    assert frames.protocol.n_rows == 208
