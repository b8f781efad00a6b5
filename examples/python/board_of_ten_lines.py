"""A board in ten lines: frames as lines of text, on a pseudo-terminal in place of a USB port.

    python board_of_ten_lines.py
    eitskin stream --device "text:/dev/pts/N?layout=board_of_ten_lines.toml"

A skin that is untouched for three seconds, then touched for one, again and again.
"""

import itertools
import os
import pty
import time
import tty

import numpy as np

from eitskin.model.prebuilt import load_prebuilt

golden, rng = load_prebuilt()[0].golden, np.random.default_rng(1)
board, port = pty.openpty()
tty.setraw(port)
print(os.ttyname(port), flush=True)
for number in itertools.count():
    volts = golden.frame_v if number % 200 >= 150 else golden.reference_v
    millivolts = 1e3 * volts * rng.normal(1.0, 1e-4, len(volts))
    line = f"frame {number}: " + ",".join(f"{v:.5f}" for v in millivolts) + "\r\n"
    os.write(board, line.encode())
    time.sleep(0.02)
