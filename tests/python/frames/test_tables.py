"""Text tables: delimiters, headers, decimal commas, column choices, and bad cells named by line and
column."""

from pathlib import Path

import numpy as np
import pytest

from eitskin.errors import EitskinError, FrameError, UsageError
from eitskin.frames.tables import chosen, parse_cell, read_table


def write(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "t.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    "text",
    [
        "1,2.5,-3e-2\n4,5,6\n", "1;2.5;-3e-2\n4;5;6\n", "1;2,5;-3e-2\n4;5;6\n",
        "1\t2.5\t-3e-2\r\n4\t5\t6\r\n", "  1   2.5  -3e-2\n  4   5    6\n", "1|2.5|-3e-2\n4|5|6\n",
        "1,2.5,-3e-2,\n4,5,6,\n", "# made by hand\n\nre,im,third\n1,2.5,-3e-2\n\n4,5,6\n",
        '"a";"b";"c"\n"1";"2,5";"-0,03"\n4;5;6\n', b"\xef\xbb\xbf1,2.5,-3e-2\n4,5,6",
    ],
    ids=[
        "comma", "semicolon", "decimal-comma", "tab", "spaces", "bar", "ends-in-comma", "header",
        "quotes", "bom",
    ],
)  # fmt: skip
def test_the_same_numbers_come_out_of_every_dialect(tmp_path, text):
    found = read_table(write(tmp_path, text)).numbers(range(3)).tolist()
    assert found == [[1, 2.5, -0.03], [4, 5, 6]]


def test_headers_name_columns_and_bad_cells_are_named(tmp_path):
    table = read_table(write(tmp_path, "time,v0,v1\nabc,1,2\n7,3,x\n8,4,\n"))
    assert table.header == ("time", "v0", "v1") and table.n_columns == 3
    assert table.numbers(chosen("v0", 3, table.header, "--columns")).tolist() == [[1], [3], [4]]
    with pytest.raises(FrameError, match=r"line 2, column 0 \(from 0\): 'abc' is not a number"):
        table.numbers([1, 0])
    with pytest.raises(FrameError, match=r"line 3, column 2 \(from 0\): 'x' is not a number"):
        table.numbers([2])


def test_empty_and_missing_cells_are_named(tmp_path):
    with pytest.raises(FrameError, match=r"line 2, column 1 \(from 0\): is empty"):
        read_table(write(tmp_path, "1,2,3\n4,,6\n")).numbers(range(3))
    with pytest.raises(FrameError, match="line 3 has 2 cells, line 1 has 3"):
        read_table(write(tmp_path, "1,2,3\n4,5,6\n7,8\n"))


def test_complex_cells():
    assert parse_cell("1.5-2j") == 1.5 - 2j
    assert parse_cell("1.5 + 2i") == 1.5 + 2j
    assert parse_cell("0,25") == 0.25
    assert np.isnan(parse_cell("NaN") or 0)
    assert parse_cell("1,000.5") is None and parse_cell("") is None and parse_cell("1_0x") is None


def test_column_choices():
    names = ("time", "a", "b", "c")
    assert chosen("2", 4, names, "--columns") == (2,)
    assert chosen("0,2:4", 4, names, "--columns") == (0, 2, 3)
    assert chosen("1:", 4, names, "--columns") == (1, 2, 3)
    assert chosen("b,time", 4, names, "--columns") == (2, 0)
    assert chosen(":", 4, names, "--columns") == (0, 1, 2, 3)
    assert chosen("1,1", 4, names, "--columns") == (1, 1)
    for bad in ("4", "2:9", "3:1", "-1"):
        with pytest.raises(UsageError, match="out of range; there are 0 to 3"):
            chosen(bad, 4, names, "--columns")
    for unknown in ("d", "a-c", "2-4", ""):
        with pytest.raises(
            UsageError,
            match=f"'{unknown}' is not a number, range a:b or a:b:step, or header name;"
            " names are time, a, b, c",
        ):
            chosen(unknown, 4, names, "--columns")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "no rows"),
        (b"# only a comment\n", "no rows"),
        (b"a,b\nc,d\n", "no rows of numbers"),
        (b"\x00\x01\x02", "zero bytes"),
    ],
)
def test_no_table_is_one_line(tmp_path, content, said):
    with pytest.raises(EitskinError, match=said) as caught:
        read_table(write(tmp_path, content))
    assert "\n" not in str(caught.value)


def test_a_forced_delimiter(tmp_path):
    path = write(tmp_path, "1/2\n3/4\n")
    assert read_table(path, "/").numbers(range(2)).tolist() == [[1, 2], [3, 4]]
    with pytest.raises(UsageError, match="one character or one of comma"):
        read_table(path, "slash")
    assert read_table(write(tmp_path, "5 6\n1 2\n"), header_rows=1).numbers(range(2)).tolist() == [
        [1, 2]
    ]
