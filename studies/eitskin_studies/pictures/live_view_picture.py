"""The live page before the emulated board, as a moving picture."""

import base64
import io
import time
from pathlib import Path
from typing import Any

from eitskin.errors import DeviceError
from eitskin.fileio import write_bytes
from eitskin_studies.harness.live_page import browser, need_browser, served_page

URL = "emu:rotate"
WIDTH, HEIGHT = 1120, 772
FRAME_MS = 130  # shown at half of real time
FIRST, LAST = 8, 48  # of the scene's frames
QUALITY = 70
PATIENCE_S = 180.0


def draw_live_view(path: Path) -> None:
    """Record the page of the emulated board frame by frame, as a WebP file.

    Raises:
        MissingExtraError: selenium is not installed.
        DeviceError: the board did not get as far.
        FileError: the file cannot be written.
    """
    need_browser()
    from PIL import Image

    with served_page(URL) as (_, address), browser(address) as page:
        page.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False},
        )
        page.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})
        shots = [Image.open(io.BytesIO(data)).convert("RGB") for data in _shots(page)]
    buffer = io.BytesIO()
    shots[0].save(
        buffer,
        "WEBP",
        save_all=True,
        append_images=shots[1:],
        duration=FRAME_MS,
        loop=0,
        quality=QUALITY,
        method=6,
        minimize_size=True,
    )
    write_bytes(path, buffer.getvalue())


def _shots(page: Any) -> list[bytes]:
    """A picture of each frame that shows touches."""
    shots: list[bytes] = []
    shown, give_up = -1, time.monotonic() + PATIENCE_S
    while shown < LAST:
        if time.monotonic() > give_up:
            raise DeviceError(f"{URL}: the page did not get to frame {LAST} of the scene")
        text = page.find_element("id", "n-time").text.removesuffix(" s")
        frame = round(20 * float(text)) if text[:1].isdigit() else -1
        if frame <= shown or frame < FIRST:
            time.sleep(0.02)
            continue
        shown = frame + 1
        shots.append(base64.b64decode(page.execute_cdp_cmd("Page.captureScreenshot", {})["data"]))
        if page.find_element("id", "state").text == "over":
            break
    return shots
