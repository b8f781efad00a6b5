"""What the tests of scenes share: each mesh is made once a session, and a bench once a module."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import pytest

from eitskin.scene import session
from eitskin.scene.session import MeshCache


@pytest.fixture(scope="session", autouse=True)
def meshes_are_kept() -> Iterator[None]:
    """Netgen is a process of its own, about a second a mesh; meshes cannot be changed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "mesh_for_elements", cache(session.mesh_for_elements))
        yield


@pytest.fixture(scope="module")
def mesh_cache() -> MeshCache:
    """Meshes, models and untouched skins, kept from scene to scene."""
    return MeshCache()
