"""``eitskin bench kernels``: limits from what the programs print."""

import pytest

from eitskin_studies.benchmarks import kernels as bench_kernels
from eitskin_studies.harness.sections import fill_marks
from study_pages import page_copy

OUTPUT = """kernels avx2
case fma;-;1000;0;0;0;20,20,20
case chain;-;0;0;0;100;110,100,90
case read;-;0;67108864;67108864;0;10000000,10000000,10000000
case read;-;0;1024;1024;0;10,10,10
case read;-;0;102400;102400;0;1000,1000,1000
case panels, all columns;f32;1000;1024;1024;0;25,30,45
case mul, 48 columns;f32;10;2048;1100;0;61,61,61
case dot;-;1;1;1;80;100,100,100
"""


def test_the_slowest_of_three_limits(tmp_path):
    width = bench_kernels.judge("f32", OUTPUT)
    assert (width.kernels, width.fma_per_ns, width.chain_ns) == ("avx2", 50.0, 1.0)
    panels, mul, dot = width.judged
    found = panels.timing.ns, panels.limit_ns, panels.binds, panels.times
    assert found == (30.0, 20.0, "arithmetic", 1.5)
    assert panels.timing.quartiles_ns == (27.5, 37.5)
    assert (mul.limit_ns, mul.binds) == (20.0, "memory") and mul.times == pytest.approx(3.05)
    assert (dot.limit_ns, dot.binds, dot.times) == (80.0, "chain", 1.25)
    result = bench_kernels.KernelTimes(64, 812, 3, "here", (width, width))
    assert bench_kernels.missed(result, True) == ["mul, 48 columns f32 (f32) 3.0"] * 2
    assert bench_kernels.missed(result, False) == []
    page = page_copy(tmp_path, "benchmarks")
    fill_marks(page, "benchmarks", bench_kernels.for_page(result, "the command"))
    assert "1.2 to 3.0 times their limit in f32" in " ".join(page.read_text().split())
    text = bench_kernels.as_text(result)
    assert "beyond 3 times its limit: mul, 48" in text
    assert "1.25" in text
