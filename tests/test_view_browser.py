"""The player in a real headless browser: it draws, plays, scrubs, turns and zooms, and needs nothing from elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.pictures.bands import Segment
from motionlake.pictures.player import player_page
from motionlake.pictures.player_material import PlayerClip
from numpy.typing import NDArray

from tests.browser_cdp import NoBrowserError, Page, browsing, wait
from tests.test_pictures import standing

HOSTILE = "<!--<script </script x </script><script>document.title = 1</script><!--\"'&<img src=x onerror=alert(1)>動き"
FPS = 120.0
# Shares of a canvas at which the pixels of a colour lie on average, and how many there are.
COLOURED = """(([n, r, g, b]) => {
  const canvas = document.querySelectorAll("canvas")[n], {width, height} = canvas;
  const copy = new OffscreenCanvas(width, height).getContext("2d", {willReadFrequently: true});
  copy.drawImage(canvas, 0, 0);
  const data = copy.getImageData(0, 0, width, height).data;
  let x = 0, y = 0, count = 0;
  for (let i = 0; i < data.length; i += 4)
    if (data[i + 3] == 255 && Math.abs(data[i] - r) + Math.abs(data[i + 1] - g) + Math.abs(data[i + 2] - b) < 12) {
      x += (i / 4) % width; y += Math.floor(i / 4 / width); count++;
    }
  return [x / count / width, y / count / height, count];
})"""
LEFT, RIGHT, INK = [0, 114, 178], [213, 94, 0], [34, 34, 34]


def walking(seconds: float, heading: float, far: float = 0.0) -> NDArray[np.float64]:
    """[F, 21, 3] a body that is moved 1 m/s along its heading, its left arm going up and down."""
    count = round(seconds * FPS)
    body = standing(count)
    at = np.arange(count) / FPS
    body[:, 7:9, 1] += 0.3 * np.sin(4 * at)[:, None]
    body[..., 2] += at[:, None]
    cos, sin = np.cos(heading), np.sin(heading)
    x, z = body[..., 0].copy(), body[..., 2].copy()
    body[..., 0], body[..., 2] = x * cos + z * sin + far, -x * sin + z * cos - far
    return body


def two_clips(name: str = "set/first.bvh") -> list[PlayerClip]:
    spans = [Segment(0, 1, "walk"), Segment(1, 4, "kick"), Segment(2.5, 3.5, "wave")]
    first = PlayerClip(name, walking(4, 2.0, 40), FPS, 500, 12, [("licence", name)], [("classes", spans)])
    second = PlayerClip("set/second.bvh", walking(2, 0.5), FPS, 240)
    return [first, second]


@pytest.fixture(scope="module")
def new_page() -> Iterator[Callable[[], Page]]:
    try:
        with browsing() as opened:
            yield opened
    except NoBrowserError as error:
        pytest.skip(f"no headless browser: {error}")


@pytest.fixture
def shown(new_page: Callable[[], Page], tmp_path: Path) -> Iterator[Callable[[Sequence[PlayerClip]], Page]]:
    """Opens a page of clips from disk; in the end nothing may have been complained of, or asked of a network."""
    pages: list[Page] = []

    def show(clips: Sequence[PlayerClip]) -> Page:
        path = tmp_path / f"{len(pages)}.html"
        path.write_text(player_page(clips), encoding="utf-8")
        pages.append(new_page())
        pages[-1].open(path.as_uri())
        pages[-1].settle()
        return pages[-1]

    yield show
    for page in pages:
        assert page.complaints == []


def pixels(page: Page) -> list[str]:
    found: list[str] = page.evaluate("[...document.querySelectorAll('canvas')].map(c => c.toDataURL())")
    return found


def coloured(page: Page, pane: int, colour: list[int]) -> tuple[float, float, int]:
    x, y, count = page.evaluate(f"{COLOURED}({[pane, *colour]})")
    return x, y, count


def text(page: Page, selector: str) -> Any:
    return page.evaluate(f"document.querySelector('{selector}').textContent")


def differ(one: Sequence[str], other: Sequence[str]) -> bool:
    """In every pane."""
    return all(a != b for a, b in zip(one, other, strict=True))


def test_both_panes_draw_bodies_that_face_the_viewer_whatever_their_heading(shown: Any) -> None:
    page = shown(two_clips())
    for pane in (0, 1):
        left, right = coloured(page, pane, LEFT), coloured(page, pane, RIGHT)
        assert left[2] > 400
        assert right[2] > 400
        assert left[0] > 0.5 + 0.02
        assert right[0] < 0.5 - 0.02  # the body's left is the viewer's right
        assert 0.1 < coloured(page, pane, INK)[1] < left[1] < 0.75  # the head above the limbs
    page.drag("canvas", 314, 0, at=(0.1, 0.5))  # half a turn
    for pane in (0, 1):
        assert coloured(page, pane, LEFT)[0] < coloured(page, pane, RIGHT)[0]


def test_plays_until_space_pauses(shown: Any) -> None:
    page = shown(two_clips())
    still = pixels(page)
    page.click("#play")
    wait(lambda: differ(still, pixels(page)))
    assert text(page, "#play") == "Pause"
    page.evaluate("document.activeElement.blur()")
    page.press(" ")
    assert text(page, "#play") == "Play"
    paused = pixels(page), text(page, "#time")
    time.sleep(0.2)
    assert (pixels(page), text(page, "#time")) == paused
    page.press(" ")
    wait(lambda: text(page, "#time") != paused[1])
    page.press(" ")


def test_keeps_time_at_the_speed_asked_for_and_loops_if_it_may(shown: Any) -> None:
    page = shown(two_clips())
    page.evaluate("window.due = [], window.requestAnimationFrame = f => due.push(f), 0")

    def after(milliseconds: int) -> str:
        page.evaluate(f"due.splice(0).forEach(f => f({milliseconds})), 0")
        return str(text(page, "#time")).split(" · ")[1].split()[0]

    page.evaluate("document.querySelector('#speed').value = '0.25', document.querySelector('#play').click(), 0")
    times = [after(at) for at in (1000, 1000, 1500, 2500, 16_500, 18_500)]
    assert times == ["0.00", "0.00", "0.10", "0.37", "3.87", "0.37"]
    page.evaluate("document.querySelector('#loop').click(), document.querySelector('#speed').value = '1', 0")
    assert after(23_500) == "3.97"
    assert text(page, "#play") == "Play"


def test_scrubs_by_keys_and_mouse_and_says_which_frame_of_the_clip_it_shows(shown: Any) -> None:
    page = shown(two_clips())
    assert text(page, "#time") == "frame 12 of 500 · 0.00 s of 4.00 s"
    start = pixels(page)
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft", "ArrowRight"):
        page.press(key)
    assert text(page, "#time") == "frame 20 of 500 · 0.07 s of 4.00 s"
    assert differ(start, pixels(page))
    page.press("End")
    assert text(page, "#time") == "frame 488 of 500 · 3.97 s of 4.00 s"
    assert text(page, "figure:last-child .now") == "ended · frame 236 · 1.97 s"
    page.drag("#scrub", 0, 0, at=(0.5, 0.5))
    assert text(page, "#time").startswith("frame 252 of 500 · 2.00 s")
    page.press("Home")
    assert pixels(page) == start


def test_stretches_the_other_clip_to_the_length_of_the_first(shown: Any) -> None:
    page = shown(two_clips())
    page.click("#stretch")
    page.drag("#scrub", 0, 0, at=(0.5, 0.5))
    assert text(page, "figure:first-child .now").startswith("frame 252")
    assert text(page, "figure:last-child .now").startswith("frame 120")


def test_the_mouse_turns_and_zooms_both_panes_and_r_puts_them_back(shown: Any) -> None:
    page = shown(two_clips())
    home = pixels(page)
    page.drag("canvas", 80, 30)
    turned = pixels(page)
    assert differ(home, turned)
    before = coloured(page, 1, LEFT)[2]
    page.wheel("canvas", -300)
    assert coloured(page, 1, LEFT)[2] > 1.3 * before
    page.evaluate("document.activeElement.blur()")
    page.press("r")
    assert pixels(page) == home
    page.evaluate("document.querySelector('canvas').focus()")
    page.press("ArrowLeft")
    assert differ(home, pixels(page))
    assert text(page, "#time").startswith("frame 12 ")


def test_two_fingers_zoom(shown: Any) -> None:
    page = shown(two_clips())
    page.resize(600, 900, touch=True)
    before = coloured(page, 0, LEFT)[2]
    page.pinch("canvas", 30)
    assert coloured(page, 0, LEFT)[2] > 1.3 * before


def test_the_camera_follows_or_stays(shown: Any) -> None:
    page = shown(two_clips())
    page.press("End")
    followed = pixels(page)
    assert abs(coloured(page, 0, INK)[0] - 0.5) < 0.05
    page.press("f")
    assert differ(followed, pixels(page))
    assert abs(coloured(page, 0, INK)[0] - 0.5) > 0.1


def test_classes_stand_where_they_are_played(shown: Any) -> None:
    page = shown(two_clips())
    places = page.evaluate(
        """[...document.querySelectorAll('.bands li')].map(li => [li.textContent,
        ...[li.offsetLeft, li.offsetWidth].map(x => x / li.parentElement.clientWidth), li.offsetTop])"""
    )
    whole = 4 - 1 / 30
    expected = [("walk", 0, 1, 0), ("kick", 1, 4 - 1 / 30, 0), ("wave", 2.5, 3.5, 20)]
    for (label, left, width, top), (name, start, stop, line) in zip(places, expected, strict=True):
        assert (label, top) == (name, line)
        assert left == pytest.approx(start / whole, abs=0.002)
        assert width == pytest.approx((stop - start) / whole, abs=0.002)
    assert text(page, ".now").endswith("· walk")
    page.click(".bands li:nth-child(3)")
    assert text(page, ".now") == "frame 312 · 2.50 s · kick · wave"


def test_dark_and_light(shown: Any) -> None:
    page = shown(two_clips())
    assert coloured(page, 0, LEFT)[2] > 400
    light = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.prefer("dark")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != light
    assert coloured(page, 0, [86, 180, 233])[2] > 400
    page.prefer("light")


def test_names_that_are_html_stay_text(shown: Any) -> None:
    one = two_clips(HOSTILE)[0]
    spans = [Segment(0, 2, HOSTILE)]
    page = shown([PlayerClip(HOSTILE, one.positions, FPS, 480, 0, one.facts, [(HOSTILE, spans)])])
    assert page.evaluate("document.title") == HOSTILE
    assert page.evaluate("document.querySelectorAll('script').length") == 2
    assert page.evaluate("document.querySelectorAll('img').length") == 0
    for selector in ("figure h2", "dd", ".bands li"):
        assert text(page, selector) == HOSTILE
    assert coloured(page, 0, LEFT)[2] > 400


GREEN, PURPLE = [0, 158, 115], [170, 68, 153]


@pytest.mark.parametrize("key", ["b", "t", "n"])
def test_a_key_shows_more_of_both_bodies_and_takes_it_away(shown: Any, key: str) -> None:
    page = shown(two_clips())
    page.drag("#scrub", 0, 0, at=(0.2, 0.5))
    page.evaluate("document.activeElement.blur()")
    plain = pixels(page)
    page.press(key)
    assert differ(plain, pixels(page))
    page.press(key)
    assert pixels(page) == plain


def test_capsules_are_thicker_than_sticks(shown: Any) -> None:
    page = shown(two_clips())
    drawn = """(() => { const c = document.querySelector("canvas"), {width, height} = c;
      const copy = new OffscreenCanvas(width, height).getContext("2d", {willReadFrequently: true});
      copy.drawImage(c, 0, 0);
      const data = copy.getImageData(0, 0, width, height).data;
      let count = 0; for (let i = 3; i < data.length; i += 4) count += data[i] > 250; return count; })()"""
    sticks = page.evaluate(drawn)
    page.click("#body")
    assert page.evaluate(drawn) > 2 * sticks


def test_feet_are_marked_where_they_stand_and_only_there(shown: Any) -> None:
    body = standing(60)
    sliding = body.copy()
    sliding[..., 2] += np.linspace(0, 4, 60)[:, None]
    clips = [PlayerClip(name, one, 30.0, 60) for name, one in (("still", body), ("sliding", sliding))]
    page = shown(clips)
    assert coloured(page, 0, GREEN)[2] == 0
    page.click("#contacts")
    page.evaluate("document.querySelectorAll('canvas')[0].dispatchEvent(new Event('dblclick'))")
    page.settle()
    greenish = """(() => [...document.querySelectorAll("canvas")].map((c) => {
      const data = c.getContext("2d").getImageData(0, 0, c.width, c.height).data; let n = 0;
      for (let i = 0; i < data.length; i += 4)
        n += data[i + 3] > 100 && data[i + 1] > data[i] + 60 && data[i + 1] > data[i + 2] + 20; return n; }))()"""
    still, slid = page.evaluate(greenish)
    assert still > 100
    assert slid == 0


def test_the_others_are_drawn_in_the_first(shown: Any) -> None:
    page = shown(two_clips())
    page.press("End")
    plain = pixels(page)
    page.press("o")
    after = pixels(page)
    assert plain[0] != after[0]
    assert plain[1] == after[1]


def test_curves_follow_the_joint_that_is_chosen(shown: Any) -> None:
    page = shown(two_clips())
    assert page.evaluate("document.querySelectorAll('canvas').length") == 2
    page.press("j")
    assert page.evaluate("document.getElementById('curve').clientHeight") > 60
    curve = pixels(page)[2]
    assert coloured(page, 2, PURPLE)[2] > 50  # of the second clip
    page.evaluate(
        "(s => { s.selectedIndex = 8; s.dispatchEvent(new Event('change')); })(document.getElementById('joint'))"
    )
    page.settle()
    assert pixels(page)[2] != curve
    assert text(page, "#values").startswith("1: ")
    page.click("#curve")
    assert text(page, "#time").startswith("frame 248 of 500")  # the middle


def test_four_clips_fit_on_a_small_screen(shown: Any) -> None:
    page = shown([*two_clips(), *two_clips("set/third.bvh")])
    page.resize(1280, 800)
    boxes = page.evaluate(
        "[...document.querySelectorAll('canvas')].map(c => (b => [b.left, b.top, b.right, b.bottom])"
        "(c.getBoundingClientRect()))"
    )
    assert len(boxes) == 4
    assert len({round(box[0]) for box in boxes}) == len({round(box[1]) for box in boxes}) == 2  # two by two
    assert max(box[3] for box in boxes) < 800
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    with pytest.raises(ValueError, match="one to 4"):
        player_page([two_clips()[0]] * 5)
