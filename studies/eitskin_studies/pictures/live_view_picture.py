"""The live page before a simulated skin, as a moving picture.

The page is photographed while the scene passes slowly, and shown at the scene's own speed. The
clock by which the page counts what it draws passes as slowly, so its rates are those of the film.
"""

import base64
import io
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

from eitskin.errors import DeviceError
from eitskin.fileio import write_bytes
from eitskin_studies.harness.live_page import browser, need_browser, served_page

SPEED = 0.1  # of the scene while it is photographed
URL = f"sim:play?speed={SPEED}"
SLOW_CLOCK = (
    f"const now = performance.now.bind(performance); performance.now = () => {SPEED} * now();"
)
WIDTH, HEIGHT = 1120, 772
RATE_HZ = 24.0  # of the scene
SHOWN_EVERY = 2  # frames of the scene
FIRST, LAST = 4, 188  # of the scene's frames
QUALITY = 60
PATIENCE_S = 300.0


def draw_live_view(path: Path) -> None:
    """Record the page of the simulated skin frame by frame, as a WebP file.

    Raises:
        MissingExtraError: selenium is not installed.
        DeviceError: the scene did not get as far.
        FileError: the file cannot be written.
    """
    need_browser()
    from PIL import Image

    with served_page(URL) as (_, address), browser(address, SLOW_CLOCK) as page:
        page.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False},
        )
        page.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})
        taken = _shots(page)
    shots = [Image.open(io.BytesIO(data)).convert("RGB") for _, data in taken]
    frames = [frame for frame, _ in taken]
    steps = [after - frame for frame, after in pairwise(frames)]
    buffer = io.BytesIO()
    shots[0].save(
        buffer,
        "WEBP",
        save_all=True,
        append_images=shots[1:],
        duration=[round(1e3 * step / RATE_HZ) for step in [*steps, SHOWN_EVERY]],
        loop=0,
        quality=QUALITY,
        method=6,
        minimize_size=True,
    )
    write_bytes(path, buffer.getvalue())


def _shots(page: Any) -> list[tuple[int, bytes]]:
    """Pictures of about every ``SHOWN_EVERY``-th frame of the scene, with their numbers."""
    shots: list[tuple[int, bytes]] = []
    wanted, give_up = FIRST, time.monotonic() + PATIENCE_S
    while wanted <= LAST:
        if time.monotonic() > give_up:
            raise DeviceError(f"{URL}: the page did not get to frame {LAST} of the scene")
        text = page.find_element("id", "n-time").text.removesuffix(" s")
        frame = round(RATE_HZ * float(text)) if text[:1].isdigit() else -1
        if frame < wanted:
            if page.find_element("id", "state").text == "over":
                break
            time.sleep(0.02)
            continue
        wanted = frame + SHOWN_EVERY
        picture = page.execute_cdp_cmd("Page.captureScreenshot", {})["data"]
        shots.append((frame, base64.b64decode(picture)))
    return shots
