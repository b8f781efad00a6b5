"""A session that effects are made in, without a compiler: its own mesh, exact frame and streams."""

from collections.abc import Callable

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh, build_mesh
from eitskin.scene.effect import EffectSession
from eitskin.scene.streams import stream
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin


@pytest.fixture(scope="session")
def small_mesh() -> Mesh:
    return build_mesh(paper_skin(), max_size_mm=9.0, electrode_size_mm=1.0)


@pytest.fixture(scope="session")
def v0(small_mesh) -> FloatArray:
    return ForwardModel(small_mesh, paper_skin(), adjacent(16), 0.0).voltages(0.01)


@pytest.fixture
def make_session(small_mesh, v0) -> Callable[..., EffectSession]:
    """Sessions on the paper's skin; ``drawn`` records the streams that were asked for."""

    def make(
        n_frames: int = 40,
        quiet_frames: int = 8,
        rate_hz: float = 20.0,
        seed: int = 1,
        drawn: list[str] | None = None,
    ) -> EffectSession:
        def make_stream(name: str, index: int) -> np.random.Generator:
            if drawn is not None:
                drawn.append(name)
            return stream(seed, name, index)

        return EffectSession(
            skin=paper_skin(),
            protocol=adjacent(16),
            n_frames=n_frames,
            quiet_frames=quiet_frames,
            rate_hz=rate_hz,
            seed=seed,
            build_mesh=lambda: small_mesh,
            solve_v0=lambda: v0,
            make_stream=make_stream,
        )

    return make
