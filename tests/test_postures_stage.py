"""The stages "postures" and "symbols": what they make, what they make anew, and what goes with a clip."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.lake.catalog import reading
from motionlake.lake.config import LakeConfig, load_config
from motionlake.lake.frames import read_part
from motionlake.lake.layout import open_lake
from motionlake.motion.features import word_features
from motionlake.pesta import config as postures_config
from motionlake.pesta.config import PRETRAINED_POSTURES, PosturesConfig, SymbolsConfig
from motionlake.pesta.dictionary import PostureDictionary, load_dictionary
from motionlake.pesta.symbols import symbolise
from motionlake.stages import posture_dictionary
from motionlake.stages.model_kind import Selection
from motionlake.stages.posture_dictionary import POSTURE_DICTIONARY, PostureDictionaryKind
from motionlake.stages.postures import read_codes
from motionlake.stages.reader import LakeReader
from motionlake.stages.registry import ALL

from tests.lakes import QUICK, Changed, files, motionlake, query, quick_lake

STRINGS = "SELECT clip, symbols, starts FROM symbol_strings ORDER BY clip"


def run(lake: Path, scheduler: str, *words: str) -> dict[str, int]:
    """Shards made by each stage."""
    done = motionlake("run", *words, "--lake", lake, "--scheduler", scheduler, "--json")
    assert done.status == 0, done.err
    return {row["stage"]: row["shards"] for row in done.json}


def current(lake: Path) -> tuple[str, PostureDictionary]:
    ((model, file),) = query(lake, "SELECT model, file FROM models WHERE kind = 'postures' AND current")
    return model, load_dictionary(lake / file)


def expected_strings(lake: Path, config: SymbolsConfig) -> list[tuple[str, list[int], list[int]]]:
    """Clip by clip, from its frames, without the stages."""
    _, dictionary = current(lake)
    rates = dict(query(lake, "SELECT clip, fps FROM clips"))
    found = []
    for part in sorted(lake.glob("frames/*/*.parquet")):
        for clip in read_part(part):
            positions, rotations = clip.positions.astype(float), clip.rotations.astype(float)
            codes = dictionary.encode(word_features(positions, rotations, rates[clip.clip], dictionary.config.frames))
            string = symbolise(
                codes, codes_fps=30.0, fps=rates[clip.clip], n_frames=len(positions), config=config
            )  # fmt: skip
            found.append((clip.clip, string.symbols.tolist(), string.starts.tolist()))
    return sorted(found)


@pytest.mark.parametrize("reductions", [SymbolsConfig(), SymbolsConfig(runs=False, repeats=False)])
def test_strings_are_those_of_the_frames(lake: Path, scheduler: str, reductions: SymbolsConfig) -> None:
    text = f"[symbols]\nruns = {str(reductions.runs).lower()}\nrepeats = {str(reductions.repeats).lower()}\n"
    (lake / "config.toml").write_text(QUICK + text, encoding="utf-8")
    run(lake, scheduler, "symbols")
    assert query(lake, STRINGS) == expected_strings(lake, reductions)


def test_the_dictionary_is_served_with_its_strings(built_lake: Path) -> None:
    model, dictionary = current(built_lake)
    rows = query(built_lake, "SELECT symbol, model, code, posture, frames, share FROM postures ORDER BY symbol")
    assert [(r[0], r[1]) for r in rows] == [(i, model) for i in range(40)]
    np.testing.assert_array_equal(np.array([r[2] for r in rows], dtype=np.float32), dictionary.codes)
    np.testing.assert_array_equal(np.array([r[3] for r in rows], dtype=np.float32), dictionary.postures)
    codes = np.concatenate([c for f in built_lake.glob("postures/*.parquet") for _, c in read_codes(f)])
    assert [r[4] for r in rows] == np.bincount(codes, minlength=40).tolist()
    assert sum(r[5] for r in rows) == pytest.approx(1)
    distances = query(built_lake, "SELECT distance FROM posture_distances ORDER BY a, b")
    np.testing.assert_allclose(np.array(distances).reshape(40, 40), dictionary.distances, rtol=1e-6)


def test_symbols_of_a_clip_tile_its_frames(built_lake: Path) -> None:
    for clip, frames, fps in query(built_lake, "SELECT clip, frames, fps FROM clips"):
        rows = query(built_lake, "FROM clip_symbols($clip)", clip=clip)
        assert [r[0] for r in rows] == list(range(len(rows)))
        assert [r[2] for r in rows] == [0, *(r[3] for r in rows[:-1])]
        assert rows[-1][3] == frames
        assert [(r[4], r[5]) for r in rows] == [(r[2] / fps, r[3] / fps) for r in rows]


def test_a_dictionary_trained_anew_serves_once_its_strings_do(lake: Path, scheduler: str) -> None:
    strings, before = query(lake, STRINGS), query(lake, "SELECT DISTINCT model FROM postures")
    run(lake, scheduler, "postures", "--refit")
    new, _ = current(lake)
    assert query(lake, "SELECT DISTINCT model FROM postures") == before != [(new,)]
    # The same clips and seed give the same dictionary under a new name; all strings must take the name.
    assert run(lake, scheduler, "all")["symbols"] == 1
    assert query(lake, "SELECT DISTINCT model FROM postures") == [(new,)]
    assert query(lake, STRINGS) == strings
    assert set(run(lake, scheduler, "all").values()) == {0}


def test_training_on_request_makes_a_new_version(lake: Path, scheduler: str) -> None:
    said = motionlake("train", "postures", "--lake", lake, "--json")
    assert said.status == 0, said.err
    assert said.json["model"] == "postures-2" == current(lake)[0]
    assert said.json["metrics"]["occupied"] <= 40
    assert run(lake, scheduler, "all") | {"postures": 0, "symbols": 0, "graph": 0} == dict.fromkeys(ALL, 0)


def test_a_new_clip_is_coded_with_the_dictionary_there_is(lake: Path, clips_folder: Path, scheduler: str) -> None:
    strings, (model, _) = query(lake, STRINGS), current(lake)
    source = next(p for p in sorted(clips_folder.rglob("*")) if p.suffix in (".npz", ".bvh"))
    folder = lake.parent / "more"
    folder.mkdir()
    shutil.copyfile(source, folder / source.name)
    assert motionlake("ingest", folder, "--lake", lake, "--scheduler", scheduler).status == 0
    made = run(lake, scheduler, "all")
    assert (made["postures"], made["symbols"]) == (1, 1)
    assert current(lake)[0] == model
    after = query(lake, STRINGS)
    own = f"clips/{source.relative_to(clips_folder).as_posix()}"
    assert [row for row in after if not row[0].startswith("more/")] == strings
    assert [row[1:] for row in after if row[0].startswith("more/")] == [row[1:] for row in strings if row[0] == own]
    parts = {f for f in files(lake) if f.startswith("postures/")}
    assert motionlake("remove", "--dataset", "more", "--lake", lake).status == 0
    assert query(lake, STRINGS) == strings
    assert len(parts) == 2
    assert len(parts & files(lake)) == 1


def test_too_few_postures_are_one_clear_line(lake: Path, scheduler: str) -> None:
    (lake / "config.toml").write_text('[postures]\ndictionary = "kmeans"\nm = 20000\n', encoding="utf-8")
    done = motionlake("run", "postures", "--lake", lake, "--scheduler", scheduler)
    assert done.status == 2
    assert "too few for 20000 symbols" in done.err
    assert "set m below [postures]" in done.err
    assert "Traceback" not in done.err


@pytest.fixture
def pretrained(tmp_path: Path, built_lake: Path, monkeypatch: pytest.MonkeyPatch) -> PosturesConfig:
    """A pretrained dictionary: that of `built_lake`, as if it came with the package."""
    file = tmp_path / "weights" / "postures.safetensors"
    file.parent.mkdir()
    config = PosturesConfig(dictionary="kmeans", m=40)
    current(built_lake)[1].save(file)
    file.with_suffix(".json").write_text(json.dumps({"postures": asdict(config)}), encoding="utf-8")
    monkeypatch.setattr(PRETRAINED_POSTURES, "file", file)
    return config


def test_the_pretrained_dictionary_is_taken_where_it_fits(
    pretrained: PosturesConfig, built_lake: Path, clips_folder: Path, tmp_path: Path, scheduler: str
) -> None:
    assert PRETRAINED_POSTURES.fits(replace(pretrained, seed=3, max_postures=99))
    for other in ({"weights": "own"}, {"m": 41}, {"smoothing": 0.0}, {"dictionary": "som"}):
        assert not PRETRAINED_POSTURES.fits(replace(pretrained, **other))
    lake = quick_lake(tmp_path / "lake", QUICK.replace("[postures]", '[postures]\nweights = "pretrained"'))
    assert motionlake("ingest", clips_folder, "--lake", lake, "--scheduler", scheduler).status == 0
    done = motionlake("run", "postures", "--lake", lake, "--scheduler", scheduler)
    assert "takes the pretrained dictionary" in done.err
    assert "will not train" in done.err
    run(lake, scheduler, "symbols")
    ((metrics,),) = query(lake, "SELECT metrics FROM models WHERE kind = 'postures'")
    assert json.loads(metrics)["pretrained"] is True
    assert query(lake, STRINGS) == query(built_lake, STRINGS)


def test_a_lake_with_postures_enough_trains_a_dictionary_of_its_own(
    pretrained: PosturesConfig, built_lake: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(load_config(built_lake / "config.toml"), postures=pretrained)
    assert pretrained.weights == "auto"
    target = open_lake(built_lake)
    with reading(target) as con:
        ((seconds,),) = con.execute("SELECT sum(frames / fps) FROM clips").fetchall()
        enough = seconds * pretrained.fps / pretrained.m  # postures of the lake for each symbol
        for asked, taken in ((enough * 1.01, True), (enough * 0.99, False)):
            monkeypatch.setattr(postures_config, "ENOUGH", asked)
            assert POSTURE_DICTIONARY.takes_pretrained(LakeReader(con, target, config)) is taken
            wanted = replace(config, postures=replace(pretrained, weights="pretrained"))
            assert POSTURE_DICTIONARY.takes_pretrained(LakeReader(con, target, wanted))


def test_a_sample_takes_the_same_share_of_every_clip(built_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target, clips = open_lake(built_lake), len(query(built_lake, "FROM clips"))
    base = load_config(target.config_file)

    def sample(**changed: Any) -> list[np.ndarray]:
        config: LakeConfig = replace(base, postures=replace(base.postures, **changed))
        with reading(target) as con:
            return POSTURE_DICTIONARY.data(LakeReader(con, target, config), Selection()) or []

    everything = sample()
    assert sum(map(len, everything)) == query(built_lake, "SELECT sum(frames) FROM postures")[0][0]
    some = sample(max_postures=100)
    assert 90 <= sum(map(len, some)) <= 100 + clips
    for all_rows, rows in zip(everything, some, strict=True):
        assert {row.tobytes() for row in rows} <= {row.tobytes() for row in all_rows}
    for first, again in zip(some, sample(max_postures=100), strict=True):
        np.testing.assert_array_equal(first, again)
    monkeypatch.setattr(posture_dictionary, "MOST_CLIPS", 3)
    assert len(sample(max_postures=100)) == 3


def test_a_dictionary_says_how_many_symbols_are_in_use(
    lake: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = motionlake("run", "postures", "--refit", "--lake", lake, "--scheduler", scheduler)
    assert done.status == 0
    assert "dictionary: 40 of 40 symbols in use\n" in done.err
    train = PostureDictionaryKind.train
    monkeypatch.setattr(PostureDictionaryKind, "train", lambda *words: {**train(*words), "occupied": 29})
    done = motionlake("run", "postures", "--refit", "--lake", lake, "--scheduler", scheduler)
    assert done.status == 0
    assert "dictionary: only 29 of 40 symbols in use" in done.err


def test_a_lake_without_strings_gets_them(lake: Path, scheduler: str) -> None:
    strings = query(lake, STRINGS)
    con = Changed(lake)
    con.execute("DELETE FROM postures; DELETE FROM symbol_strings")
    con.execute(
        "DELETE FROM manifest WHERE stage IN ('postures', 'symbols'); DELETE FROM models WHERE kind = 'postures'"
    )
    con.close()
    clip = strings[0][0]
    for words in (["align", clip], ["sql", f"FROM align_motion('{clip}', NULL, NULL)"]):
        said = motionlake(*words, "--lake", lake)
        assert said.status == 2
        assert "no symbol strings yet; make them with `motionlake run all`" in said.err
    made = run(lake, scheduler, "all")
    assert (made["postures"], made["symbols"]) == (1, 1)
    assert query(lake, STRINGS) == strings
