"""Recipes: every one has what people must know, and docs/fetch.md says the same; a recipe that is none says why."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motionlake.cli._bytes import amount
from motionlake.errors import UserError
from motionlake.lake.citations import Source, read_source
from motionlake.motion.rigs import load_rigs
from motionlake.recipes.recipe import Recipe, find_recipe, parse_recipe, recipes

from tests.lakes import motionlake

PAGE = (Path(__file__).parents[1] / "docs" / "fetch.md").read_text(encoding="utf-8")
RECIPES = list(recipes().values())
# Clips of each set, as they are called.
NAMES = {
    "100style": ("Neutral_FW.bvh", {"style": "Neutral", "label": "FW"}),
    "bandai1": (
        "dataset-1_walk-back_not-confident_001.bvh",
        {"label": "walk-back", "style": "not-confident", "take": "001"},
    ),
    "bandai2": ("dataset-2_raise-up-both-hands_active_003.bvh", {"label": "raise-up-both-hands", "style": "active"}),
    "cmu": ("13_29.amc", {"subject": "13", "trial": "29"}),
    "hdm05": ("HDM_bd_cartwheelLHandStart1Reps_004_120.amc", {"subject": "bd", "label": "cartwheelLHandStart1Reps"}),
    "lafan1": (
        "fallAndGetUp2_subject3.bvh",
        {"label": "fallAndGetUp", "take": "2", "subject": "subject3"},
    ),
    "ntu": ("S001C002P003R002A013.skeleton", {"subject": "003", "label": "A013"}),
}


@pytest.mark.parametrize("recipe", RECIPES, ids=[recipe.name for recipe in RECIPES])
def test_every_recipe_says_what_people_must_know(recipe: Recipe) -> None:
    assert recipe.citation.strip()
    assert recipe.licence.terms.endswith(".")
    assert recipe.licence.accept or recipe.licence.commercial
    assert re.match(r"\d{4}-\d\d-\d\d: |never$", recipe.checked)
    assert recipe.licence.url.startswith("https://")
    for file in recipe.files:
        assert file.url.startswith("https://") or (recipe.by_hand and not file.url)
    assert recipe.homepage.startswith("https://") or recipe.name == "hdm05"  # which links itself so
    assert not recipe.rig or recipe.rig in load_rigs()
    assert recipe.size is None or recipe.size >= sum(file.size or 0 for file in recipe.files)
    text = recipe.citation.strip()
    assert text.count("{") == text.count("}")
    assert text.startswith("@") or text.endswith(".")


def test_the_recipes_that_were_asked_for_are_there() -> None:
    wanted = {"cmu", "hdm05", "lafan1", "100style", "bandai1", "bandai2", "seed", "amass", "humanml3d", "ntu", "mixamo"}
    assert wanted <= {recipe.name for recipe in RECIPES}


def test_labels_are_read_from_names() -> None:
    assert set(NAMES) == {recipe.name for recipe in RECIPES if recipe.labels}
    for name, (file, told) in NAMES.items():
        found = re.fullmatch(find_recipe(name).labels, file)
        assert found is not None, name
        assert told.items() <= found.groupdict().items()


def test_the_page_has_the_recipes() -> None:
    rows = re.findall(r"^\| `([^`]+)` \| ([^|]+) \| ([^|]+) \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", PAGE, re.MULTILINE)
    told = [
        (
            recipe.name,
            f"[{recipe.title}]({recipe.homepage})",
            "?" if recipe.clips is None else f"{recipe.clips:,}",
            amount(recipe.size),
            f"[{recipe.licence.name}]({recipe.licence.url})" + ", not commercial" * (not recipe.licence.commercial),
            "by hand" if recipe.by_hand else "fetched",
        )
        for recipe in RECIPES
    ]
    assert rows == told


def test_the_page_s_recipe_is_one() -> None:
    text = re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert text is not None
    recipe = parse_recipe(text[1], "docs/fetch.md")
    assert (recipe.name, recipe.files[0].name, recipe.licence.accept) == ("walks", "walks.zip", False)


def test_the_list() -> None:
    run = motionlake("fetch")
    assert run.status == 0
    assert all(recipe.name in run.out and recipe.licence.name in run.out for recipe in RECIPES)
    rows = motionlake("fetch", "--json").json
    assert [row["name"] for row in rows] == [recipe.name for recipe in RECIPES]
    assert rows[0]["licence"]["url"].startswith("https://")


EXAMPLE = re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)[1]  # type: ignore[index]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name = "walks"', "", "no key 'name'"),
        ('name = "walks"', 'name = "../walks"', "use letters, digits"),
        ('title = "Walks of three people"', "title = 7", "title = 7: must be of type str"),
        ("accept = false", "accept = false\nprice = 3", "unknown key 'price'"),
        ("commercial = true", "", "no key 'commercial'"),
        ('into = "walks"', 'into = "../walks"', "must be a plain name"),
        ('into = "walks"', 'into = "source.json"', "must be a plain name"),
        ('into = "walks"', 'into = ".fetch"', "must be a plain name"),
        ("https://example.org/walks.zip", "file:///etc/passwd", "must begin with https"),
        ("https://example.org/walks.zip", "https://example.org/", "must be a plain name"),
        ('unpack = "zip"', 'unpack = "rar"', "use one of zip, tar, none"),
        ("[licence]", "[licence", "TOML"),
        ("(?P<label>[a-z]+)", "([a-z]+", ""),
        ("# by_hand", "by_hand", "files with a url, and by_hand"),
    ],
)
def test_a_recipe_that_is_none_says_why(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in EXAMPLE
    file = tmp_path / "mine.toml"
    file.write_text(EXAMPLE.replace(old, new), encoding="utf-8")
    run = motionlake("fetch", file, "--to", tmp_path / "a")
    assert run.status == 2
    assert run.err.startswith(f"motionlake: recipe {file}: ")
    assert "docs/fetch.md" in run.err
    assert said.lower() in run.err.lower() or said == "TOML"
    assert not (tmp_path / "a").exists()


ANY = st.recursive(st.none() | st.booleans() | st.integers() | st.text(max_size=9), st.lists, max_leaves=3)


@settings(max_examples=60)
@given(
    said=st.dictionaries(st.sampled_from([*Source.__annotations__, "motionlake_source", "files"]), ANY), raw=st.binary()
)
@example(said={"name": "\ud800"}, raw=b"")
@example(said={}, raw=b"[" * 100_000)
def test_a_source_file_of_others_is_read_or_refused(said: dict[str, object], raw: bytes) -> None:
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "clips"
        folder.mkdir()
        for content in (json.dumps({"motionlake_source": 1, "name": "x", **said}).encode(), raw):
            (folder / "SOURCE.json").write_bytes(content)
            with suppress(ValueError):
                found = read_source(folder)
                assert found is not None
                assert found[0] == folder / "SOURCE.json"
                texts = [value for value in vars(found[1]).values() if not isinstance(value, bool | None)]
                assert "".join(texts).encode()


def test_a_recipe_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="nosuch: no such recipe; there are 100style, amass"):
        find_recipe("nosuch")
    with pytest.raises(UserError, match="cannot be read"):
        find_recipe(str(tmp_path / "none.toml"))
