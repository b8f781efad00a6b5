"""Firmware with one bug each, built and run: the check that is meant for it fails. The sources as
they are pass them all."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from firmware_checks import CHECKS, run_session, table_after_upload

from cross_build import ROOT, build_cortex_m7
from eitskin.config import load_toml
from emulated import IMAGE
from small_models import small_blob

pytestmark = pytest.mark.long(
    "studies/mutate has mutants of the firmware; test_emulated_board.py checks the image"
)

COPIED = (
    "csrc", "firmware", "cmake", "tests/emulated", "tests/soak", "CMakeLists.txt",
    "CMakePresets.json",
)  # fmt: skip
TARGET = "eitskin_nucleo_f767zi"


MUTATIONS: dict[str, dict[str, Any]] = load_toml(
    Path(__file__).with_name("mutations.toml"), "firmware with one bug each"
)
STALE_TABLE = MUTATIONS.pop("stale table")


class Workshop:
    """A copy of the sources with a build; mutants are built in it one at a time."""

    def __init__(self, folder: Path) -> None:
        self.source, self.build = folder / "source", folder / "build"
        for name in COPIED:
            (self.source / name).parent.mkdir(parents=True, exist_ok=True)
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, self.source / name)
        build_cortex_m7(self.source, self.build, TARGET)
        self.unmutated = (self.build / IMAGE).read_bytes()

    def mutant(self, mutation: dict[str, Any]) -> bytes:
        """The image of the sources with ``mutation``, which is undone again."""
        path = self.source / mutation["file"]
        original = text = path.read_text()
        for old, new in mutation["replaced"]:
            assert text.count(old) == 1, (
                f"{path.name}: {old!r} is there {text.count(old)} times: bring the mutation up"
                " to date"
            )
            text = text.replace(old, new)
        try:
            path.write_text(text)
            done = subprocess.run(
                ["cmake", "--build", self.build, "--target", TARGET],
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stdout
            image = (self.build / IMAGE).read_bytes()
        finally:
            path.write_text(original)
        assert image != self.unmutated, "the mutation is not in the image"
        return image


@pytest.fixture(scope="module")
def workshop(tmp_path_factory) -> Workshop:
    return Workshop(tmp_path_factory.mktemp("mutants"))


@pytest.mark.parametrize("name", MUTATIONS)
def test_a_mutant_is_noticed(workshop, name):
    mutation = MUTATIONS[name]
    session = run_session(workshop.mutant(mutation))
    found = {
        check.__name__: reported for check in CHECKS if (reported := check(session)) is not None
    }
    print(f"{name}: {found}")
    assert mutation["noticed_by"] in found


def test_a_stale_protocol_table_is_noticed(workshop):
    model = small_blob(kind="skip")
    assert table_after_upload(workshop.unmutated, model) is None
    reported = table_after_upload(workshop.mutant(STALE_TABLE), model)
    assert reported is not None
    assert reported.startswith("row 0 is") or "never joined" in reported or "is (" in reported
