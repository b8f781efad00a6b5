"""The live page served by a process of its own, and a browser that shows it."""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from eitskin.errors import DeviceError
from eitskin_studies.harness.extras import missing_studies_extra

DRIVER = "/usr/bin/chromedriver"
FLAGS = (
    "--headless=new --no-sandbox --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync"
)
WITH_WEBGL = " --use-angle=swiftshader --enable-unsafe-swiftshader"
WITHOUT_WEBGL = " --disable-gpu"  # what is drawn in two dimensions is drawn faster so


def need_browser() -> None:
    """Reject before anything is done where no browser can be driven.

    Raises:
        MissingExtraError: selenium is not installed.
    """
    try:
        import selenium  # noqa: F401
    except ImportError:
        raise missing_studies_extra("browser", "selenium") from None


@contextmanager
def served_page(url: str, sinks: Sequence[str] = ()) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """``eitskin view`` of a device, with ``sinks``: the process, and its address with the token.

    Raises:
        DeviceError: it did not start.
    """
    command = [sys.executable, "-m", "eitskin", "view", "--device", url]
    command += [word for sink in sinks for word in ("--to", sink)]
    process = subprocess.Popen(
        [*command, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    try:
        found = re.match(r"open (\S+)", process.stdout.readline())
        if found is None:
            raise DeviceError("eitskin view did not start; run it by itself to see why")
        yield process, found.group(1)
    finally:
        process.terminate()
        process.wait(20)


@contextmanager
def browser(address: str, script: str = "", *, webgl: bool = False) -> Iterator[Any]:
    """Chromium, looking at ``address``; ``script`` runs before the page's own. Only with ``webgl``
    skins are shown in three dimensions."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        options = webdriver.ChromeOptions()
        for flag in (FLAGS + (WITH_WEBGL if webgl else WITHOUT_WEBGL)).split():
            options.add_argument(flag)
        options.add_argument(f"--user-data-dir={folder}")
        driver: Any = webdriver.Chrome(options, Service(DRIVER))
        try:
            driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": script})
            driver.get(address)
            yield driver
        finally:
            driver.quit()
