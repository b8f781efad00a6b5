"""Skins and meshes that several model tests share."""

import pytest

from eitskin.fem.mesh import Mesh, build_mesh
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import polygon
from eitskin.skin.skin import Skin, paper_skin
from small_models import rounded_rectangle


@pytest.fixture(scope="session")
def paper_mesh() -> Mesh:
    return build_mesh(paper_skin(), max_size_mm=9.0, electrode_size_mm=1.0)


@pytest.fixture(scope="session")
def l_skin() -> Skin:
    """An L of 100 mm with 12 electrodes."""
    outline = polygon([(0, 0), (100, 0), (100, 30), (30, 30), (30, 100), (0, 100)])
    return Skin("l", outline, Electrodes(12, 5.0), conductivity_s_per_m=0.02, thickness_mm=5.0)


@pytest.fixture(scope="session")
def l_mesh(l_skin) -> Mesh:
    return build_mesh(l_skin, max_size_mm=5.0)


@pytest.fixture(scope="session")
def rounded_skin() -> Skin:
    """A rectangle of 120 x 60 mm with corners of 15 mm radius, its outline given clockwise, with 16
    electrodes."""
    return Skin("rounded", rounded_rectangle(), Electrodes(16, 6.0, clockwise=True))
