"""Tables of results can be downloaded from the site as CSV files."""

import csv
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "docs" / "site"))

from site_tables import with_downloads  # noqa: E402

PAGE = """Before.

<!-- best -->
| method | MIoU |
|---|---|
| [plain](algorithms.md), **best** | .867, 1 &#124; 2 |
<!-- end best -->

| a | b |
|-|-|
| 1 | `two` |

After.
"""


def test_each_table_is_a_csv_file_with_a_link(tmp_path):
    text = with_downloads("some", PAGE, tmp_path / "tables", tmp_path)
    assert text.index("<!-- end best -->") < text.index("</tables/some-best.csv>`")
    assert text.index("| 1 |") < text.index("</tables/some-2.csv>`") < text.index("After.")
    with (tmp_path / "tables/some-best.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows == [["method", "MIoU"], ["plain, best", ".867, 1 | 2"]]
    assert (tmp_path / "tables/some-2.csv").read_text() == "a,b\n1,two\n"
