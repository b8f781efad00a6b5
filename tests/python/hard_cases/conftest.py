"""Hard cases run in float32 on the host and the emulated Cortex-M7, and in float64 on the host."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from eitskin_emulator.core_steps import Step
from everywhere import Outcome, SameEverywhere, on_host


class Float64(SameEverywhere):
    """Runs steps in float64, which only the host has."""

    width, real = "float64", np.float64

    def steps(self, steps: Sequence[Step]) -> tuple[list[int], list[Outcome]]:
        return on_host(steps, "float64")


FLOAT64 = pytest.param("float64", marks=pytest.mark.long("the same test in float32"))


@pytest.fixture(params=["float32", FLOAT64])
def same_everywhere(request, same_everywhere, margins) -> Iterator[SameEverywhere]:
    """``float32`` as in all other tests. ``float64``: the same source with the same bounds, whose
    margins are those of float64."""
    if request.param == "float32":
        yield same_everywhere
        return
    with margins.on("host f64"):
        yield Float64(same_everywhere.program, same_everywhere.new_folder)
