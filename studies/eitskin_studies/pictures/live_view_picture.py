"""The live page before a simulated skin, as a moving picture, and before a robot.

For the moving picture the page is photographed while the scene passes slowly, and shown at the
scene's own speed. The clock by which the page counts what it draws passes as slowly, so its rates
are those of the film.
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
ROBOT_URL = "robot:examples/robot/arm.urdf?loop=1"  # in a checkout
ROBOT_TIME_S = 5.0


def draw_live_view(path: Path) -> None:
    """Record the page of the simulated skin frame by frame, as a WebP file.

    Raises:
        MissingExtraError: selenium is not installed.
        DeviceError: the scene did not get as far.
        FileError: the file cannot be written.
    """
    need_browser()
    with served_page(URL) as (_, address), browser(address, SLOW_CLOCK) as page:
        _set_size(page)
        taken = _shots(page)
    frames = [frame for frame, _ in taken]
    steps = [after - frame for frame, after in pairwise(frames)]
    durations_ms = [round(1e3 * step / RATE_HZ) for step in [*steps, SHOWN_EVERY]]
    _write(path, [picture for _, picture in taken], durations_ms)


def draw_live_robot(path: Path) -> None:
    """Write one picture of the page of a robot with three skins. Errors are those of
    ``draw_live_view``."""
    need_browser()
    with served_page(ROBOT_URL) as (_, address), browser(address) as page:
        _set_size(page)
        wait = time.monotonic() + PATIENCE_S
        while _time_s(page) < ROBOT_TIME_S:
            if time.monotonic() > wait:
                raise DeviceError(f"{ROBOT_URL}: the page did not get to {ROBOT_TIME_S} s")
            time.sleep(0.02)
        _write(path, [_shot(page)], [1000])


def _set_size(page: Any) -> None:
    page.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False},
    )
    page.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})


def _write(path: Path, pictures: list[bytes], durations_ms: list[int]) -> None:
    from PIL import Image

    shots = [Image.open(io.BytesIO(data)).convert("RGB") for data in pictures]
    buffer = io.BytesIO()
    shots[0].save(
        buffer,
        "WEBP",
        save_all=True,
        append_images=shots[1:],
        duration=durations_ms,
        loop=0,
        quality=QUALITY,
        method=6,
        minimize_size=True,
    )
    write_bytes(path, buffer.getvalue())


def _time_s(page: Any) -> float:
    """The time of the newest frame that the page shows; -1 before the first one."""
    text = page.find_element("id", "n-time").text.removesuffix(" s")
    return float(text) if text[:1].isdigit() else -1.0


def _shot(page: Any) -> bytes:
    return base64.b64decode(page.execute_cdp_cmd("Page.captureScreenshot", {})["data"])


def _shots(page: Any) -> list[tuple[int, bytes]]:
    """Pictures of about every ``SHOWN_EVERY``-th frame of the scene, with their numbers."""
    shots: list[tuple[int, bytes]] = []
    wanted, give_up = FIRST, time.monotonic() + PATIENCE_S
    while wanted <= LAST:
        if time.monotonic() > give_up:
            raise DeviceError(f"{URL}: the page did not get to frame {LAST} of the scene")
        frame = round(RATE_HZ * _time_s(page))
        if frame < wanted:
            if page.find_element("id", "state").text == "over":
                break
            time.sleep(0.02)
            continue
        wanted = frame + SHOWN_EVERY
        shots.append((frame, _shot(page)))
    return shots
