"""A picture for every effect, and what is refused."""

import pytest

from eitskin.errors import UsageError
from eitskin.scene.registry import BUILT_IN
from eitskin_studies.pictures.effect_pictures import SHOWN, draw_effect
from eitskin_studies.pictures.effect_sketches import SKETCHES
from eitskin_studies.pictures.touch_pictures import draw_touch

PNG = b"\x89PNG\r\n\x1a\n"


def test_every_effect_has_a_picture():
    assert set(SHOWN) == set(SKETCHES) == set(BUILT_IN)


@pytest.mark.parametrize(
    "name",
    [pytest.param("background", marks=pytest.mark.long("two other effects")), "phase", "flex"],
)
def test_pictures_are_drawn_small_and_the_same_again(name, tmp_path):
    for run in ("first", "second"):
        draw_effect(tmp_path / run, name)
    first = (tmp_path / "first").read_bytes()
    assert first == (tmp_path / "second").read_bytes()
    assert first.startswith(PNG) and 2_000 < len(first) < 60_000


def test_an_unknown_effect_is_refused(tmp_path):
    with pytest.raises(UsageError, match="no picture of an effect 'noice'; did you mean 'noise'"):
        draw_effect(tmp_path / "x.png", "noice")
    assert not (tmp_path / "x.png").exists()


def test_a_touchs_law_and_shape_are_drawn(tmp_path):
    for name in ("insulating", "finger"):
        draw_touch(tmp_path / name, name)
        assert (tmp_path / name).read_bytes().startswith(PNG)
    with pytest.raises(UsageError, match="no picture of a touch 'thumb'"):
        draw_touch(tmp_path / "x.png", "thumb")
