"""Builds for the Cortex-M7, as the preset of that name makes them."""

from pathlib import Path

from filelock import FileLock

from eitskin_emulator.core_on_qemu import build_cortex_m7

__all__ = ["ROOT", "build_cortex_m7", "shared_build"]

ROOT = Path(__file__).resolve().parents[2]


def shared_build() -> Path:
    """``build/cortex-m7`` brought up to date: one for all tests, whichever process asks first."""
    (ROOT / "build").mkdir(exist_ok=True)
    with FileLock(ROOT / "build" / "cortex-m7.lock"):
        return build_cortex_m7(ROOT, ROOT / "build" / "cortex-m7")
