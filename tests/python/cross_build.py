"""Builds for the Cortex-M7, as the preset of that name makes them."""

from __future__ import annotations

from pathlib import Path

from eitskin_studies.harness.emulated import build_cortex_m7

__all__ = ["ROOT", "build_cortex_m7"]

ROOT = Path(__file__).resolve().parents[2]
