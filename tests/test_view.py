"""`motionlake view`: what its pages, GIFs and strips hold, which clip stands beside, and what it refuses."""

from __future__ import annotations

import base64
import io
import json
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.lake.frames import read_clip
from motionlake.lake.layout import open_lake
from motionlake.names import safe_name
from motionlake.pictures.bands import Segment
from motionlake.pictures.clip_images import FPS, film_strip, gif_frames, motion_gif
from motionlake.pictures.player import pack, player_page
from motionlake.pictures.player_material import MOST_SECONDS, PlayerClip
from motionlake.pictures.style import png
from numpy.typing import NDArray
from PIL import Image, ImageChops

from tests.lakes import Changed, motionlake, query, quick_lake
from tests.test_pictures import NASTY, standing


class Elements(HTMLParser):
    """Elements and attributes of a page, and the text of its scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[str] = []
        self.attributes: set[str] = set()
        self.scripts: list[str] = []
        self._inside = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        self.attributes |= {name for name, _ in attrs}
        self._inside = tag == "script"

    def handle_endtag(self, tag: str) -> None:
        self._inside = False

    def handle_data(self, data: str) -> None:
        if self._inside:
            self.scripts.append(data)


def embedded(page: str) -> Any:
    """The JSON of a page."""
    return json.loads(Elements(page).scripts[0])


def moving(count: int, fps: float = 30.0) -> PlayerClip:
    """A body that walks and sways, with bands."""
    body = standing(count)
    at = np.arange(count) / fps
    body[..., 2] += at[:, None]
    body[:, 5:13] += 0.2 * np.sin(3 * at)[:, None, None]
    spans = [Segment(0, count / fps / 2, "walk"), Segment(count / fps / 2, count / fps, "kick")]
    return PlayerClip("set/a", body, fps, count, 0, [("label", "walk")], [("classes", spans)])


def unpack(text: str) -> NDArray[np.float64]:
    """[n, 21, 3] metres of what `pack` made."""
    packed = base64.b64decode(text)
    count = len(packed) // (12 + 6 * 20)
    root = np.frombuffer(packed, "<i4", 3 * count).reshape(count, 1, 3)
    others = np.frombuffer(packed, "<i2", offset=12 * count).reshape(count, 20, 3)
    return np.concatenate([root, root + others.astype(np.int64)], axis=1) / 1000


@pytest.mark.parametrize("away", [0.0, 40.0, 2000.0])
def test_packed_positions_are_within_a_millimetre(away: float) -> None:
    rng = np.random.default_rng(0)
    body = standing(50) + rng.normal(0, 0.5, (50, 21, 3)) + rng.normal(0, 1, (50, 1, 3)) * away
    found = unpack(pack(body))
    assert np.linalg.norm(found - body, axis=-1).max() < 0.001


def test_a_page_holds_every_fourth_frame_of_120_a_second() -> None:
    clip = PlayerClip("a", moving(41).positions, 120.0, 100, 7)
    told = embedded(player_page([clip]))["clips"][0]
    assert (told["first"], told["step"], told["fps"], told["count"]) == (7, 4, 30.0, 11)
    assert np.linalg.norm(unpack(told["motion"]) - clip.positions[::4], axis=-1).max() < 0.001


@pytest.mark.parametrize(("fps", "step"), [(24, 1), (29.97, 1), (30.000001, 1), (50, 2), (60, 2), (100, 4), (250, 9)])
def test_shown_rates_are_at_most_30(fps: float, step: int) -> None:
    assert PlayerClip("a", standing(), fps, 5).step == step


def test_a_minute_beside_a_minute_is_below_two_megabytes() -> None:
    assert len(player_page([moving(60 * 120, 120.0), moving(60 * 120, 120.0)])) < 2e6


def test_a_long_clip_is_cut_and_the_page_says_so() -> None:
    clip = moving(round((MOST_SECONDS + 20) * 30))
    page = player_page([clip])
    assert f"the first {MOST_SECONDS:.0f} s of {MOST_SECONDS + 20:.0f} s are shown" in page
    told = embedded(page)["clips"][0]
    assert told["count"] == MOST_SECONDS * 30
    assert told["bands"][0]["spans"][-1]["stop"] == MOST_SECONDS


@pytest.mark.parametrize("name", [*NASTY, "</script><script>alert(1)</script>", "</script x", "<!--<script ", "\udcff"])
def test_no_name_breaks_a_page(name: str) -> None:
    plain = Elements(player_page([moving(3)]))
    clip = moving(3)
    bands = [(name, [Segment(0, 1, name)])]
    page = player_page([PlayerClip(name, clip.positions, 30, 3, 0, [("label", name)], bands)])
    found = Elements(page.encode(errors="replace").decode())
    assert found.elements == plain.elements
    assert found.attributes == plain.attributes
    assert len(found.scripts) == 2
    assert "<" not in found.scripts[0]  # "</script " would close it as well, "<!--<script " keep it open
    told = embedded(page)["clips"][0]
    assert (told["name"], told["bands"][0]["spans"][0]["label"]) == (name, name)
    assert "http" not in page.replace("http-equiv", "")
    motion_gif([PlayerClip(name, clip.positions, 30, 3, 0, [("label", name)], bands)])
    png(film_strip([PlayerClip(name, clip.positions, 30, 3, 0, [("label", name)], bands)]))


def colours_of(image: Image.Image) -> NDArray[np.uint8]:
    return np.asarray(image.convert("RGB"))


def test_a_gif_plays_every_frame_at_25_a_second_for_ever() -> None:
    clips = [moving(60), moving(30)]
    image = Image.open(io.BytesIO(motion_gif(clips)))
    assert image.n_frames == gif_frames(clips) == 2 * FPS  # type: ignore[attr-defined]
    assert image.info["loop"] == 0
    seen = []
    for i in range(2 * FPS):
        image.seek(i)
        assert image.info["duration"] == 1000 / FPS
        seen.append(image.convert("RGB"))
    changes = [ImageChops.difference(a, b).getbbox() for a, b in pairwise(seen)]
    assert all(changes)
    halves = [np.asarray(i)[40:330, 346:] for i in seen]  # the second pane: it stops after a second, on its last frame
    assert (halves[-1] == halves[-20]).all()
    assert (halves[0] != halves[20]).any()


def test_a_strip_shows_a_motion_its_labels_and_its_path() -> None:
    still = PlayerClip("set/a", standing(60), 30, 60)
    walk = moving(60)
    images = [colours_of(Image.open(io.BytesIO(png(film_strip([clip]))))) for clip in (still, walk)]
    assert images[0].shape[1] == images[1].shape[1] > 1000
    for name in ("#332288", "#CC6677"):  # of the two classes
        colour = [int(name[i : i + 2], 16) for i in (1, 3, 5)]
        assert not (images[0] == colour).all(axis=-1).any()
        assert (images[1] == colour).all(axis=-1).sum() > 1000


def test_a_page_of_a_clip_of_a_lake_holds_it_beside_the_nearest(lake: Path, tmp_path: Path) -> None:
    clip, dataset, part, fps, frames = query(
        lake, "SELECT clip, dataset, part, fps, frames FROM clips ORDER BY fps DESC, clip LIMIT 1"
    )[0]
    run = motionlake("view", clip, "--lake", lake, "--out", tmp_path / "a.html", "--json")
    assert run.status == 0, run.err
    nearest = motionlake("search", clip, "-k", "1", "--recorded-only", "--lake", lake, "--json").json[0]
    assert [row["clip"] for row in run.json["clips"]] == [clip, nearest["clip"]]
    assert run.json["clips"][1]["distance"] == f"{nearest['distance']:.3f} by fused"
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    told = embedded(page)["clips"][0]
    target = open_lake(lake)
    stored = read_clip(target.path(target.frames_part(dataset, part)), clip).positions
    assert told["frames"] == frames
    assert told["fps"] == pytest.approx(fps / told["step"])
    assert np.linalg.norm(unpack(told["motion"]) - stored[:: told["step"]], axis=-1).max() < 0.001
    for text in (nearest["clip"], nearest["label"], dataset, "not stated", f"{nearest['distance']:.3f}"):
        assert text in page


def test_synthetic_clips_are_no_nearest_real_ones_and_show_their_classes(lake: Path, tmp_path: Path) -> None:
    clip = query(lake, "SELECT clip FROM clips ORDER BY clip LIMIT 1")[0][0]
    hits = motionlake("search", clip, "-k", "2", "--lake", lake, "--json").json
    made, second = (hit["clip"] for hit in hits)
    with Changed(lake) as con:
        for name in (made, second):
            con.execute("UPDATE clips SET format = 'synthetic' WHERE clip = $clip", {"clip": name})
            con.execute(
                """INSERT INTO synthetic BY NAME SELECT $clip AS clip, 'synthesis-1' AS model, '{}' AS config,
                ['walk', 'kick'] AS classes, 2.0 AS seconds, 7 AS seed, 1 AS number, 1.0 AS pace, 1.0 AS temperature,
                $seed AS seed_clip, 0 AS seed_start, 9 AS seed_stop, ['d'] AS datasets, ['l'] AS licences, $clip AS key
                """,
                {"clip": name, "seed": clip},
            )
    run = motionlake("view", clip, "--lake", lake, "--out", tmp_path / "a.html", "--json")
    (real,) = motionlake("search", clip, "-k", "1", "--recorded-only", "--lake", lake, "--json").json
    assert real["clip"] not in (made, second)
    assert [row["clip"] for row in run.json["clips"]] == [clip, real["clip"]]
    run = motionlake("view", made, "--lake", lake, "--beside", "none", "--out", tmp_path / "b.html", "--json")
    row = run.json["clips"][0]
    assert (row["made by"], row["starts from"]) == ("synthesis-1", f"{clip}, frames 0 to 9")
    words = ("--beside", "source", "--beside", second, "--out", tmp_path / "c.html", "--json")
    run = motionlake("view", made, *words, "--lake", lake)
    assert [row["clip"] for row in run.json["clips"]] == [made, clip, second]
    told = embedded((tmp_path / "b.html").read_text(encoding="utf-8"))["clips"][0]
    (band,) = told["bands"]
    assert [span["label"] for span in band["spans"]] == ["walk", "kick"]
    middle = row["stop"] / row["fps"] / 2
    assert band["spans"][0]["stop"] == band["spans"][1]["start"] == pytest.approx(middle, abs=0.6 / row["fps"])


def test_ranges_files_and_segments(lake: Path, clips_folder: Path, tmp_path: Path) -> None:
    clip, fps = query(lake, "SELECT clip, fps FROM clips ORDER BY frames DESC, clip LIMIT 1")[0]
    with Changed(lake) as con:
        con.execute("INSERT INTO segments VALUES ($c, 0, 20, 'a'), ($c, 15, 30, 'b'), ($c, 30, 40, 'c')", {"c": clip})
    words = ("--lake", lake, "--from", "10", "--to", "30", "--json")
    run = motionlake("view", clip, "--beside", "none", "--out", tmp_path / "a.html", *words)
    assert run.status == 0, run.err
    told = embedded((tmp_path / "a.html").read_text(encoding="utf-8"))["clips"][0]
    assert (told["first"], told["count"]) == (10, len(range(0, 20, told["step"])))
    spans = [(s["label"], s["start"], s["stop"], s["lane"]) for s in told["bands"][0]["spans"]]
    a, b = 10 / fps, 20 / fps
    assert spans == [
        ("a", 0, pytest.approx(a, abs=1e-4), 0),
        ("b", pytest.approx(a / 2, abs=1e-4), pytest.approx(b, abs=1e-4), 1),
    ]
    file = next(path for path in sorted(clips_folder.rglob("*")) if path.suffix in (".bvh", ".npz"))
    run = motionlake("view", file, "--beside", file, *words[:2], "--out", tmp_path / "b.gif", "--json")
    assert [row["clip"] for row in run.json["clips"]] == [file.name, file.name]
    assert Image.open(tmp_path / "b.gif").size[0] == 686
    run = motionlake("view", file, *words[:2], "--out", tmp_path / "c.png")
    assert run.status == 0, run.err
    assert run.out.strip() == str(tmp_path / "c.png")
    assert Image.open(tmp_path / "c.png").format == "PNG"


def test_a_lake_without_descriptors_and_signatures_shows_the_clip_alone(
    tmp_path: Path, clips_folder: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    lake = quick_lake(tmp_path / "lake")
    run = motionlake("ingest", next(clips_folder.glob("*/")), "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    clip = query(lake, "SELECT clip FROM clips ORDER BY clip LIMIT 1")[0][0]
    monkeypatch.chdir(tmp_path)
    run = motionlake("view", clip, "--lake", lake)
    assert run.status == 0, run.err
    assert run.err.count("\n") == 1
    assert "shown alone" in run.err
    assert run.out.strip() == f"{safe_name(clip)}.html"
    assert len(embedded((tmp_path / run.out.strip()).read_text(encoding="utf-8"))["clips"]) == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["no_such_clip"], "no_such_clip: no such clip"),
        (["CLIP", "--beside", "no_such_clip"], "no_such_clip: no such clip"),
        (["CLIP", "--beside", "source"], "was recorded"),
        (["CLIP", *["--beside", "none"] * 4], "shows 3 beside the clip at most, not 4"),
        (["CLIP", *["--beside", "none"] * 2, "--out", "a.gif"], "shows 1 beside the clip at most"),
        (["CLIP", "--out", "a.mp4"], "a.mp4: its name must end in one of .html, .gif, .png"),
        (["CLIP", "--out", "no/such/folder/a.html"], "no/such/folder: no such folder"),
        (["CLIP", "--out", "FOLDER"], "there is a folder of that name"),
        (["CLIP", "--from", "0", "--to", "1000000"], "are not a range of them"),
    ],
)
def test_mistakes_get_one_line(built_lake: Path, tmp_path: Path, words: list[str], said: str, monkeypatch: Any) -> None:
    clip = query(built_lake, "SELECT clip FROM clips ORDER BY clip LIMIT 1")[0][0]
    (tmp_path / "folder.gif").mkdir()
    monkeypatch.chdir(tmp_path)
    given = [{"CLIP": clip, "FOLDER": "folder.gif"}.get(word, word) for word in words]
    run = motionlake("view", *given, "--lake", built_lake)
    assert run.status == 2
    assert said in run.err
    assert run.err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["folder.gif"]


@pytest.mark.parametrize(
    ("clip", "name"),
    [
        ("set/clips/a b.bvh#1", "set-clips-a-b.bvh-1"),
        ("../../etc/passwd", "etc-passwd"),
        ("動き", "clip"),
        ("x" * 300, "x" * 100),
    ],
)
def test_file_names_are_safe(clip: str, name: str) -> None:
    assert safe_name(clip) == name
