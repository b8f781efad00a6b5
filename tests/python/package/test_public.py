"""The names that ``import eitskin`` gives are listed, light, typed, and enough for a program."""

import re
from pathlib import Path

import numpy as np
import pytest

import eitskin
from eitskin.errors import UsageError
from fresh_python import MAIN, run_python, without
from small_models import session

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "python-api.md"


def test_the_page_lists_what_is_public():
    listed = re.findall(r"^## `(\w+)", PAGE.read_text("utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(eitskin.__all__) and set(eitskin.__all__) <= set(dir(eitskin))
    for name in eitskin.__all__:
        assert getattr(eitskin, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'touches'"):
        _ = eitskin.touches


def test_importing_it_imports_next_to_nothing():
    code = "import sys; before = set(sys.modules); import eitskin; "
    done = run_python(code + "print(*(set(sys.modules) - before))")
    new = done.stdout.split()
    assert "eitskin" in new and len(new) <= 6 and "numpy" not in new, done.stderr


def test_a_loop_is_a_program():
    seen = list(eitskin.stream("sim:swipe", mode="touches,image", frames=12))
    assert [frame.time_s for frame in seen] == pytest.approx(np.arange(12) / 20, abs=1e-5)
    last = seen[-1]
    (touch,) = last.touches
    assert last.image is not None and last.image.shape == (812,) and last.voltage_v is None
    assert repr(last) == (
        f"<Frame {last.number} at 0.550 s, touches: #1 ({touch.x_mm:.1f}, {touch.y_mm:.1f})>"
    )
    png, html = last._repr_png_(), last._repr_html_()
    assert png is not None and png.startswith(b"\x89PNG") and html.count("<tr>") == 2
    assert {frame.refused for frame in seen} == {None} and {e.name for e in last.events} <= {"move"}


def test_sinks_and_recordings_of_a_program(tmp_path):
    table, run = tmp_path / "t.csv", tmp_path / "run.eits"
    seen = list(eitskin.stream("sim:swipe", frames=5, to=[f"csv:{table}"], record=run))
    assert len(table.read_text().splitlines()) == 1 + len(seen)
    again = list(eitskin.stream(f"file:{run}"))
    assert [frame.touches for frame in again] == [frame.touches for frame in seen]
    assert again[0].time_unix_s is None and seen[0].time_unix_s is not None


@pytest.mark.parametrize("named", [{"mode": "picture"}, {"iteration": 3}])
def test_what_a_stream_cannot_be_is_refused(named):
    with pytest.raises(UsageError, match=r"touches|iterations"):
        next(eitskin.stream("sim:swipe", **named))


def test_frames_to_touches():
    """The page's second program."""
    model, frames = eitskin.load_model(), session().as_frames()
    assert repr(model) == "<Model paper, 16 electrodes, 208 rows, 812 pixels, rank 64>"
    assert repr(frames) == "<Frames 20 of 208 rows, 64 untouched>"
    reconstructor = eitskin.Reconstructor(model)
    reconstructor.tare(frames.reference_voltage_v)
    result = reconstructor.reconstruct(frames.voltage_v[0])
    assert repr(result).startswith("<Reconstruction, touches: #1 (") and "\n" not in repr(result)
    png = result._repr_png_()
    assert png is not None and png.startswith(b"\x89PNG") and "<table>" in result._repr_html_()


def test_axes_are_taken_and_returned():
    from matplotlib.figure import Figure

    from eitskin.view.touch_axes import draw_touches

    ax = Figure().add_subplot()
    assert draw_touches(eitskin.load_model(), title="skin", ax=ax) is ax
    assert ax.get_title() == "skin" and len(ax.patches) >= 2
    assert not hasattr(ax, "_repr_png_")  # whoever made the figure shows it


def test_axes_of_a_new_figure_are_a_picture_in_a_notebook():
    from eitskin.view.touch_axes import draw_touches

    axes = draw_touches(eitskin.load_model(), title="skin")
    assert axes._repr_png_().startswith(b"\x89PNG")


def test_without_matplotlib_there_is_no_picture():
    code = without("scipy") + (
        "import importlib.util as u\nfind = u.find_spec\n"
        "u.find_spec = lambda name, *a: None if name == 'matplotlib' else find(name, *a)\n"
        "import eitskin\nfrom eitskin.core.results import Reconstruction\n"
        "print(Reconstruction(None, None, (), None, eitskin.load_model())._repr_png_())\n"
    )
    done = run_python(code)
    assert done.stdout.strip() == "None", done.stderr


def test_no_command_prints_help_and_where_to_begin():
    done = run_python(MAIN)
    assert done.returncode == 0 and "reconstruct" in done.stdout
    assert done.stdout.splitlines()[-1] == "To begin:  eitskin stream --device sim:swipe"


def test_python_m_eitskin():
    code = "import runpy, sys; sys.argv = ['eitskin', '--version']; "
    done = run_python(code + "runpy.run_module('eitskin', run_name='__main__')")
    assert done.stdout.startswith("eitskin ") and done.returncode == 0
