"""The page in three dimensions in Chromium, with WebGL in software: a skin round a cylinder and the
three skins of an arm. Pixels, the camera, presses, and the flat view beside it."""

import base64
import io
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from scipy.spatial import Delaunay
from served import Page, serving, until

from eitskin.model.eitm import save_model
from eitskin.page.server import PageServer
from eitskin.surface.flatten import flattened
from eitskin.surface.shapes import make_shape
from eitskin.surface.surface_map import SurfaceMap
from small_models import prebuilt

ARM = Path(__file__).resolve().parents[3] / "examples" / "robot" / "arm.urdf"
CYLINDER_MM = 60.0
PLACE = (-15.0, 30.0)
NEAR_MM = 3.0


def cylinder() -> SurfaceMap:
    """The paper's skin round a cylinder that stands on its end. It unrolls without distortion."""
    rings = [(0.0, 1)] + [(r, max(8, int(r))) for r in np.linspace(12.0, 97.0, 8)]
    flat = np.array(
        [(r * np.cos(a), r * np.sin(a)) for r, n in rings for a in 2 * np.pi * np.arange(n) / n]
    )
    triangles = Delaunay(flat).simplices
    (ax, ay), (bx, by) = ((flat[triangles[:, k]] - flat[triangles[:, 0]]).T for k in (1, 2))
    area = ax * by - ay * bx
    triangles = np.where((area < 0)[:, None], triangles[:, ::-1], triangles)[np.abs(area) > 1e-6]
    angle = flat[:, 0] / CYLINDER_MM
    round_mm = CYLINDER_MM * np.column_stack([np.cos(angle), np.sin(angle)])
    points_mm = np.column_stack([round_mm, flat[:, 1]])
    return SurfaceMap(flat, points_mm, triangles.astype(np.int64), "forearm")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path: Path = tmp_path_factory.mktemp("surface")
    x, y = PLACE
    (path / "one.toml").write_text(
        "[scene]\nframes = 12\nquiet_frames = 16\nelements = 2500\nrate_hz = 24.0\n"
        f"[[touch]]\nx_mm = {x}\ny_mm = {y}\nradius_mm = 9.0\n[effects.noise]\nsnr_db = 60.0\n"
    )
    save_model(path / "round.eitm", replace(prebuilt()[0], surface=cylinder()))
    return path


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    one = Page(tmp_path_factory.mktemp("chromium"), webgl=True)
    try:
        one.size(1200, 900)
        yield one
    finally:
        one.driver.quit()


@pytest.fixture(scope="module")
def server(folder) -> Iterator[PageServer]:
    with serving(f"sim:{folder}/one.toml?loop=1", model=folder / "round.eitm") as one:
        yield one


@pytest.fixture
def round_skin(server, page) -> Page:
    page.open(server)
    until(page.touches)
    return page


def pixels(page: Page) -> np.ndarray:
    """Return the image that WebGL has drawn, (rows, columns, 3)."""
    url = str(page.get("surface", "toDataURL()"))
    image = PIL.Image.open(io.BytesIO(base64.b64decode(url.split(",")[1])))
    return np.asarray(image.convert("RGB")).astype(int)


def red(drawn: np.ndarray) -> int:
    """How many pixels the image of a touch colours."""
    return int((drawn[..., 0] - drawn[..., 1] > 80).sum())


def mouse(page: Page, kind: str, x: float, y: float) -> None:
    """``x`` and ``y`` as parts of the canvas."""
    box = page.box("surface")
    x, y = box["left"] + x * box["width"], box["top"] + y * box["height"]
    more = {"deltaX": 0, "deltaY": -600} if kind == "mouseWheel" else {"button": "left"}
    page.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, clickCount=1, buttons=1, **more)


def drawn_part(drawn: np.ndarray) -> float:
    """The part of the canvas that is not the ground's white."""
    return float((drawn.sum(axis=2) < 755).mean())


def test_a_touch_is_where_the_surface_is(round_skin):
    """Its image colours the cylinder, an arrow of its colour presses, and its place is the one of
    the model's surface."""
    assert round_skin.shown("surface") and not round_skin.shown("skin")
    until(lambda: red(pixels(round_skin)) > 100)
    drawn = pixels(round_skin)
    assert 0.05 < drawn_part(drawn) < 0.6
    touch_id = int(round_skin.run("return document.querySelector('#touches tr').dataset.id"))
    shown = ["0072b2", "d55e00", "009e73", "cc79a7", "b8860b", "56b4e9", "7b4fa3"][
        (touch_id - 1) % 7
    ]
    arrow = np.abs(drawn - np.frombuffer(bytes.fromhex(shown), np.uint8)).max(axis=2) < 12
    assert arrow.sum() > 50
    assert np.abs(np.array(round_skin.touches()) - PLACE).max() < NEAR_MM
    assert "1 touch" in round_skin.get("surface", "ariaLabel")


def test_mouse_wheel_and_keys_move_the_camera(round_skin, server):
    until(lambda: red(pixels(round_skin)) > 100)
    before = pixels(round_skin)
    for kind, x in (("mousePressed", 0.03), ("mouseMoved", 0.3), ("mouseReleased", 0.3)):
        mouse(round_skin, kind, x, 0.05)
    until(lambda: np.abs(pixels(round_skin) - before).max(axis=2).mean() > 5)
    assert server.reader.live().device.transport.board.fingers == ()  # type: ignore[attr-defined]
    mouse(round_skin, "mouseWheel", 0.5, 0.5)
    until(lambda: drawn_part(pixels(round_skin)) > 1.4 * drawn_part(before))
    press_key = "document.getElementById('surface').dispatchEvent(new KeyboardEvent('keydown', {})"
    round_skin.run(press_key.format("{key: 'Home'}") + ")")
    until(lambda: abs(drawn_part(pixels(round_skin)) / drawn_part(before) - 1) < 0.1)
    facing = pixels(round_skin)
    for _ in range(24):
        round_skin.run(press_key.format("{key: 'ArrowLeft'}") + ")")
    until(lambda: red(pixels(round_skin)) < red(facing) / 2)  # the inner side is grey


def test_the_mouse_presses_the_surface(round_skin, server):
    board = server.reader.live().device.transport.board  # type: ignore[attr-defined]
    mouse(round_skin, "mousePressed", 0.5, 0.65)
    until(lambda: board.fingers)
    finger = board.fingers[0].x_mm, board.fingers[0].y_mm
    assert np.hypot(*np.subtract(finger, PLACE)) > 25

    def found() -> bool:
        places, expected = round_skin.touches(), sorted([PLACE, finger])
        return len(places) == 2 and float(np.abs(np.array(places) - expected).max()) < NEAR_MM

    until(found)
    mouse(round_skin, "mouseReleased", 0.5, 0.65)
    until(lambda: board.fingers == () and len(round_skin.touches()) == 1)


@pytest.fixture(scope="module")
def dome(folder, page) -> Iterator[PageServer]:
    """The paper's untouched skin over half a ball: a mm of the drawing corresponds to 1 to 2 mm."""
    points_mm, triangles = make_shape("hemisphere", 1500)
    flat_mm = flattened(points_mm, triangles)
    size = 97.0 / np.linalg.norm(flat_mm, axis=1).max()
    surface = SurfaceMap(size * flat_mm, size * points_mm, triangles, "head")
    assert surface.scale_range[1] > 1.8
    save_model(folder / "dome.eitm", replace(prebuilt()[0], surface=surface))
    (folder / "none.toml").write_text("[scene]\nframes = 12\nelements = 2500\nrate_hz = 24.0\n")
    with serving(f"sim:{folder}/none.toml?loop=1", model=folder / "dome.eitm") as one:
        yield one


def test_a_press_lands_under_the_pointer_where_the_drawing_is_distorted(dome, page):
    page.open(dome)
    until(lambda: page.shown("surface") and page.text("n-rate").endswith("Hz"))
    board = dome.reader.live().device.transport.board  # type: ignore[union-attr]
    pressed = []
    for x, y in ((0.5, 0.5), (0.42, 0.6), (0.6, 0.45)):
        until(lambda: red(pixels(page)) == 0)
        mouse(page, "mousePressed", x, y)
        until(lambda: board.fingers and red(pixels(page)) > 60)
        drawn = pixels(page)
        rows, columns = np.nonzero(drawn[..., 0] - drawn[..., 1] > 80)
        height, width = drawn.shape[:2]
        assert np.hypot(columns.mean() - x * width, rows.mean() - y * height) < 0.02 * width
        pressed.append((board.fingers[0].x_mm, board.fingers[0].y_mm))
        mouse(page, "mouseReleased", x, y)
        until(lambda: not board.fingers)
    assert min(np.hypot(*np.subtract(a, b)) for a, b in combinations(pressed, 2)) > 8


def test_the_flat_view_is_one_press_away(round_skin):
    round_skin.run("document.getElementById('flat').click()")
    until(lambda: round_skin.shown("skin") and not round_skin.shown("surface"))
    assert np.abs(np.array(round_skin.touches()) - PLACE).max() < NEAR_MM
    round_skin.run("document.getElementById('flat').click()")
    until(lambda: round_skin.shown("surface"))


def test_a_browser_without_webgl_shows_the_flat_view(server, page):
    script = "HTMLCanvasElement.prototype.getContext = (get => function (kind, how) {"
    script += "return kind === 'webgl' ? null : get.call(this, kind, how)"
    script += "})(HTMLCanvasElement.prototype.getContext)"
    added = page.command("Page.addScriptToEvaluateOnNewDocument", source=script)
    try:
        page.open(server)
        until(page.touches)
        assert page.shown("skin") and not page.shown("surface") and not page.shown("flat")
    finally:
        page.command("Page.removeScriptToEvaluateOnNewDocument", **added)


def test_three_skins_of_an_arm(page):
    """All of them are drawn; touches name their skin; numbers are those of the chosen one."""
    with serving(f"robot:{ARM}?loop=1") as server:
        page.open(server)
        until(lambda: page.get("which", "options.length") == 3)
        until(lambda: red(pixels(page)) > 60)
        rows = "[...document.querySelectorAll('#touches tr')]"
        column = f"return {rows}.map(row => row.children[1].textContent)"
        until(lambda: len(set(page.run(column))) >= 2)
        assert set(page.run(column)) <= {"upper_arm", "forearm", "palm"}
        page.choose("which", "palm")
        until(lambda: page.text("n-rate").endswith("Hz"))
        page.run("document.getElementById('flat').click()")
        until(lambda: page.shown("skin"))
        wrong = [one["message"] for one in page.driver.get_log("browser")]
        assert [text for text in wrong if "Error" in text and "net::" not in text] == []
