"""``eitskin bench growth`` and ``batches``: exact counts, series, the page and the picture."""

import json

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin_studies.benchmarks import batches as bench_batches
from eitskin_studies.benchmarks import growth as bench_growth
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.harness.sections import fill_marks
from eitskin_studies.pictures.growth_picture import draw_growth
from study_pages import page_copy

POINTS = (
    bench_growth.GrowthPoint("pixels n", across=10, rank=20),
    bench_growth.GrowthPoint("pixels n", across=14, rank=20),
    bench_growth.GrowthPoint("touches", across=14, rank=20, touches=1),
)


def test_counts_are_exact_and_models_are_kept(tmp_path):
    first = bench_growth.run(2, tmp_path, points=POINTS)
    kept = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    again = bench_growth.run(1, tmp_path, points=POINTS)
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == kept
    assert len(kept) == 4
    few, many, one = first.points
    counts = [(p.macs, p.touch_macs) for p in first.points]
    assert counts == [(p.macs, p.touch_macs) for p in again.points]
    assert (few.sweep, few.value, few.n_pixels) == ("pixels n", few.n_pixels, few.n_pixels)
    assert few.n_pixels < many.n_pixels
    assert few.macs < many.macs and one.touch_macs < many.touch_macs and one.value == 1
    assert all(
        p.macs > 3 * p.n_pixels * 20 and p.solve_us > 0 and p.n_rows == 208 for p in first.points
    )
    texts, tables = bench_growth.for_page(first, "the command")
    assert "`the command`" in texts["growth-run"] and "pixels n: MACs ^" in texts["growth-run"]
    assert len(tables["growth"][1]) == 3
    page = page_copy(tmp_path, "benchmarks")
    fill_marks(page, "benchmarks", (texts, tables))
    assert "By `the command`" in page.read_text()
    assert f"{many.macs / 1e3:.0f}" in bench_growth.as_text(first)
    numbers = bench_growth.drawn(first)
    Drawing(draw_growth, numbers)(tmp_path / "p.svg")
    assert "pixels n" in (tmp_path / "p.svg").read_text(encoding="utf-8")
    assert [len(one["values"]) for one in numbers["sweeps"]] == [2, 1]
    assert numbers["sweeps"][0]["touches_kmac"][1] == round(many.touch_macs / 1e3, 1)
    assert json.loads(json.dumps(first.as_dict()))["points"][0]["macs"] == few.macs


def test_the_exponent_of_a_power():
    base = bench_growth.Growth("s", 1, 1, 1, 1, 1, 0.0, 0.0, 1, 1.0, 0.0, (0.0, 0.0))
    points = [
        bench_growth.replace(base, value=value, macs=5.0 * value**1.5) for value in (2, 4, 16)
    ]
    assert bench_growth.exponent(points, lambda p: p.macs) == pytest.approx(1.5)


def test_batches(capsys, tmp_path):
    result = bench_batches.run(16, 2, [1, 2])
    assert [(s.name, s.threads) for s in result.speeds] == [
        ("one after another", 1), ("batch", 1), ("C alone", 1), ("batch", 2), ("C alone", 2),
    ]  # fmt: skip
    assert result.speeds[0].times == 1.0
    assert all(0 < s.least_us <= s.us and s.processor_us > 0 for s in result.speeds)
    page = page_copy(tmp_path, "benchmarks")
    given = ["bench", "batches", "--frames", "16", "--rounds", "1", "--page", str(page)]
    assert main([*given, "--json"]) == 0
    text = page.read_text(encoding="utf-8")
    assert "`eitskin bench batches --frames 16 --rounds 1 --threads 1 2`: 16 frames" in text
    assert "| C alone | 2 |" in text
    assert json.loads(capsys.readouterr().out)["frames"] == 16
    for arguments in (
        "batches --threads 0",
        "batches --frames 1",
        "growth --rounds 0",
        "kernels --rank 1",
    ):
        assert main(["bench", *arguments.split()]) == 2
    assert np.isfinite(result.speeds[1].us)
