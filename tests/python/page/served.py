"""A page that is served in a thread, and a browser that looks at it."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

from eitskin.device.wire.link_table import Stream
from eitskin.page.server import PageServer, listen
from eitskin.session.settings import SessionSettings

TOKEN = "a word for tests"
FLAGS = (
    "--headless=new --no-sandbox --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync"
)
WITH_WEBGL = " --use-angle=swiftshader --enable-unsafe-swiftshader"
WITHOUT_WEBGL = " --disable-gpu"  # what is drawn in two dimensions is drawn faster so
ALL = Stream.RAW | Stream.IMAGE | Stream.TOUCHES


def until(what: Callable[[], Any], seconds: float = 60.0) -> Any:
    """Wait until ``what`` returns something true, and return it."""
    end = time.monotonic() + seconds
    while not (value := what()):
        assert time.monotonic() < end, "it never came"
        time.sleep(0.02)
    return value


@contextmanager
def serving(url: str, mode: Stream = ALL, **more: Any) -> Iterator[PageServer]:
    """The page of ``url`` on a free port."""
    settings = SessionSettings(
        mode, quiet_frames=True, zones=more.pop("zones", ()), model=more.pop("model", None)
    )
    more = {"token": TOKEN, "host": "127.0.0.1"} | more
    server = PageServer(url, settings, listen("127.0.0.1", 0), **more)
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    try:
        until(lambda: server.reader.state != "starting")
        yield server
    finally:
        server.stop()
        thread.join(30.0)
        assert not thread.is_alive()


class Page:
    """The live page in a browser, with what a user sees and does."""

    def __init__(self, folder: Path, *, webgl: bool = False) -> None:
        options = webdriver.ChromeOptions()
        for flag in (FLAGS + (WITH_WEBGL if webgl else WITHOUT_WEBGL)).split():
            options.add_argument(flag)
        options.add_argument(f"--user-data-dir={folder}")
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(options, Service("/usr/bin/chromedriver"))

    def open(self, server: PageServer, *, token: str | None = TOKEN) -> None:
        """Open the page again, and wait until it shows the device."""
        self.driver.get("about:blank")
        self.driver.get(server.address + ("" if token is None else f"#token={token}"))
        until(lambda: "electrodes" in self.text("device"))

    def run(self, script: str) -> Any:
        """A script's value."""
        return self.driver.execute_script(script)

    def get(self, name: str, what: str = "textContent") -> Any:
        """A property of an element."""
        return self.run(f"return document.getElementById('{name}').{what}")

    def text(self, name: str) -> str:
        """Return the text of an element."""
        return str(self.get(name))

    def shown(self, name: str) -> bool:
        """Whether an element is drawn."""
        return bool(self.get(name, "checkVisibility()"))

    def box(self, name: str) -> dict[str, float]:
        """Return the place of an element in the window, in CSS pixels."""
        return dict(self.get(name, "getBoundingClientRect().toJSON()"))

    def click(self, name: str) -> None:
        """Press it, and see to it that the old answer is gone."""
        self.run(
            "document.getElementById('answer').textContent = '';"
            f"document.getElementById('{name}').click()"
        )

    def choose(self, name: str, value: str) -> None:
        """A value of a list or a number."""
        self.run(
            f"const e = document.getElementById('{name}');"
            "document.getElementById('answer').textContent = '';"
            f"e.value = '{value}'; e.dispatchEvent(new Event('change', {{bubbles: true}}))"
        )

    def answer(self) -> str:
        """Return the answer to the last press of a button."""
        return str(until(lambda: self.text("answer").replace("…", ""), 120))

    def touches(self) -> list[tuple[float, float]]:
        """Places in mm, as the page's table says them."""
        rows = self.run(
            "return [...document.querySelectorAll('#touches tr')]"
            ".map(r => [...r.children].map(c => c.textContent))"
        )
        return sorted((float(row[1]), float(row[2])) for row in rows)

    def size(self, width: int, height: int, *, dark: bool = False) -> None:
        """Set the size of the window, and the dark or light preference of the system."""
        self.command(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.command("Emulation.setEmulatedMedia", features=[scheme])

    def command(self, name: str, **facts: Any) -> Any:
        """One of Chromium's own."""
        return self.driver.execute_cdp_cmd(name, facts)
