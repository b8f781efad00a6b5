"""``eitskin bench board``: its numbers are those of the runs, and its page describes them."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from eitskin.cli.main import main
from eitskin.errors import UsageError
from eitskin_emulator import core_on_qemu
from eitskin_studies.benchmarks import board as bench_board
from eitskin_studies.harness.sections import fill_marks

PAGE = Path(__file__).resolve().parents[1] / "results" / "board-cost.md"


@pytest.fixture(scope="module")
def result(cortex_m7) -> bench_board.BoardCost:
    return bench_board.run(2, 1, frames=0, build=cortex_m7)


@pytest.mark.long("test_the_rate_of_the_emulated_board, tests/python/emulated")
def test_every_storage_by_plain_c_cold_and_warm(result):
    assert [(c.storage, c.kernels, c.warm) for c in result.costs] == [
        (storage, kernels, warm)
        for storage in ("f32", "f16", "i16", "i8")
        for kernels, warm in (("portable", False), ("cortex-m7", False), ("cortex-m7", True))
    ]
    by = {(c.storage, c.kernels, c.warm): c for c in result.costs}
    for storage in ("f32", "f16", "i16", "i8"):
        plain, own = by[storage, "portable", False], by[storage, "cortex-m7", False]
        assert plain.macs_mean == own.macs_mean and plain.model_bytes == own.model_bytes
        assert own.mean < 0.75 * plain.mean
        assert own.mean <= own.worst_tenth <= own.worst
        assert own.per_mac == pytest.approx((own.solve_mean + own.touches_mean) / own.macs_mean)
        assert 1000 < own.stack_bytes < 10_240 and 100_000 < own.workspace_bytes < 200_000
    sizes = [by[storage, "cortex-m7", False].model_bytes for storage in ("i8", "f16", "i16", "f32")]
    assert sizes == sorted(sizes)


@pytest.mark.long("test_the_rate_of_the_emulated_board, tests/python/emulated")
def test_images(result):
    nucleo, mps2 = result.images
    assert (nucleo.board, mps2.board) == ("nucleo_f767zi", "mps2_an500")
    assert 40_000 < nucleo.code_bytes < 256 * 1024 and nucleo.stack_bytes >= 8192
    assert nucleo.static_bytes < 128 * 1024


def test_the_rate_of_the_emulated_board(cortex_m7):
    """No frame comes before its rows are measured, and none waits for longer than the slowest solve
    and a little for the link."""
    _, blob = bench_board.load_prebuilt()
    image = cortex_m7 / "firmware" / f"{bench_board.IMAGE}.bin"
    rate = bench_board.measure_rate(blob, "f32", image, 0, 8)
    assert (rate.rows, rate.samples, rate.acquire_us) == (104, 80, 10_400)
    assert 4000 < rate.solve_us_p50 <= rate.solve_us_worst < 25_000
    slowest_us = max(rate.solve_us_worst, rate.acquire_us)
    assert 0.98e6 / slowest_us <= rate.rate_hz <= 1e6 / rate.acquire_us
    lost = rate.rate_hz * rate.acquire_us < 0.98e6
    assert rate.bound == ("solve" if lost else "acquisition")
    late = replace(rate, rate_hz=35.3, acquire_us=20_800, solve_us_p50=12_680.0)
    assert late.bound == "solve"  # of single frames
    assert 1000 < rate.stack_used < 16384


@pytest.mark.long("test_the_rate_of_the_emulated_board, tests/python/emulated")
def test_the_page_and_json(result, tmp_path):
    texts, tables = bench_board.for_page(result, "the command")
    assert "`the command`" in texts["board-run"] and set(tables) == {"cost", "images"}
    page = tmp_path / "page.md"
    page.write_bytes(PAGE.read_bytes())
    fill_marks(page, "board-cost", (texts, tables))
    text = bench_board.as_text(result)
    for cost in result.costs:
        assert f"{cost.mean / 1e6:.2f}" in text
        if not cost.warm and cost.kernels != "portable":
            assert f" | {cost.mean / 1e6:.2f} | " in page.read_text()
    facts = json.loads(json.dumps(result.as_dict()))
    assert facts["costs"][1]["mean"] == result.costs[1].mean and facts["scenes"] == 2


def test_it_says_what_it_needs(monkeypatch, tmp_path, capsys):
    assert main(["bench", "board", "--scenes", "0"]) == 2
    assert main(["bench", "board", "--frames", "1"]) == 2
    assert main(["bench", "board", "--page", str(tmp_path / "no" / "page.md")]) == 3
    capsys.readouterr()
    monkeypatch.setattr(core_on_qemu, "__file__", str(tmp_path / "a" / "b" / "c" / "d.py"))
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "board"]) == 2
    line = capsys.readouterr().err
    assert "source checkout" in line and line.count("\n") == 1
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match="arm-none-eabi-gcc, cmake, ninja"):
        core_on_qemu.need_tools(*core_on_qemu.BUILD_TOOLS)
