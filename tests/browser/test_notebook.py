"""The player that a motion shows in a notebook, in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tests.test_notebooks import moving

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def test_a_motion_plays_in_its_frame(browser: Browser, tmp_path: Path) -> None:
    """The notebook around it is out of reach of its script, and it asks no network for anything."""
    file = tmp_path / "notebook.html"
    file.write_text(f"<!DOCTYPE html><title>notebook</title>{moving()._repr_html_()}", encoding="utf-8")
    page = browser.new_page(viewport={"width": 900, "height": 900})
    asked: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(file.as_uri())
    frame = page.frame_locator("iframe")
    before = frame.locator("#time").inner_text()
    assert "of 60" in before
    frame.locator("#play").click()
    page.wait_for_function("() => true", timeout=1000)
    frame.locator("#time", has_text="frame 0 of").wait_for(state="detached", timeout=10_000)
    inside = page.frames[1]
    assert inside.evaluate("() => { try { return parent.document.title; } catch (error) { return error.name; } }") == (
        "SecurityError"
    )
    assert inside.evaluate("document.documentElement.scrollHeight <= innerHeight + 1")
    page.close()
    assert complaints == []
    assert [url for url in asked if url.startswith(("http", "ws"))] == []
