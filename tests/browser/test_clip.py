"""The clip page: player, timeline, curves, search by range and by file, side by side, what is known of the clip."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.browser.test_library import CARDS, drawn

Open = Callable[..., Any]
Shot = Callable[[Any, str], None]


@pytest.fixture
def clip(open_page: Open) -> str:
    """The longest clip of the lake: of the real ones one that is cut into segments."""
    page = open_page("sort=seconds&descending=true")
    page.wait_for_selector(CARDS)
    name: str = page.inner_text(f"{CARDS} .clip-name")
    return name


def opened(open_page: Open, clip: str, more: str = "", **how: Any) -> Any:
    page = open_page(f"view=clip&clip={clip}{more}", **how)
    page.wait_for_selector(".clip-page .stage")
    page.wait_for_function("() => / frame \\d+ of (?!1 )\\d+/.test(document.querySelector('.now')?.textContent ?? '')")
    page.wait_for_selector(".lane")
    page.wait_for_timeout(500)
    return page


def frame(page: Any) -> int:
    text: str = page.inner_text(".now")
    return int(text.partition("frame ")[2].split()[0])


def shown(page: Any, number: int) -> None:
    """Waits until a frame is shown."""
    page.wait_for_function(
        "n => document.querySelector('.now').textContent.includes(` frame ${n} of `)", arg=number, timeout=5000
    )


def colours_of(page: Any) -> int:
    """How many colours a picture of the player has: of an empty one, very few."""
    png = base64.b64encode(page.locator(".stage").screenshot()).decode()
    count: int = page.evaluate(
        """async data => {
          const bytes = Uint8Array.from(atob(data), c => c.charCodeAt(0));
          const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
          const canvas = new OffscreenCanvas(image.width, image.height), ctx = canvas.getContext("2d");
          ctx.drawImage(image, 0, 0);
          return new Set(new Uint32Array(ctx.getImageData(0, 0, image.width, image.height).data.buffer)).size;
        }""",
        png,
    )
    return count


def mark(page: Any, share: tuple[float, float] = (0.2, 0.5)) -> None:
    """Mark a range by dragging along the ruler."""
    box = page.locator(".ruler").bounding_box()
    x = [box["x"] + part * box["width"] for part in share]
    page.mouse.move(x[0], box["y"] + 8)
    page.mouse.down()
    page.mouse.move(sum(x) / 2, box["y"] + 8)
    page.mouse.move(x[1], box["y"] + 8)
    page.mouse.up()
    page.wait_for_function("() => location.search.includes('from=')")


def test_it_plays_steps_and_scrubs(open_page: Open, shot: Shot, clip: str) -> None:
    page = opened(open_page, clip)
    assert colours_of(page) > 200
    before = frame(page)
    page.wait_for_timeout(400)
    assert frame(page) != before
    page.keyboard.press("Space")
    page.wait_for_timeout(400)
    before = frame(page)
    page.keyboard.press("ArrowRight")
    shown(page, before + 1)
    page.keyboard.press("Home")
    shown(page, 0)
    page.locator(".scrub").fill("20")
    shown(page, 20)
    page.select_option("select[aria-label=Speed]", "0.25")
    shot(page, "clip")


def test_the_view_is_turned_and_shown_otherwise(open_page: Open, shot: Shot, clip: str) -> None:
    page = opened(open_page, clip)
    page.keyboard.press("Space")
    page.locator(".scrub").fill("30")
    page.wait_for_timeout(200)
    stage = page.locator(".stage")
    before = stage.screenshot()
    box = stage.bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 150)
    page.mouse.down()
    page.mouse.move(box["x"] + 320, box["y"] + 120)
    page.mouse.up()
    page.wait_for_timeout(200)
    turned = stage.screenshot()
    assert turned != before
    page.keyboard.press("r")
    page.wait_for_timeout(200)
    assert stage.screenshot() != turned
    page.keyboard.press("f")
    page.wait_for_timeout(200)
    shot(page, "trails-still")
    page.keyboard.press("h")


def test_a_marked_range_is_found_and_explained(open_page: Open, shot: Shot, clip: str) -> None:
    page = opened(open_page, clip)
    mark(page)
    assert page.locator(".range").is_visible()
    assert page.locator("select").filter(has_text="Ranges").input_value() == "range"
    page.keyboard.press("s")
    page.wait_for_selector(".hit >> text=frames", timeout=90_000)
    page.wait_for_timeout(800)
    shot(page, "found-range")
    page.locator(".hit").first.get_by_role("button", name="Why").click()
    page.wait_for_selector(".why")
    shot(page, "why")
    page.locator(".hit").nth(1).get_by_role("button", name="Beside").click()
    page.wait_for_selector(".pane-name >> nth=1")
    assert "beside=" in page.url
    page.keyboard.press("Escape")
    page.wait_for_function("() => !location.search.includes('from=')")


def test_every_method_answers(open_page: Open, shot: Shot, clip: str) -> None:
    page = opened(open_page, clip)
    by = page.locator(".find-fields select").nth(1)
    methods = by.locator("option:not([disabled])").evaluate_all("all => all.map(o => o.value)")
    assert len(methods) > 3
    page.get_by_label("Mirrored too").check()
    for method in methods:
        by.select_option(method)
        page.get_by_role("button", name="Find clips like this").click()
        page.wait_for_selector(".find .note >> text=clips like the clip, in", timeout=90_000)
        page.wait_for_selector(".hit")
        page.wait_for_function("() => document.querySelector('.go').getAttribute('aria-busy') === 'false'")
    page.locator(".hit").first.get_by_role("button", name="Why").click()
    shot(page, "methods")


def test_clips_side_by_side_are_aligned(open_page: Open, shot: Shot, clip: str) -> None:
    page = open_page("sort=seconds&descending=true")
    page.wait_for_selector(CARDS)
    names = page.locator(f"{CARDS} .clip-name").all_inner_texts()[1:4]
    page = opened(open_page, clip, "".join(f"&beside={name}" for name in names))
    page.wait_for_selector(".pane-name >> nth=3")
    page.wait_for_timeout(1200)
    shot(page, "four")
    page.get_by_label("Align in time").check()
    page.wait_for_function("() => location.search.includes('aligned')")
    page.wait_for_timeout(1500)
    shot(page, "four-aligned")
    page.locator(".pane-names button").first.click()
    page.wait_for_selector(".pane-name >> nth=3", state="detached")


def test_what_is_known_of_the_clip(open_page: Open, shot: Shot, clip: str) -> None:
    page = opened(open_page, clip, scheme="dark")
    page.keyboard.press("i")
    page.wait_for_selector(".about >> text=Licence")
    assert "frames at" in page.inner_text(".about")
    assert drawn(page, ".curve")
    before = page.eval_on_selector(".curve", "c => c.toDataURL()")
    page.select_option("select[aria-label=Joint]", label="left toe")
    page.wait_for_timeout(300)
    assert page.eval_on_selector(".curve", "c => c.toDataURL()") != before
    shot(page, "about-dark")


def test_a_dropped_file_is_a_query(open_page: Open, shot: Shot, browsed_clips: Path) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    file = next(iter(sorted(browsed_clips.rglob("*.bvh")) or sorted(browsed_clips.rglob("*.npz"))))
    page.evaluate(
        """([name, data]) => {
          const bytes = Uint8Array.from(atob(data), c => c.charCodeAt(0));
          const files = new DataTransfer();
          files.items.add(new File([bytes], name));
          for (const type of ["dragenter", "dragover"])
            window.dispatchEvent(new DragEvent(type, { dataTransfer: files, bubbles: true, cancelable: true }));
          window.dropped = files;
        }""",
        [file.name, base64.b64encode(file.read_bytes()).decode()],
    )
    page.wait_for_selector(".drop")
    shot(page, "drop")
    page.evaluate(
        """() => window.dispatchEvent(
          new DragEvent("drop", { dataTransfer: window.dropped, bubbles: true, cancelable: true }))"""
    )
    page.wait_for_selector(".hit", timeout=90_000)
    page.wait_for_timeout(800)
    assert "view=upload" in page.url
    shot(page, "upload")


def test_a_file_that_is_no_motion_is_refused(open_page: Open) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    page.evaluate(
        """() => {
          const files = new DataTransfer();
          files.items.add(new File(["no motion"], "x.bvh"));
          window.dispatchEvent(new DragEvent("drop", { dataTransfer: files, bubbles: true, cancelable: true }));
        }"""
    )
    page.wait_for_selector(".sayings .error")
    open_page.complaints.clear()  # type: ignore[attr-defined]


def test_a_clip_that_is_not_there_is_said_so(open_page: Open) -> None:
    page = open_page("view=clip&clip=%3Cscript%3Ealert(1)%3C%2Fscript%3E")
    assert "no such clip" in page.wait_for_selector("[role=alert]").inner_text()
    open_page.complaints.clear()  # type: ignore[attr-defined]
