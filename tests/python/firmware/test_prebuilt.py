"""The image that ships is what the source builds: byte for byte with the compiler that made it, by
its sources with any."""

import hashlib
import json
import shutil
import subprocess

import pytest

from cross_build import ROOT
from eitskin.errors import FileError
from eitskin.firmware import prebuilt
from eitskin.firmware.prebuilt import (
    IMAGE,
    MANIFEST,
    SOURCES,
    Manifest,
    hash_of_sources,
    load_image,
    ship,
)

REMEDY = "run  scripts/firmware --prebuilt  and commit what it changes"


def compiler() -> str:
    return subprocess.run(
        ["arm-none-eabi-gcc", "-dumpfullversion"], capture_output=True, text=True, check=True
    ).stdout.strip()


def test_it_is_what_the_source_builds(cortex_m7):
    folder = ROOT / "python" / "eitskin" / "firmware"
    manifest = Manifest(**json.loads((folder / MANIFEST).read_text(encoding="utf-8")))
    image = (folder / IMAGE).read_bytes()
    assert hashlib.sha256(image).hexdigest() == manifest.image_sha256, REMEDY
    assert hash_of_sources(ROOT) == manifest.sources_sha256, (
        f"the sources have changed since: {REMEDY}"
    )
    built = (cortex_m7 / "firmware" / f"eitskin_{IMAGE}").read_bytes()
    if compiler() == manifest.compiler:
        assert built == image, REMEDY
    else:
        print(
            f"built by {manifest.compiler}, here is {compiler()}: judged by its sources,"
            f" {len(built)} and {len(image)} bytes"
        )


def test_the_installed_one_is_the_same():
    image, manifest = load_image()
    assert image == (ROOT / "python" / "eitskin" / "firmware" / IMAGE).read_bytes()
    assert len(image) == manifest.image_bytes


def test_ship_writes_both_and_a_changed_source_shows(tmp_path):
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tmp_path / name)
    (tmp_path / "python" / "eitskin" / "firmware").mkdir(parents=True)
    (tmp_path / "image.bin").write_bytes(b"\x00\x20")
    manifest = ship(tmp_path, tmp_path / "image.bin", "1.2.3")
    assert manifest == Manifest(
        "1.2.3", hash_of_sources(ROOT), hashlib.sha256(b"\x00\x20").hexdigest(), 2
    )
    with (tmp_path / "csrc" / "src" / "solve.c").open("a") as source:
        source.write("\n")
    assert hash_of_sources(tmp_path) != manifest.sources_sha256


@pytest.mark.parametrize("damage", ["image", "manifest", "absent"])
def test_a_damaged_installation_is_refused(damage, tmp_path, monkeypatch):
    image, _ = load_image()
    folder = ROOT / "python" / "eitskin" / "firmware"
    manifest = (folder / MANIFEST).read_text(encoding="utf-8")
    if damage != "absent":
        (tmp_path / IMAGE).write_bytes(image[:-1] if damage == "image" else image)
        (tmp_path / MANIFEST).write_text(manifest if damage == "image" else "{}")
    monkeypatch.setattr(prebuilt.resources, "files", lambda package: tmp_path)
    with pytest.raises(FileError, match="install eitskin again"):
        load_image()
