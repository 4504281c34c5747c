"""The library: the grid, facets, text, SQL, sorting, selection, keys, the address."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

Open = Callable[..., Any]
Shot = Callable[[Any, str], None]
CARDS = ".card:not(.empty)"
SHOWN = "picture => picture.toDataURL?.() ?? picture.innerHTML"  # what moves is a canvas, what stands still SVG


def total(page: Any) -> int:
    text: str = page.inner_text(".toolbar .total")
    return int(re.sub(r"\D", "", text) or 0)


def drawn(page: Any, selector: str) -> bool:
    """Whether a stick figure is drawn: limbs of both sides within the picture."""
    found: bool = page.eval_on_selector(
        selector,
        """picture => [...picture.querySelectorAll("path")].every((path) => {
          const limbs = path.getBBox(), style = getComputedStyle(path);
          return limbs.height > 5 && limbs.x > 0 && limbs.x + limbs.width < picture.clientWidth
            && style.display !== "none" && style.stroke !== "none";
        })""",
    )
    return found


def test_all_clips_are_there_with_pictures(open_page: Open, shot: Shot) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    page.wait_for_timeout(800)
    assert total(page) == 38 or total(page) == 27
    assert drawn(page, f"{CARDS} .thumb")
    shot(page, "library")


def test_a_picture_plays_when_pointed_at(open_page: Open) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    page.wait_for_timeout(800)
    picture = f"{CARDS} .thumb"
    still = page.eval_on_selector(picture, SHOWN)
    page.wait_for_timeout(400)
    assert page.eval_on_selector(picture, SHOWN) == still
    page.hover(CARDS)
    seen = set()
    for _ in range(8):
        page.wait_for_timeout(90)
        seen.add(page.eval_on_selector(picture, SHOWN))
    assert len(seen) > 2


def test_rows_that_leave_the_screen_are_used_again(open_page: Open) -> None:
    """New elements for each row that comes would make scrolling stumble."""
    page = open_page()
    page.set_viewport_size({"width": 760, "height": 520})
    page.wait_for_selector(CARDS)
    page.wait_for_timeout(800)
    names = "() => [...document.querySelectorAll('.card .clip-name')].map((name) => name.textContent)"
    first = page.evaluate(names)
    page.evaluate("document.querySelectorAll('.grid-row, .card').forEach((part) => { part.dataset.seen = 1; })")
    assert total(page) > len(first)
    for _ in range(40):
        page.evaluate("document.querySelector('.grid').scrollTop += 110")
        page.wait_for_timeout(20)
    page.wait_for_function(f"() => document.getElementById('card-{total(page) - 1}')")
    assert page.evaluate("document.querySelectorAll('.card:not([data-seen])').length") == 0
    rows = page.evaluate("[...document.querySelectorAll('.grid-row')].map((row) => row.ariaRowIndex)")
    assert len(set(rows)) == len(rows)
    last = page.evaluate(names)
    assert sorted(last) == last
    assert last[-1] > first[-1]
    page.wait_for_timeout(500)
    assert drawn(page, f"#card-{total(page) - 1} .thumb")


def test_facets_narrow_down_and_lie_in_the_address(open_page: Open, shot: Shot) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    every = total(page)
    item = page.locator(".facets section", has_text="Rig").locator("li").first
    count = int(item.locator(".count").inner_text())
    item.locator("input").check()
    page.wait_for_function("n => document.querySelector('.total').textContent.startsWith(n + ' ')", arg=str(count))
    assert "rig=" in page.url
    shot(page, "facet")
    page.reload()
    page.wait_for_function("n => document.querySelector('.total')?.textContent.startsWith(n + ' ')", arg=str(count))
    page.locator(".histogram button:has(span[style*='100%'])").first.click()
    page.wait_for_function("() => location.search.includes('seconds_from')")
    page.get_by_role("button", name="Clear").first.click()
    page.wait_for_function("n => document.querySelector('.total').textContent.startsWith(n + ' ')", arg=str(every))
    page.go_back()
    page.wait_for_function("() => location.search.includes('seconds_from')")


def test_text_and_sql_choose_clips(open_page: Open, shot: Shot) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    every = total(page)
    page.keyboard.press("/")
    page.keyboard.type(page.inner_text(f"{CARDS} .clip-name").rpartition("/")[2])
    page.wait_for_function("() => document.querySelector('.total').textContent.startsWith('1 ')")
    assert "text=" in page.url
    page.fill(".field.text input", "")
    page.wait_for_function("n => document.querySelector('.total').textContent.startsWith(n + ' ')", arg=str(every))
    page.keyboard.press("Escape")
    page.keyboard.press("q")
    page.fill(".field.where input", "seconds > 1.4 AND rig <> 'nothing'")
    page.keyboard.press("Enter")
    page.wait_for_function("n => !document.querySelector('.total').textContent.startsWith(n + ' ')", arg=str(every))
    assert 0 < total(page) < every
    shot(page, "sql")


def test_a_wrong_condition_is_explained(open_page: Open, shot: Shot) -> None:
    page = open_page("where=seconds+%3E%3E%3E")
    said = page.wait_for_selector("[role=alert]").inner_text()
    shot(page, "wrong-sql")
    assert said.strip()
    assert "Traceback" not in said
    open_page.complaints.clear()  # type: ignore[attr-defined]  # the browser tells of the answer 400


def test_sorting(open_page: Open) -> None:
    page = open_page("sort=seconds&descending=true")
    page.wait_for_selector(CARDS)
    shown = [float(text.split()[0]) for text in page.locator(f"{CARDS} .facts").all_inner_texts()[:8]]
    assert shown == sorted(shown, reverse=True)
    assert len(set(shown)) > 1


def test_selection_by_mouse_and_keys(open_page: Open, shot: Shot) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    said = page.locator(".selection output")
    page.locator(f"{CARDS} .pick").first.click()
    assert said.inner_text() == "1 selected"
    page.locator(CARDS).nth(4).click(modifiers=["Shift"])
    page.wait_for_function("() => document.querySelector('.selection output').textContent === '5 selected'")
    page.keyboard.press("Escape")
    page.wait_for_function("() => document.querySelector('.selection output').textContent.startsWith('Nothing')")
    page.focus(".grid")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Space")
    page.keyboard.press("Shift+ArrowDown")
    page.wait_for_function("() => parseInt(document.querySelector('.selection output').textContent) > 3")
    shot(page, "selected")
    page.keyboard.press("Enter")
    page.wait_for_selector(".clip-page")
    assert "view=clip" in page.url


def test_keys_are_listed_and_dark_is_a_key(open_page: Open, shot: Shot) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    page.keyboard.press("?")
    page.wait_for_selector("dialog[open] .keys")
    shot(page, "keys")
    page.keyboard.press("Escape")
    page.wait_for_selector("dialog", state="detached")
    page.keyboard.press("d")
    page.wait_for_selector("html[data-mantine-color-scheme=dark]")
    page.wait_for_timeout(300)
    shot(page, "dark")


@pytest.mark.parametrize("query", ["", "view=map", "view=work"])
def test_nothing_jumps_once_it_is_shown(open_page: Open, query: str) -> None:
    page = open_page()
    page.add_init_script(
        "window.jumped = 0; new PerformanceObserver(list => { for (const e of list.getEntries()) "
        "if (!e.hadRecentInput) window.jumped += e.value; }).observe({type: 'layout-shift', buffered: true})"
    )
    page.goto(page.url.partition("?")[0] + (f"?{query}" if query else ""))
    page.wait_for_timeout(2500)
    assert page.evaluate("window.jumped") < 0.02


def test_progress_of_a_run_is_shown(open_page: Open, shot: Shot) -> None:
    page = open_page()
    told = '{"run": {"stage": "motifs", "done": 1200, "total": 4000, "seconds_left": 75}}'
    page.route("**/api/events", lambda route: route.fulfill(content_type="text/event-stream", body=f"data: {told}\n\n"))
    page.reload()
    said = page.wait_for_selector(".run progress")
    assert said.get_attribute("value") == "1200"
    assert page.inner_text(".run span") == "Run: motifs, 1,200 of 4,000, 75 s left"
    shot(page, "run")


def test_a_lake_for_reading_alone_offers_no_decisions(open_page: Open) -> None:
    page = open_page()

    def alone(route: Any) -> None:
        answer = route.fetch()
        route.fulfill(response=answer, json=answer.json() | {"read_only": True})

    page.route("**/api/lake", alone)
    page.reload()
    page.wait_for_selector(CARDS)
    page.locator(f"{CARDS} .pick").first.click()
    assert page.get_by_role("button", name="Tag").is_disabled()
    assert page.get_by_role("button", name="Export").is_enabled()
    page.keyboard.press("t")
    assert page.locator("dialog").count() == 0
