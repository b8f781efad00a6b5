"""The command ``eitskin surface``, and ``model build`` on a surface."""

import json

import pytest

from eitskin.cli.main import main
from eitskin.model.eitm import load_model


@pytest.fixture
def arm(tmp_path, capsys):
    mesh = tmp_path / "arm.obj"
    assert main(["surface", "make", "forearm", "--triangles", "800", "-o", str(mesh)]) == 0
    assert "800 triangles" in capsys.readouterr().out
    skin = tmp_path / "arm.toml"
    skin.write_text('[skin]\nsurface = "arm.obj"\nlink = "arm"\n')
    return skin


def test_a_skin_on_a_surface_is_described_and_drawn(arm, tmp_path, capsys):
    picture = tmp_path / "arm.png"
    assert main(["surface", "show", str(arm), "--picture", str(picture), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["link"] == "arm" and facts["triangles"] == 800 and facts["electrodes"] == 16
    assert facts["scale_min"] < 1 < facts["scale_max"] and facts["angle_error"] < 1.05
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("dome --length-mm 50", "'dome' has no length_mm; measures of it: radius_mm, angle_deg"),
        ("saddle --radius-mm 50", "'saddle' has no radius_mm; measures of it: none"),
        ("tube --angle-deg 360", "angle_deg 360 is out of range; use 10 to 350"),
        ("tube --radius-mm nan", "radius_mm nan is out of range"),
    ],
)
def test_measures_that_a_shape_does_not_have_are_refused(tmp_path, capsys, options, message):
    mesh = tmp_path / "mesh.obj"
    assert main(["surface", "make", *options.split(), "-o", str(mesh)]) != 0
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not mesh.exists()


def test_a_model_of_a_surface_is_built(arm, tmp_path, capsys):
    model = tmp_path / "arm.eitm"
    assert main(["model", "build", str(arm), "-o", str(model), "--samples", "0"]) == 0
    surface = load_model(model)[0].surface
    assert surface is not None and surface.link == "arm" and len(surface.triangles) == 800
    capsys.readouterr()
    assert main(["model", "verify", str(model)]) == 0
