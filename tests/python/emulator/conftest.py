"""The firmware image, built once."""

import pytest

from emulated import image_of


@pytest.fixture(scope="session")
def image(cortex_m7) -> bytes:
    """The image that the sources give now."""
    return image_of(cortex_m7)
