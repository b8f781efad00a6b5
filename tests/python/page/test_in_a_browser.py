"""The page in Chromium shows what the device sends, and its buttons work. All tests share one
browser."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from served import ALL, TOKEN, Page, serving, until

from board_on_a_port import Wire
from eitskin.core.gestures import Zone
from eitskin.device import ports as ports_module
from eitskin.device.bank import BANK_BYTES, ERASED, bank_bytes
from eitskin.device.ports import Port
from eitskin.device.simulated import SimBoard
from eitskin.device.wire.link_table import Stream
from eitskin.model.prebuilt import load_prebuilt
from eitskin.page.server import PageServer
from eitskin.page.teacher import Teacher
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.description import load_scene
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.teaching.plan import plan_places
from eitskin.teaching.practice import practice_scene
from eitskin.teaching.presses import load_presses
from eitskin.truth import observe_scene

PLACES = [(-40.0, 10.0), (30.0, -20.0)]
NEAR_MM = 3.0
EMPTY = bytes([ERASED]) * BANK_BYTES


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    """Two touches that stay."""
    path: Path = tmp_path_factory.mktemp("scene") / "two.toml"
    touches = "".join(f"[[touch]]\nx_mm = {x}\ny_mm = {y}\nradius_mm = 9.0\n" for x, y in PLACES)
    path.write_text(
        "[scene]\nframes = 12\nquiet_frames = 16\nelements = 2500\nrate_hz = 48.0\n"
        f"{touches}[effects.noise]\nsnr_db = 60.0\n"
    )
    return path


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    one = Page(tmp_path_factory.mktemp("chromium"))
    try:
        yield one
    finally:
        one.driver.quit()


@pytest.fixture(scope="module")
def server(scene, tmp_path_factory) -> Iterator[PageServer]:
    """A simulated board before the scene, again and again."""
    folder = tmp_path_factory.mktemp("recordings")
    with serving(f"sim:{scene}?loop=1", folder=folder) as one:
        yield one


@pytest.fixture
def live(server, page) -> Page:
    """The simulated board's page, playing."""
    server.reader.live().pacer.play()
    page.size(1200, 900)
    page.open(server)
    until(page.touches)
    return page


def are_near(touches: Sequence[Sequence[float]]) -> bool:
    return len(touches) == 2 and bool(np.abs(np.array(touches) - PLACES).max() < NEAR_MM)


def assert_shown(page: Page) -> None:
    """Both touches in the table, in the words, and in the image's colours: at once or after the
    frame in which they land, since the scene begins again and again."""
    until(lambda: are_near(page.touches()))
    assert page.text("n-latency")
    name = page.get("skin", "ariaLabel")
    assert "2 touches" in name


def red(page: Page, x_mm: float, y_mm: float) -> int:
    """Return how much redder than green the skin is drawn there, beside the mark of a touch's
    middle."""
    return int(
        page.run(
            "const c = document.getElementById('skin'), w = c.clientWidth, h = c.clientHeight;"
            "const s = Math.min(w - 52, h - 52) / 194, r = c.width / w;"
            f"const x = w / 2 + ({x_mm} + 5) * s, y = h / 2 - ({y_mm}) * s;"
            "const p = c.getContext('2d').getImageData(x * r, y * r, 1, 1).data;"
            "return p[0] - p[1]"
        )
    )


def test_simulated(live):
    assert_shown(live)
    until(lambda: min(red(live, *place) for place in PLACES) > 40)
    until(lambda: red(live, -20.0, -60.0) < 25)
    assert "16 electrodes" in live.text("device")
    assert live.get("electrodes", "children.length") == 16
    assert live.text("found") == "nothing found wrong"
    until(lambda: "touches" in live.text("words"))
    until(lambda: "from the reference" in live.get("volts", "ariaLabel"))
    until(lambda: live.text("n-rate").endswith("Hz"))


def test_recorded(scene, page, tmp_path):
    settings = SessionSettings(ALL, record=tmp_path / "run.eits")
    with Session(f"sim:{scene}", settings, observe=observe_scene) as session:
        count = sum(1 for _ in session.messages())
    with serving(f"file:{tmp_path}/run.eits") as server:
        page.open(server)
        until(lambda: page.text("state") == "over")
        assert_shown(page)
        assert page.text("n-frame").isdigit()
        assert server.reader.frames == count
        assert page.get("tare", "disabled")
        page.open(server)  # a page that comes later sees the last frame
        assert_shown(page)
        until(lambda: page.text("play") == "Start again")
        page.click("play")
        assert page.answer() == "starting again"
        until(lambda: server.reader.frames == 2 * count)


def test_a_recording_has_a_timeline_and_can_be_saved(scene, page, tmp_path):
    """Forwards while it plays, back from its end; the bytes that are saved are the recording's."""
    path, saved = tmp_path / "run.eits", tmp_path / "saved"
    with Session(f"sim:{scene}?loop=1", SessionSettings(ALL, frames=96, record=path)) as session:
        for _ in session.messages():
            pass
    with serving(f"file:{path}", speed=0.01) as server:
        page.open(server)
        server.reader.live().pacer.set_speed(1.0)  # it has not played to its end meanwhile
        until(lambda: page.shown("timeline"))
        length_s = float(page.get("at", "max"))
        assert length_s == pytest.approx(95 / 48, abs=0.01)
        page.choose("at", "1.5")
        assert page.answer() == "from 1.5 s"
        until(lambda: float(page.text("n-time").split()[0]) >= 1.5)
        assert server.reader.frames < 70
        until(lambda: page.text("state") == "over")
        page.choose("at", "1.9")
        assert page.answer() == "from 1.9 s"
        until(lambda: page.text("state") == "over" and page.text("n-time") == f"{length_s:.2f} s")
        until(lambda: page.text("at-text") == f"{length_s:.1f} of {length_s:.1f} s")
        page.command("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(saved))
        page.click("download")
        until(lambda: page.text("answer") == "saved run.eits")
        until(lambda: (saved / "run.eits").exists())
        assert (saved / "run.eits").read_bytes() == path.read_bytes()


def test_lines_of_an_instrument(scene, page, tmp_path):
    rows = BoardFrames(load_scene(scene)).voltage_v(adjacent(16))
    text = "\n".join(",".join(map(repr, row)) for row in rows.tolist())
    (tmp_path / "lines.csv").write_text(text)
    (tmp_path / "layout.toml").write_text("[lines]\ncells = 208\n[port]\nrate_hz = 50\n")
    url = f"text:{tmp_path}/lines.csv?layout={tmp_path}/layout.toml"
    with serving(url) as server:
        page.open(server)
        until(lambda: page.text("state") == "over")
        assert_shown(page)
        assert server.reader.frames == 12


def test_gestures_and_zones(page):
    zones = (Zone("middle", outer_mm=60.0), Zone("far", x_mm=80.0, outer_mm=5.0))
    with serving("sim:tap?loop=1", ALL, zones=zones) as server:
        page.open(server)
        until(lambda: "tap" in page.text("gestures") and "middle" in page.text("gestures"))
        assert "far" not in page.text("gestures")


def one_frame(server: PageServer) -> None:
    """Let a paused scene go on by one frame."""
    before = server.reader.frames
    server.reader.live().pacer.step()
    until(lambda: server.reader.frames > before)


def test_teaching_press_by_press(page, tmp_path):
    """A finger presses where the plan says; the presses become a model that the board then has.
    The scene waits until the page is open, and again where the page must say "hold still"."""
    skin, scene, presses = paper_skin(), tmp_path / "practice.toml", tmp_path / "presses.npz"
    plan = plan_places(skin, adjacent(16), 6)
    text = practice_scene(skin, Path("none"), plan)
    scene.write_text(text.replace('skin = "none"\n', ""), encoding="utf-8")
    teacher = Teacher(plan, presses)
    with serving(f"sim:{scene}?loop=1", Stream.RAW, teacher=teacher, speed=0.01) as server:
        pacer = server.reader.live().pacer
        pacer.pause()
        page.open(server)
        while teacher.facts()["step"] != "hold" and server.reader.frames < 60:
            one_frame(server)
        until(lambda: "hold still" in page.text("teach-text"))
        pacer.set_speed(3.0)
        pacer.play()
        until(lambda: page.text("teach-text") == "all places are done")
        assert page.text("teach-count") == "6 of 6 presses"
        taken = load_presses(presses)
        assert np.abs(taken.place_mm - plan.place_mm).max() < 0.01
        page.click("teach-fit")
        answer = page.answer()
        assert answer.startswith("presses.eitm: 6 presses") and "is in use" in answer
        known = server.reader.live().known
        assert known is not None and known.model.precision is not None
        page.click("teach-back")
        assert page.answer() == "place 6 again; leave the skin untouched"
        until(lambda: page.text("teach-count").startswith("5 of 6 presses"))


def test_pause_step_play_and_speed(live, server):
    live.click("play")
    assert live.answer() == "paused"
    until(lambda: live.text("play") == "Play")
    before = server.reader.frames
    live.click("step")
    assert live.answer() == "one frame"
    until(lambda: server.reader.frames == before + 1)
    live.choose("speed", "2")
    assert live.answer().startswith("speed 2")
    assert server.reader.live().pacer.speed == 2.0
    live.choose("speed", "1")
    assert server.reader.frames == before + 1
    live.run("document.body.dispatchEvent(new KeyboardEvent('keydown', {key: ' ', bubbles: true}))")
    until(lambda: server.reader.frames > before + 3)


def test_tare_solver_and_mode(live, server):
    session = server.reader.live()
    live.click("tare")
    assert "touches the skin at" in live.answer()
    live.click("tare")  # the touches are in the reference then
    assert live.answer() == "reference taken from 16 frames"
    until(lambda: not live.touches())
    live.click("undo")
    assert live.answer() == "the reference before the last tare is back"
    until(lambda: live.touches() and live.get("undo", "hidden"))
    assert not live.shown("sign")
    live.run("document.getElementById('expert').open = true")
    assert live.shown("sign")
    live.choose("sign", "decrease")
    assert live.answer() == "solver: sign decrease"
    until(lambda: not live.touches())  # they are increases
    live.choose("sign", "increase")
    assert live.answer() == "solver: sign increase"
    live.choose("iterations", "30")
    assert live.answer() == "solver: iterations 30"
    assert session.solver is not None
    assert session.solver.iterations == 30
    live.choose("iterations", "0")
    assert "cannot be" in live.answer()
    live.choose("preset", "fast")
    until(lambda: live.answer().startswith("preset fast is in use"))
    assert session.device.board.samples == 20
    live.run("document.querySelector('#mode input[value=raw]').click()")
    assert live.answer() == "streaming touches, image"
    until(lambda: "No raw" in live.get("volts", "ariaLabel"))
    live.run("document.querySelector('#mode input[value=raw]').click()")
    assert live.answer() == "streaming touches, image, raw"
    until(lambda: "raw voltages" in live.get("volts", "ariaLabel"))
    begin_again(server)


def more_frames(server: PageServer) -> None:
    """They go on."""
    before = server.reader.frames
    until(lambda: server.reader.frames > before + 3)


def begin_again(server: PageServer) -> None:
    """The board switched off and on, and its reference taken before the scene."""
    session = server.reader.live()
    session.stop()
    until(lambda: server.reader.state == "ended")
    server.reader.again()
    until(lambda: server.reader.session not in (None, session))


def test_record(live, server):
    live.click("record")
    name = live.answer().removeprefix("recording to ")
    until(lambda: live.text("record-text") == "Stop recording")
    more_frames(server)
    live.click("record")
    assert live.answer().endswith(name)
    until(lambda: live.text("record-text") == "Record")
    assert live.shown("download")
    with Session(f"file:{server.reader.folder / name}", SessionSettings(ALL)) as session:
        assert sum(1 for _ in session.messages()) > 2


def test_a_model_is_uploaded(live, server, tmp_path):
    box = live.driver.find_element("id", "model")
    (tmp_path / "bad.eitm").write_bytes(b"no model")
    live.run("document.getElementById('answer').textContent = ''")
    box.send_keys(str(tmp_path / "bad.eitm"))
    until(lambda: "the uploaded file" in live.text("answer"))
    (tmp_path / "good.eitm").write_bytes(load_prebuilt()[1])
    box.send_keys(str(tmp_path / "good.eitm"))
    until(lambda: "is in use" in live.text("answer"))
    more_frames(server)
    begin_again(server)


def test_unplugged_and_back(scene, page, monkeypatch):
    board = SimBoard(BoardFrames(load_scene(scene)), [bank_bytes(load_prebuilt()[1], 1), EMPTY])
    there: list[str] = []
    monkeypatch.setattr(
        ports_module, "ports", lambda: [Port(path, "", 0x0483, 0x374B, "SERIAL1") for path in there]
    )
    with ExitStack() as wires:

        def plugged() -> Wire:
            wire = Wire(board, frame_s=0.02)
            wires.callback(wire.unplug)
            there[:] = [wire.path]
            return wire

        first = plugged()
        with serving(f"serial:{first.path}", Stream.TOUCHES) as server:
            page.open(server)
            until(lambda: server.reader.frames > 3)
            assert page.get("step", "hidden")
            there.clear()
            first.unplug()
            until(lambda: "plugged in again" in page.text("state"))
            assert "unplugged" in page.text("log")
            plugged()
            until(lambda: page.text("state") == "live")
            more_frames(server)


@pytest.mark.parametrize("width", [360, 768, 2560])
@pytest.mark.parametrize("settings", [False, True])
def test_it_fits(live, width, settings):
    live.size(width, 900)
    live.run(f"document.getElementById('expert').open = {str(settings).lower()}")
    until(lambda: live.run("return innerWidth") == width)
    wide, inner = live.run("return [document.documentElement.scrollWidth, innerWidth]")
    assert wide <= inner
    outside = live.run(
        "return [...document.querySelectorAll('button, input, select, canvas, h2, dd')].filter(e =>"
        " e.checkVisibility() && (e.getBoundingClientRect().right > innerWidth + 0.5 ||"
        " e.getBoundingClientRect().left < -0.5)).map(e => e.id)"
    )
    assert outside == []


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (2560, 1440)])
def test_skin_plots_and_voltages_are_on_one_screen(live, width, height):
    live.size(width, height)
    until(lambda: live.run("return innerWidth") == width)
    until(lambda: live.get("volts", "width") > 300)
    for name in ("skin", "plots", "volts"):
        box = live.box(name)
        assert box["top"] >= 0 and box["bottom"] <= height and box["height"] >= 100, name
    assert live.run("return document.documentElement.scrollHeight") <= height
    assert live.box("skin")["height"] >= 0.4 * height


def test_a_phone_shows_the_skin_below_its_toolbar(live):
    live.size(390, 844)
    until(lambda: live.run("return innerWidth") == 390)
    box = live.box("skin")
    assert box["top"] < 0.25 * 844
    assert box["bottom"] < 0.75 * 844
    assert box["height"] >= 0.9 * box["width"]


def test_a_phone_on_its_side_shows_the_whole_skin(live):
    live.size(844, 390)
    until(lambda: live.run("return innerWidth") == 844)
    box = live.box("skin")
    assert box["bottom"] <= 390 and box["height"] >= 0.5 * 390
    assert live.box("tare")["top"] == live.box("record")["top"] and live.box("expert")["top"] < 80
    assert box["right"] < 0.7 * 844  # beside it the page can be scrolled with a finger


def place_on_screen(page: Page, x_mm: float, y_mm: float) -> tuple[float, float]:
    """Return where the skin's canvas shows a place, in CSS pixels from the window's corner."""
    box = page.box("skin")
    scale = min(box["width"] - 52, box["height"] - 52) / 194
    middle = box["left"] + box["width"] / 2, box["top"] + box["height"] / 2
    return middle[0] + x_mm * scale, middle[1] - y_mm * scale


def test_the_mouse_presses_the_simulated_skin(live):
    """The press is found where it is, moves with the mouse, and ends with it."""
    assert live.shown("hint")

    def found_at(place: tuple[float, float]) -> bool:
        found, expected = live.touches(), sorted([*PLACES, place])
        return len(found) == 3 and float(np.abs(np.array(found) - expected).max()) < NEAR_MM

    def mouse(kind: str, place: tuple[float, float]) -> None:
        x, y = place_on_screen(live, *place)
        live.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    for kind, place in (("mousePressed", (0.0, 40.0)), ("mouseMoved", (5.0, 45.0))):
        mouse(kind, place)
        until(partial(found_at, place))
    until(lambda: "touches" in live.get("plots", "ariaLabel"))
    mouse("mouseReleased", (5.0, 45.0))
    until(lambda: len(live.touches()) == 2)


def test_two_fingers_press_the_skin_on_a_phone(live):
    live.size(390, 844)
    until(lambda: live.run("return innerWidth") == 390)
    fingers = (0.0, 40.0), (-40.0, -40.0)

    def touch(kind: str, places: tuple[tuple[float, float], ...]) -> None:
        points = [dict(zip("xy", place_on_screen(live, *place), strict=True)) for place in places]
        numbered = [{"id": number, **point} for number, point in enumerate(points)]
        live.command("Input.dispatchTouchEvent", type=kind, touchPoints=numbered)

    def found() -> bool:
        places, expected = live.touches(), sorted([*PLACES, *fingers])
        return len(places) == 4 and float(np.abs(np.array(places) - expected).max()) < NEAR_MM

    touch("touchStart", fingers)
    until(found)
    touch("touchEnd", ())
    until(lambda: len(live.touches()) == 2)


def test_keys_press_and_a_page_that_goes_lifts_its_finger(live, server):
    def press_key(key: str) -> None:
        event = f"new KeyboardEvent('keydown', {{key: '{key}'}})"
        live.run(f"document.getElementById('skin').dispatchEvent({event})")

    press_key("Enter")
    until(lambda: len(live.touches()) == 3)
    board = server.reader.live().device.transport.board  # type: ignore[attr-defined]
    assert [(one.x_mm, one.y_mm) for one in board.fingers] == [(0.0, 0.0)]
    press_key("ArrowUp")
    until(lambda: [(one.x_mm, one.y_mm) for one in board.fingers] == [(0.0, 5.0)])
    live.driver.get("about:blank")
    until(lambda: board.fingers == ())


def test_light_and_dark(live):
    shades = []
    for dark in (False, True):
        live.size(1200, 900, dark=dark)
        style = "getComputedStyle(document.body)"
        shades.append(live.run(f"return [{style}.backgroundColor, {style}.color]"))
    (light, ink), (dark_ground, light_ink) = shades
    assert sum(map(int, light[4:-1].split(","))) > 600 > 300 > sum(map(int, ink[4:-1].split(",")))
    assert sum(map(int, dark_ground[4:-1].split(","))) < 150
    assert sum(map(int, light_ink[4:-1].split(","))) > 600


def test_every_control_has_a_name_and_is_reached_by_keyboard(live):
    live.run("document.getElementById('expert').open = true")
    nodes = live.command("Accessibility.getFullAXTree")["nodes"]
    roles = ("button", "checkbox", "combobox", "spinbutton", "image", "table", "toolbar")
    found = [
        (node["role"]["value"], node.get("name", {}).get("value", ""))
        for node in nodes
        if not node["ignored"] and node["role"]["value"] in roles
    ]
    names = {name for _, name in found}
    assert {"Tare", "Record", "Pause", "Step", "Controls", "Sign", "show the truth"} <= names
    unnamed = [role for role, name in found if not name.strip() and role != "table"]
    assert unnamed == []
    reached = live.run(
        "return [...document.querySelectorAll('button, input, select')].filter(e =>"
        " e.checkVisibility() && !e.disabled && e.tabIndex < 0).map(e => e.id)"
    )
    assert reached == []


def test_nothing_comes_from_elsewhere_and_nothing_is_wrong(live, server):
    names = live.run("return performance.getEntriesByType('resource').map(e => e.name)")
    assert len(names) >= 3
    assert all(name.startswith(server.address) for name in names)
    wrong = [one["message"] for one in live.driver.get_log("browser") if one["level"] == "SEVERE"]
    servers_that_went = ("/model", "ERR_CONNECTION_REFUSED")
    assert [text for text in wrong if not any(one in text for one in servers_that_went)] == []


def test_without_the_token_it_only_looks_on(live, server):
    live.open(server, token=None)
    until(live.touches)
    assert live.run(
        "return ['tare', 'record', 'sign', 'model', 'play'].every(i =>"
        " document.getElementById(i).disabled)"
    )
    before = server.reader.live().pacer.paused
    live.run("document.getElementById('play').disabled = false")
    live.click("play")
    assert "needs the token" in live.answer()
    assert server.reader.live().pacer.paused == before
    live.open(server, token=TOKEN + "!")
    until(lambda: "eitskin view printed" in live.text("answer"))


@pytest.mark.long("the other tests look at the same page for seconds")
def test_frames_go_on_without_end_and_memory_does_not(live, server):
    """As many frames as in ten minutes at 50 a second, as fast as they come."""
    live.choose("speed", "max")
    start = server.reader.frames

    def sizes() -> tuple[float, float]:
        live.command("HeapProfiler.collectGarbage")
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * 4096 / 1e6, live.run("return performance.memory.usedJSHeapSize") / 1e6

    until(lambda: server.reader.frames > start + 5_000, 300)
    before = sizes()
    until(lambda: server.reader.frames > start + 35_000, 600)
    after = sizes()
    live.choose("speed", "1")
    assert after[0] < before[0] + 20
    assert after[1] < before[1] + 5
    assert live.run("return document.getElementsByTagName('*').length") < 600
