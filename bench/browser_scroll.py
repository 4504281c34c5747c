"""The browser application's grid of 150,000 clips: `python -m bench.browser_scroll [paint scroll pictures]`.

A service of made clips answers (`bench.made_service`), so that the application alone is measured: in headless Chromium
without a graphics card. "paint": from the call for the page until something is drawn, until the first clips are there
and until their pictures are. "scroll": milliseconds from frame to frame while the grid is scrolled by so many pixels a
frame; 60 frames a second are 16.7 ms. "pictures": stick figures on canvases of their own, beside WebGL on one canvas
with a part for each.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.made_service import made_service
from bench.record import record

PARTS: Final = ("paint", "scroll", "pictures")
CLIPS: Final = 150_000
SECONDS: Final = 6.0  # of scrolling at each speed
LOADS: Final = 5
SPEEDS: Final = (10, 40, 200, 4000)  # pixels a frame: reading, wheel, swift wheel, dragging the bar
PICTURES: Final = 40  # on a screen
ROUNDS: Final = 60
PROGRAMS: Final = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Pages are drawn by the processor; a graphics card that is made believe is slower than that by far.
PLAIN: Final = ("--no-sandbox", "--disable-gpu")
FLAGS: Final = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_SCROLL: Final = """
([pixels, seconds]) => new Promise(done => {
  const grid = document.querySelector(".grid"), times = [], begun = performance.now();
  let last = 0, way = 1;
  const step = now => {
    if (last) times.push(now - last);
    last = now;
    if (grid.scrollTop + grid.clientHeight >= grid.scrollHeight - 10) way = -1;
    if (grid.scrollTop <= 0) way = 1;
    grid.scrollTop += way * pixels;
    if (now - begun < seconds * 1000) requestAnimationFrame(step); else done(times);
  };
  requestAnimationFrame(step);
})
"""
_DRAWN: Final = """
() => document.querySelector(".card:not(.empty) .thumb[data-frame]") ? performance.now() : 0
"""


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", help=", ".join(PARTS))
    parts = parser.parse_args(arguments).parts or list(PARTS)
    if unknown := set(parts) - set(PARTS):
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        print("no Chromium here: apt-get install chromium")
        return
    figures: dict[str, Any] = {"clips": CLIPS, "load": round(os.getloadavg()[0], 1)}
    measures = {"paint": (paint, PLAIN), "scroll": (scroll, PLAIN), "pictures": (pictures, FLAGS)}
    with made_service(CLIPS) as address:
        for part in parts:
            measure, flags = measures[part]
            with _browser(program, flags) as browser:
                figures["chromium"] = browser.version
                figures[part] = measure(browser, address)
    for part in parts:
        print(f"{part}: {figures[part]}")
    print(f"record: {record('browser_scroll', figures, packages=('playwright',))}")


@contextmanager
def _browser(program: str, flags: Sequence[str]) -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(flags))
        yield browser
        browser.close()


def paint(browser: Any, address: str) -> dict[str, float]:
    """Milliseconds, medians of loads in browsers that have nothing kept."""
    found: dict[str, list[float]] = {"first_paint_ms": [], "clips_ms": [], "pictures_ms": []}
    for _ in range(LOADS):
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        page = context.new_page()
        page.goto(address, wait_until="commit")
        page.wait_for_selector(".card:not(.empty)")
        found["clips_ms"].append(page.evaluate("performance.now()"))
        found["pictures_ms"].append(page.wait_for_function(_DRAWN).json_value())
        found["first_paint_ms"].append(
            page.evaluate("performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0")
        )
        context.close()
    return {name: round(statistics.median(values), 1) for name, values in found.items()}


def scroll(browser: Any, address: str) -> dict[str, dict[str, float]]:
    """Milliseconds from frame to frame, by pixels a frame."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(address)
    page.wait_for_selector(".card:not(.empty)")
    page.wait_for_timeout(1500)
    found = {}
    for pixels in SPEEDS:
        times = np.array(page.evaluate(_SCROLL, [pixels, SECONDS]))
        low, high, most = np.percentile(times, [50, 95, 99])
        found[str(pixels)] = {
            "median_ms": round(float(low), 1), "p95_ms": round(float(high), 1), "p99_ms": round(float(most), 1),
            "longest_ms": round(float(times.max()), 1), "late": round(float((times > 18).mean()), 4),
            "frames_a_second": round(1000 / float(times.mean()), 1),
        }  # fmt: skip
    page.close()
    return found


def pictures(browser: Any, address: str) -> dict[str, Any]:
    """Milliseconds that all pictures of a screen take, both ways."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(address)
    page.wait_for_selector(".card:not(.empty)")
    script = (Path(__file__).parent / "browser_pictures.js").read_text(encoding="utf-8")
    found: dict[str, Any] = page.evaluate(script, [PICTURES, ROUNDS, 190, 132])
    page.close()
    return {name: round(value, 2) if isinstance(value, float) else value for name, value in found.items()}


if __name__ == "__main__":
    main()
