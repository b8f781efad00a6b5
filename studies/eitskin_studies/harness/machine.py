"""The line that says where numbers were measured."""

import platform

import numpy as np


def machine() -> str:
    """Processor and Python, for a benchmark's first line."""
    return (
        f"{platform.machine()} {platform.system()}, Python {platform.python_version()}, numpy"
        f" {np.__version__}"
    )
