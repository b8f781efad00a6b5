"""Builds for the Cortex-M7, as the preset of that name makes them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("arm-none-eabi-gcc", "qemu-system-arm", "cmake", "ninja")


def build_cortex_m7(source: Path, build: Path, *targets: str) -> Path:
    """Configure and build the checkout at ``source`` in the folder ``build``, which is returned; without ``targets``, all."""
    absent = [tool for tool in TOOLS if shutil.which(tool) is None]
    assert not absent, f"missing {', '.join(absent)}: scripts/test installs them"
    toolchain = source / "cmake" / "arm-cortex-m7.cmake"
    configure = ["cmake", "-S", str(source), "-B", str(build), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"]
    configure += [f"-DCMAKE_TOOLCHAIN_FILE={toolchain}", "-DEITSKIN_TESTS=OFF"]
    chosen = [word for target in targets for word in ("--target", target)]
    for command in (configure, ["cmake", "--build", str(build), *chosen]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning:" not in done.stdout + done.stderr, done.stdout + done.stderr
    return build
