"""Chromium driven by Playwright against a service of a small lake of real recordings."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.browser.lake import browser_clips, browser_lake
from tests.lakes import made_clips, made_once

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Without a display and a graphics card: WebGL is drawn by the processor.
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--force-device-scale-factor=1")
TOKEN = "a-token-for-the-tests-alone"
SIZE = {"width": 1280, "height": 800}  # of a page on a screen of 13 inches


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A headless Chromium; tests are skipped where there is none, and say what to install."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        pytest.skip("no Chromium here: apt-get install chromium")
    api = pytest.importorskip("playwright.sync_api", reason="no Playwright here: pip install playwright")
    with api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=program, args=list(FLAGS))
        yield found
        found.close()


@pytest.fixture(scope="session")
def browsed_clips(shared: Path) -> Path:
    """The files of the lake that is looked at."""
    data = os.environ.get("MOTIONLAKE_DATA")
    return made_once(
        shared / "browsed", lambda folder: browser_clips(Path(data), folder) if data else made_clips(folder, 9)
    )


@pytest.fixture(scope="session")
def browsed_lake(shared: Path, browsed_clips: Path, browser: Browser, request: pytest.FixtureRequest) -> Path:
    """A lake of them, with every stage that the views show."""
    del browser  # without one, no lake is made
    make: Callable[[Path], None] = lambda lake: browser_lake(browsed_clips, lake, request.getfixturevalue("scheduler"))  # noqa: E731
    return made_once(shared / "lakes" / "browsed", make)


@pytest.fixture(scope="session")
def service(browsed_lake: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a service of a copy of that lake, whose decisions the tests write."""
    lake = shutil.copytree(browsed_lake, tmp_path_factory.mktemp("served") / "lake")
    words = ["browse", "--lake", str(lake), "--token", TOKEN, "--port", "0", "--no-open"]
    command = [str(Path(sys.executable).parent / "motionlake"), *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:"), address
        yield address.partition("?")[0]
    finally:
        process.terminate()
        process.wait(20)


@pytest.fixture
def open_page(browser: Browser, service: str) -> Iterator[Callable[..., Page]]:
    """Opens a view in a browser of its own; what the page complains of fails the test."""
    contexts: list[Any] = []
    complaints: list[str] = []

    def opened(query: str = "", *, scheme: str = "light", size: dict[str, int] = SIZE) -> Page:
        context = browser.new_context(viewport=size, color_scheme=scheme, accept_downloads=True)  # type: ignore[arg-type]
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(30_000)
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("request", lambda asked: _inside(asked.url, service, complaints))
        page.goto(f"{service}?token={TOKEN}{'&' if query else ''}{query}")
        page.wait_for_selector("main")
        return page

    opened.complaints = complaints  # type: ignore[attr-defined]
    yield opened
    for context in contexts:
        context.close()
    assert not complaints, complaints


def _inside(url: str, service: str, complaints: list[str]) -> None:
    if not url.startswith((service, "data:", "blob:")):
        complaints.append(f"asks elsewhere: {url}")


@pytest.fixture
def shot(tmp_path: Path) -> Callable[[Any, str], None]:
    """Keeps a picture of a page in the folder of the test."""

    def kept(page: Any, name: str) -> None:
        page.screenshot(path=tmp_path / f"{name}.png")

    return kept
