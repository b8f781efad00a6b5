"""A frame's time as a range: the table and the sentence about two bounds."""

import pytest

from eitskin.errors import ConfigError
from eitskin_studies.benchmarks.time_range import (
    BoundedFrame,
    TimeRange,
    for_page,
    stored_ratios,
    table,
)
from eitskin_studies.harness.numbers import file_of, keep_numbers
from study_pages import PAGES, page_copy


def frame(bound: str, solve_us: int, switch_us: float, scan: str = "104 rows") -> BoundedFrame:
    stages = {"demodulate": 500, "solve": solve_us, "touches": 3000, "send": 30}
    return BoundedFrame("now", scan, bound, 10_400, stages, 1.5, switch_us, 4.5, 0.0)


def result(solve_us: int) -> TimeRange:
    rows = [
        frame(bound, us, switch_us, scan)
        for scan in ("208 rows", "104 rows")
        for bound, us, switch_us in (("optimistic", 6000, 1.5), ("pessimistic", solve_us, 3.4))
    ]
    return TimeRange("two_touch", 4, tuple(rows))


def test_a_row_goes_from_one_bound_to_the_other():
    head, rows = table(result(15_000))
    row = dict(zip(head, rows[1], strict=True))
    assert row["rows"] == "104 rows" and row["solve, ms"] == "6.00 to 15.00"
    assert row["frames a second"] == "56 to 96" and row["switched after, µs"] == "1.50 to 3.40"


def test_the_rate_of_half_scans_is_that_of_the_pessimistic_bound():
    text = for_page(result(15_000), "x")[0]["time-run"]
    assert "104 rows are solved at 56 frames per second" in text


def test_the_page_has_the_marks(tmp_path):
    from eitskin_studies.harness.sections import fill_marks

    page = page_copy(tmp_path, "board-cost")
    fill_marks(page, "board-cost", for_page(result(15_000), "eitskin bench time"))
    assert "6.00 to 15.00" in page.read_text(encoding="utf-8")


def test_ratios_of_the_bounds_are_those_of_the_stored_times(tmp_path):
    page = tmp_path / "board-cost.md"
    keep_numbers(page, "board-cost", for_page(result(15_000), "eitskin bench time"))
    with pytest.raises(ConfigError, match="studies/run board-cost time"):
        stored_ratios(file_of(page))
    head, row = ("storage", "rows x samples", "worst"), ("f32", "104 x 80", "7.50 ms")
    keep_numbers(page, "board-cost", ({}, {"rates": (head, [row])}))
    assert stored_ratios(file_of(page)) == pytest.approx((9 / 7.5, 18 / 7.5))
    low, high = stored_ratios(file_of(PAGES / "board-cost.md"))
    assert 1 < low < high
