"""The notebooks are stored without results; ``studies/test`` runs them."""

import json
from pathlib import Path

import pytest

from eitskin import load_model

NOTEBOOKS = sorted((Path(__file__).parents[3] / "docs" / "notebooks").glob("*.ipynb"))


def test_there_are_notebooks() -> None:
    assert len(NOTEBOOKS) >= 6


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda one: one.stem)
def test_a_notebook_is_stored_without_results(path: Path) -> None:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)


def test_the_mathematics_has_the_defaults_of_the_prebuilt_model() -> None:
    [path] = [one for one in NOTEBOOKS if one.stem == "from_skin_to_touch"]
    text = path.read_text(encoding="utf-8")
    defaults = load_model().defaults
    for value, name in (
        (defaults.lambda_rel, r"\\, \\lambda_{max}"),
        (defaults.lambda_noise_factor, r"\\, \\lambda_{noise}"),
        (defaults.detection_factor, r"\\, \\lambda_{noise}"),
    ):
        assert f"{value:g}{name}".removeprefix("0") in text
