"""The map: points, colours, the lasso."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.browser.test_library import drawn

Open = Callable[..., Any]
Shot = Callable[[Any, str], None]
CANVAS = ".map-box canvas"


def opened(open_page: Open, more: str = "", **how: Any) -> Any:
    page = open_page(f"view=map{more}", **how)
    page.wait_for_selector(".legend", timeout=120_000)
    page.wait_for_timeout(400)
    return page


def test_points_are_coloured_and_named(open_page: Open, shot: Shot) -> None:
    page = opened(open_page)
    assert drawn(page, CANVAS)
    before = page.eval_on_selector(CANVAS, "c => c.toDataURL()")
    shot(page, "map")
    page.select_option("select[aria-label='Colour by']", "seconds")
    page.wait_for_function("() => location.search.includes('colour=seconds')")
    page.wait_for_timeout(600)
    assert page.eval_on_selector(CANVAS, "c => c.toDataURL()") != before
    shot(page, "map-length")


def test_the_lasso_selects_and_the_mouse_moves(open_page: Open, shot: Shot) -> None:
    page = opened(open_page, scheme="dark")
    box = page.locator(CANVAS).bounding_box()
    x, y, w, h = (box[name] for name in ("x", "y", "width", "height"))
    page.mouse.move(x + 0.2 * w, y + 4)
    page.mouse.down()
    for right, down in ((0.5, 0.01), (0.5, 0.98), (0.2, 0.98), (0.2, 0.5)):
        page.mouse.move(x + right * w, y + down * h, steps=4)
    shot(page, "lasso")
    page.mouse.up()
    page.wait_for_function("() => /^\\d+ selected/.test(document.querySelector('.selection output').textContent)")
    shot(page, "lassoed-dark")
    few = int(page.inner_text(".selection output").split()[0])
    page.keyboard.press("Control+a")
    page.wait_for_function("n => parseInt(document.querySelector('.selection output').textContent) > n", arg=few)
    page.keyboard.press("Escape")
    before = page.eval_on_selector(CANVAS, "c => c.toDataURL()")
    page.mouse.move(x + 0.4 * w, y + 0.4 * h)
    page.mouse.wheel(0, -400)
    page.wait_for_timeout(300)
    assert page.eval_on_selector(CANVAS, "c => c.toDataURL()") != before
    page.keyboard.press("h")
    page.keyboard.press("p")
    page.keyboard.press("ArrowLeft")


def test_a_point_shows_its_clip_and_opens_it(open_page: Open, shot: Shot) -> None:
    page = opened(open_page)
    box = page.locator(CANVAS).bounding_box()
    for step in range(1, 60):  # along the diagonals until a point is met
        share = step / 60
        for y in (share, 1 - share, 0.5):
            page.mouse.move(box["x"] + (0.25 + 0.5 * share) * box["width"], box["y"] + y * box["height"])
            page.wait_for_timeout(25)
            if page.locator(".map-tip").count():
                page.wait_for_timeout(500)
                shot(page, "tip")
                page.mouse.down()
                page.mouse.up()
                page.wait_for_selector(".clip-page")
                return
    raise AssertionError("no point was met")
