"""The live page before a simulated skin, as a moving picture, and before a robot.

For the moving picture the scene is stepped frame by frame, and the page's clock with it: however
long the photographs take, what is shown, rates included, is what passes at the scene's own speed.
"""

import base64
import io
import time
from pathlib import Path
from typing import Any

from eitskin.errors import DeviceError
from eitskin.fileio import write_bytes
from eitskin_studies.harness.live_page import browser, need_browser, served_page

URL = "sim:play?speed=0.1"  # it is paused as soon as it shows a frame
FILM_CLOCK = "window.filmMs = 0; performance.now = () => window.filmMs;"
WIDTH, HEIGHT = 1120, 772
RATE_HZ = 24.0  # of the scene
SHOWN_EVERY = 3  # frames of the scene
LAST = 190  # of the scene's frames
QUALITY = 45
PATIENCE_S = 60.0  # until the page shows what is waited for
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
    with served_page(URL) as (_, address), browser(address, FILM_CLOCK) as page:
        _set_size(page)
        taken = _shots(page)
    _write(path, taken, round(1e3 * SHOWN_EVERY / RATE_HZ))


def draw_live_robot(path: Path) -> None:
    """Write one picture of the page of a robot with three skins. Errors are those of
    ``draw_live_view``."""
    need_browser()
    with served_page(ROBOT_URL) as (_, address), browser(address, webgl=True) as page:
        _set_size(page)
        _wait_for(page, ROBOT_TIME_S)
        _write(path, [_shot(page)], 1000)


def _set_size(page: Any) -> None:
    page.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False},
    )
    page.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})


def _write(path: Path, pictures: list[bytes], duration_ms: int) -> None:
    from PIL import Image

    shots = [Image.open(io.BytesIO(data)).convert("RGB") for data in pictures]
    buffer = io.BytesIO()
    shots[0].save(
        buffer,
        "WEBP",
        save_all=True,
        append_images=shots[1:],
        duration=duration_ms,
        loop=0,
        quality=QUALITY,
        method=4,
        minimize_size=True,
    )
    write_bytes(path, buffer.getvalue())


def _time_s(page: Any) -> float:
    """The time of the newest frame that the page shows; -1 before the first one."""
    text = page.find_element("id", "n-time").text.removesuffix(" s")
    return float(text) if text[:1].isdigit() else -1.0


def _shot(page: Any) -> bytes:
    return base64.b64decode(page.execute_cdp_cmd("Page.captureScreenshot", {})["data"])


def _wait_for(page: Any, time_s: float) -> float:
    """Wait until the page shows a frame of ``time_s`` or later, and return its time."""
    give_up = time.monotonic() + PATIENCE_S
    while (shown_s := _time_s(page)) < time_s - 0.01:
        if time.monotonic() > give_up:
            raise DeviceError(f"the page does not show a frame of {time_s:.2f} s")
        time.sleep(0.005)
    return shown_s


def _shots(page: Any) -> list[bytes]:
    """Pictures of every ``SHOWN_EVERY``-th frame of the scene, from the first that is shown."""
    first_s = _wait_for(page, 0.0)
    page.execute_script("document.getElementById('play').click()")
    time.sleep(0.5)  # what is on its way comes
    first, shots = round(RATE_HZ * max(first_s, _time_s(page))), []
    for frame in range(first + 1, LAST + 1):
        page.execute_script(
            f"window.filmMs = {1e3 * frame / RATE_HZ};document.getElementById('step').click()"
        )
        _wait_for(page, frame / RATE_HZ)
        if frame % SHOWN_EVERY == 0:
            page.execute_script("document.getElementById('answer').textContent = ''")
            shots.append(_shot(page))
    return shots
