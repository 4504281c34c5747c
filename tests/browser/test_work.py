"""Work: tags, labels, segments, suggestions, duplicates, faults, export, synthesis, undo."""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.browser.test_clip import clip, colours_of, mark, opened
from tests.browser.test_library import CARDS
from tests.browser_cdp import wait

__all__ = ["clip"]
Open = Callable[..., Any]
Shot = Callable[[Any, str], None]
SAID = ".sayings p:not(.error)"


def decisions(page: Any, service: str) -> list[dict[str, Any]]:
    """What was decided, as the service tells it."""
    found: list[dict[str, Any]] = page.request.get(f"{service}api/annotations?undone=true").json()["annotations"]
    return found


def test_tag_a_selection_see_it_and_undo_it(open_page: Open, shot: Shot, service: str) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    for n in range(3):
        page.locator(f"{CARDS} .pick").nth(n).click()
    page.keyboard.press("t")
    page.wait_for_selector("dialog[open]")
    page.fill("dialog input >> nth=0", "<b>looked at</b>")
    page.fill("dialog input >> nth=1", "Ada")
    shot(page, "tagging")
    page.keyboard.press("Enter")
    page.wait_for_selector(SAID)
    page.wait_for_selector(".facets section:has-text('Tags') li")
    page.wait_for_function(
        "() => [...document.querySelectorAll('.facts')].some(f => f.textContent.includes('<b>looked at</b>'))"
    )
    shot(page, "tagged")
    made = [each for each in decisions(page, service) if each["value"] == "<b>looked at</b>"]
    assert len(made) == 3
    assert {each["who"] for each in made} == {"Ada"}
    page.keyboard.press("Escape")
    page.keyboard.press("u")
    page.wait_for_function(
        "() => ![...document.querySelectorAll('.facts')].some(f => f.textContent.includes('looked at'))"
    )
    made = [each for each in decisions(page, service) if each["value"] == "<b>looked at</b>"]
    assert all(each["undone_at"] for each in made)


def test_label_from_the_map_of_keys(open_page: Open, service: str) -> None:
    page = open_page()
    page.wait_for_selector(CARDS)
    page.focus(".grid")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("x")
    page.keyboard.press("l")
    page.wait_for_selector("dialog[open]")
    page.keyboard.type("strolling")
    page.keyboard.press("Enter")
    page.wait_for_selector(SAID)
    assert any(each["kind"] == "label" and each["value"] == "strolling" for each in decisions(page, service))
    page.locator(SAID).get_by_role("button", name="Undo").click()
    page.wait_for_selector(f"{SAID} >> text=Undone")


def test_a_marked_range_is_named(open_page: Open, shot: Shot, service: str, clip: str) -> None:
    page = opened(open_page, clip)
    mark(page, (0.6, 0.8))
    page.keyboard.press("n")
    page.wait_for_selector("dialog[open]")
    page.keyboard.type("strut")
    page.keyboard.press("Enter")
    page.wait_for_selector(SAID)
    page.wait_for_selector(".band-titles >> text=Decided")
    page.wait_for_timeout(300)
    shot(page, "segment-named")
    (made,) = [each for each in decisions(page, service) if each["value"] == "strut"]
    assert made["kind"] == "segment"
    assert made["from"] < made["to"]


def test_edges_of_segments_are_dragged(open_page: Open, shot: Shot, service: str, clip: str) -> None:
    page = opened(open_page, clip)
    correct = page.get_by_role("button", name="Correct segments")
    if correct.is_disabled():
        pytest.skip("made clips have no segments: MOTIONLAKE_DATA")
    correct.click()
    edge = page.locator(".edge").nth(1)
    box = edge.bounding_box()
    page.mouse.move(box["x"] + 7, box["y"] + 8)
    page.mouse.down()
    page.mouse.move(box["x"] - 60, box["y"] + 8, steps=5)
    shot(page, "edge-dragged")
    page.mouse.up()

    def holding() -> list[bool]:
        """Whether each correction holds, the newest first."""
        made = [each for each in decisions(page, service) if each["kind"] == "segment" and each["value"] != "strut"]
        return [each["undone_at"] is None for each in made]

    wait(lambda: holding() == [True])
    page.locator(".edge").nth(1).focus()
    for _ in range(5):
        page.keyboard.press("ArrowLeft")
    wait(lambda: holding() == [True, False])
    shot(page, "edge-moved")


def test_suggested_labels_are_accepted_and_rejected(open_page: Open, shot: Shot, service: str) -> None:
    page = open_page("view=work")
    page.wait_for_selector(".queue", timeout=180_000)
    page.wait_for_timeout(900)
    assert colours_of(page) > 200
    shot(page, "suggestions")
    waiting = page.locator(".queue li").count()
    page.keyboard.press("y")
    page.wait_for_selector(f"{SAID} >> text=accepted")
    wait(lambda: page.locator(".queue li").count() < waiting)
    if waiting > 1:
        page.keyboard.press("x")
        page.wait_for_selector(f"{SAID} >> text=rejected")
    kinds = {each["kind"] for each in decisions(page, service)}
    assert "accept" in kinds


def test_near_duplicates_pair_by_pair(open_page: Open, shot: Shot, service: str) -> None:
    page = open_page("view=work&tab=duplicates")
    page.wait_for_selector(".queue", timeout=180_000)
    page.wait_for_timeout(1200)
    assert colours_of(page) > 200
    shot(page, "duplicates")
    page.keyboard.press("y")
    page.wait_for_selector(f"{SAID} >> text=One recording")
    made = [each for each in decisions(page, service) if each["kind"] == "duplicate"]
    assert made[0]["value"].startswith("same:")
    page.wait_for_function("() => [...document.querySelectorAll('.queue small')].some(s => s.textContent === 'same')")


def test_faults_one_by_one(open_page: Open, shot: Shot, service: str) -> None:
    page = open_page("view=work&tab=faults")
    page.wait_for_selector(".queue, .message:not([role=status])", timeout=60_000)
    if not page.locator(".queue").count():
        pytest.skip("no fault in these clips")
    page.wait_for_timeout(1200)
    assert colours_of(page) > 200
    shot(page, "faults")
    page.keyboard.press("x")
    page.wait_for_selector(f"{SAID} >> text=No fault")
    assert any(each["kind"] == "fault" and each["value"].startswith("false:") for each in decisions(page, service))


def test_decisions_are_listed_exported_and_undone(open_page: Open, shot: Shot, service: str, tmp_path: Path) -> None:
    page = open_page("view=work&tab=log")
    page.wait_for_selector(".work")
    name = page.request.get(f"{service}api/clips?limit=1").json()["clips"][0]["clip"]
    origin = service.rstrip("/")
    page.request.post(
        f"{service}api/annotations",
        data={"clips": [name], "kind": "label", "value": "kept"},
        headers={"Origin": origin},
    )
    page.reload()
    page.wait_for_selector(".log >> text=kept")
    shot(page, "decided")
    with page.expect_download() as waiting:
        page.get_by_role("button", name="labels.csv").click()
    waiting.value.save_as(tmp_path / "labels.csv")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "labels.csv").read_text(encoding="utf-8"))))
    assert any(row["label"] == "kept" for row in rows)
    page.locator("tr", has_text="kept").get_by_role("button", name="Undo").click()
    page.wait_for_selector(".log >> text=kept", state="detached")


def test_a_cut_is_exported(open_page: Open, shot: Shot, clip: str, tmp_path: Path) -> None:
    page = opened(open_page, clip)
    mark(page, (0.3, 0.6))
    page.keyboard.press("e")
    page.wait_for_selector("dialog[open]")
    page.select_option("dialog select", "bvh")
    shot(page, "export")
    with page.expect_download(timeout=90_000) as waiting:
        page.locator("dialog").get_by_role("button", name="Export").click()
    waiting.value.save_as(tmp_path / "cut.zip")
    with zipfile.ZipFile(tmp_path / "cut.zip") as packed:
        assert any(name.endswith(".bvh") for name in packed.namelist())


def test_new_motion_is_made_and_seen_beside_its_source(open_page: Open, shot: Shot, clip: str) -> None:
    page = opened(open_page, clip)
    page.keyboard.press("m")
    page.wait_for_selector("dialog[open]")
    shot(page, "make")
    page.locator("dialog").get_by_role("button", name="Make").last.click()
    page.wait_for_selector(".pane-name:has-text('made motion'), .sayings .error", timeout=240_000)
    page.wait_for_timeout(1500)
    shot(page, "made")
    if page.locator(".sayings .error").count():
        said = page.inner_text(".sayings .error")
        open_page.complaints.clear()  # type: ignore[attr-defined]
        pytest.skip(f"this lake makes no motion: {said}")
