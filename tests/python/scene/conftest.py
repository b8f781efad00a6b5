"""Fixtures for the tests of scenes: one cache of meshes per module."""

import pytest

from eitskin.scene.session import MeshCache


@pytest.fixture(scope="module")
def mesh_cache() -> MeshCache:
    """Meshes, models and untouched skins, kept from scene to scene."""
    return MeshCache()
