"""Delimiter, label, header and decimal comma are guessed together, and a message names what was
found in the file."""

import numpy as np
import pytest
from made_sources import UNTOUCHED, volts

from eitskin.errors import EitskinError
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.source import SourceOptions
from eitskin.frames.tables import read_table
from eitskin.skin.protocol import adjacent

VOLTS = np.round(1e3 * volts(), 3)
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "space": " "}


def taken(path, **options):
    source = SourceOptions(reference_frames="0:8", **options)
    return import_frames(path, ImportOptions(source=source), adjacent(16), None)


def line(values, delimiter, decimal="."):
    cells = [f"{v:.3f}".replace(".", decimal) for v in np.ravel(values)]
    if decimal == "," and delimiter == ",":
        cells = [f'"{cell}"' for cell in cells]
    return delimiter.join(cells)


@pytest.mark.parametrize("decimal", (".", ","), ids=("point", "decimal comma"))
@pytest.mark.parametrize("delimiter", DELIMITERS)
@pytest.mark.parametrize(
    "label", ("", "k", "frame {}", "Frame {}:", "k =", "magnitudes: same line", "header")
)
def test_every_combination_gives_the_same_numbers(tmp_path, decimal, delimiter, label):
    mark, lines = DELIMITERS[delimiter], []
    for number, frame in enumerate(VOLTS):
        if label in ("", "header"):
            lines.append(line(frame, mark, decimal))
        elif "same line" in label:
            lines.append("magnitudes: " + line(frame, mark, decimal))
        else:
            lines.append(label.format(number))
            lines += [line(row, mark, decimal) for row in frame.reshape(16, 13)]
    if label == "header":
        lines.insert(0, mark.join(f"ch{k}" for k in range(208)))
    path = tmp_path / "t.txt"
    path.write_text("\n".join(lines))
    frames = taken(path)
    assert np.array_equal(frames.reference_voltage_v, VOLTS[:UNTOUCHED])
    assert np.array_equal(frames.voltage_v, VOLTS[UNTOUCHED:])
    if label in ("k", "k ="):
        assert np.array_equal(taken(path, label="k").voltage_v, VOLTS[UNTOUCHED:])


@pytest.mark.parametrize("delimiter", DELIMITERS)
def test_one_frame_below_its_label(tmp_path, delimiter):
    rows = [line(row, DELIMITERS[delimiter]) for row in VOLTS[0].reshape(16, 13)]
    path = tmp_path / "one.txt"
    path.write_text("\n".join(["k", *rows]))
    source = SourceOptions(reference_frames="0")
    frames = import_frames(path, ImportOptions(source=source), adjacent(16), None)
    assert np.array_equal(frames.reference_voltage_v, VOLTS[:1])


def test_one_column_with_decimal_commas(tmp_path):
    path = tmp_path / "c.csv"
    path.write_text("\n".join(f"{v:.3f}".replace(".", ",") for v in VOLTS[0]))
    table = read_table(path, fits=(208,))
    assert np.array_equal(table.numbers([0])[:, 0], VOLTS[0])
    path.write_text("\n".join(f"{k},{k % 7}" for k in range(208)))  # two columns of whole numbers
    assert read_table(path, fits=(208,)).n_columns == 2


def test_blocks_between_empty_lines(tmp_path):
    blocks = ["\n".join(line(row, " ") for row in frame.reshape(16, 13)) for frame in VOLTS]
    path = tmp_path / "b.txt"
    path.write_text("\n\n".join(blocks))
    assert np.array_equal(taken(path).voltage_v, VOLTS[UNTOUCHED:])


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("k\n1 2 3\nk\n4 5 6\n", {"label": "frame"},
         r"begin with 'frame'; lines begin with 'k' \(2\)"),
        ("1 2 3\n4 5 6\n", {"label": "k"}, "begin with 'k'; no line begins with a word"),
        ("ref\n1 2\ntouch\n3 4\nref\n5 6\ntouch\n7 8\n", {},
         r"'ref' \(2\), 'touch' \(2\); say with"),
        ("a;b;c\n1;2;3\n4;5;6\n7;8;9\n", {},
         "found: delimiter semicolon, no label, 1 header row, 3 rows of 3 cells"),
        ("k\n1,2,3\nk\n4,5,6\n", {},
         "found: delimiter comma, label 'k', no header row, 2 rows of 3"),
        ("1 2 3\n4 5 6\n", {"delimiter": "bar"}, "no rows of numbers .* check the delimiter"),
    ],
)  # fmt: skip
def test_a_message_names_what_was_found(tmp_path, text, options, said):
    path = tmp_path / "m.txt"
    path.write_text(text)
    with pytest.raises(EitskinError, match=said):
        taken(path, **options)
