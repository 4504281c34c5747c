"""Search in words: how texts are read, what a query finds, alone, beside a clip, in SQL and in Python."""

from __future__ import annotations

import importlib.metadata
import math
import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from statistics import fmean

import motionlake as library
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import open_lake
from motionlake.retrieval.sql_functions import connect
from motionlake.retrieval.text import LakeText
from motionlake.retrieval.text_index import TextIndex
from motionlake.retrieval.text_words import Spelling, numbers, stem, term, terms, words

from tests.lakes import Changed, motionlake, query
from tests.text_queries import (
    Ranking,
    SaidClip,
    expected,
    ours,
    plain_bm25,
    read_clips,
    read_queries,
    recall,
    substrings,
)

# Clips as some lake might have them: a name, a label, and what else is said.
SAID: Mapping[str, tuple[str, ...]] = {
    "shots/a01": ("walk", "slowly, then turns left"),
    "shots/a02": ("walk", "angry"),
    "shots/a03": ("run", "angry"),
    "shots/kickLFront_01": ("kickLFront1Reps",),
    "shots/kickRFront_02": ("kickRFront1Reps",),
    "gym/12": ("sit_to_stand",),
    "gym/13": ("stand_to_sit",),
    "gym/14": ("basketball_shoot", "free throw"),
    "gym/15": ("JumpJack", "ArmCircle"),
    "gym/16": ("cartwheels",),
}
FIRST: Mapping[str, tuple[str, ...]] = {
    "walking": ("shots/a02",),  # which says little else
    "walks and turns left": ("shots/a01",),
    "turned to the left": ("shots/a01",),
    "furious stroll": ("shots/a02",),
    "angrily running": ("shots/a03",),
    "kicks with the left leg": ("shots/kickLFront_01",),
    "kick right": ("shots/kickRFront_02",),
    "getting up": ("gym/12",),
    "sits down": ("gym/13",),
    "sit to stand": ("gym/12",),
    "stand to sit": ("gym/13",),
    "shooting hoops": ("gym/14",),
    "jumping jacks": ("gym/15",),
    "cart wheel": ("gym/16",),
    "cartweel": ("gym/16",),
    "ball": ("gym/14",),
}


def scores(said: Sequence[Sequence[str]], text: str) -> np.ndarray:
    index = TextIndex(said)
    return index.scores(index.asked(text))


@pytest.mark.parametrize("text", FIRST)
def test_words_find_what_says_them_in_other_words(text: str) -> None:
    found = scores(list(SAID.values()), text)
    best = [name for name, score in zip(SAID, found, strict=True) if score == max(found) > 0]
    assert tuple(best) == FIRST[text]


def test_a_text_without_any_of_the_words_is_no_answer() -> None:
    found = scores([("walk",), ("swim",), ("play chess",)], "strolling")
    assert found[0] > 0
    assert not found[1:].any()
    assert not scores([("walk",)], "zzz qqqqq").any()


def test_names_are_cut_into_words() -> None:
    assert words("kickLFront1Reps") == ["kick", "l", "front", "reps"]
    assert words("HDM_bd_BVHFile-walk.left") == ["hdm", "bd", "bvh", "file", "walk", "left"]
    assert words("He is the PERSON who Café-ﬁghts") == ["café", "fights"]
    assert numbers("a10_s1_t007 00") == ["10", "1", "7", "0"]
    assert terms("walks to the left") == ["walk", "left", "walk left"]


def test_a_rare_word_does_not_pass_the_one_it_stands_for() -> None:
    said = [("run", f"take {name}") for name in "abcdefgh"] + [("dash",)]
    found = scores(said, "run")
    assert found[:8].min() > found[8] > 0


@given(
    st.lists(st.lists(st.sampled_from(["ab", "cd", "ef", "gh"]), min_size=1, max_size=4), min_size=1, max_size=6),
    st.sampled_from(["ab", "cd", "ef", "gh"]),
)
def test_scores_are_those_of_bm25_by_its_formula(said: list[list[str]], word: str) -> None:
    index = TextIndex(said)
    held = [set(terms_of) for terms_of in ([one for part in text for one in terms(part)] for text in said)]
    count, mean = sum(word in each for each in held), fmean(len(each) for each in held)
    idf = math.log(1 + (len(held) - count + 0.5) / (count + 0.5))
    wanted = [idf * (word in each) / (1 + 1.5 * (0.9 + 0.1 * len(each) / mean)) for each in held]
    assert index.scores([{word: 1.0}] if count else []) == pytest.approx(wanted, rel=1e-5)


@given(st.text(max_size=60), st.text(max_size=40))
def test_any_text_can_be_said_and_asked(said: str, asked: str) -> None:
    assert np.isfinite(scores([(said,), ("walk",)], asked)).all()


@given(
    st.sets(st.text("abcdef", min_size=1, max_size=8), min_size=1, max_size=12),
    st.text("abcdef", min_size=4, max_size=8),
)
def test_words_spelled_alike_share_pieces(known: set[str], word: str) -> None:
    def pieces(one: str) -> set[str]:
        whole = f"^{one}$"
        return {whole[i : i + n] for n in (2, 3) for i in range(len(whole) - n + 1)}

    alike = {one: 2 * len(pieces(one) & pieces(word)) / (len(pieces(one)) + len(pieces(word))) for one in known}
    best = max(alike.values())
    wanted = {one: value for one, value in alike.items() if value >= max(0.5, best - 0.05)}
    spelling = Spelling(known)
    assert spelling.alike(word) == pytest.approx(wanted)
    assert spelling.parts(word) == sorted(one for one in known if word in one != word)


def test_every_entry_of_the_table_is_a_word_or_a_pair() -> None:
    table = tomllib.loads(files("motionlake.retrieval").joinpath("synonyms.toml").read_text(encoding="utf-8"))
    for line in [*table["same"], *table["kinds"], *table["kinds"].values()]:
        entries = [term(entry) for entry in line.split(",")]
        assert all(1 <= len(entry.split()) <= 2 for entry in entries), line
        assert len(set(entries)) == len(entries), line


def means(clips: Sequence[SaidClip], queries: str) -> dict[str, float]:
    """Recall@10 of each way to search, over the queries of a file."""
    asked = read_queries(queries)
    ways: dict[str, Ranking] = {"ours": ours(clips), "substrings": substrings(clips), "bm25": plain_bm25(clips)}
    wanted = [expected(each, clips) for each in asked]
    assert all(map(any, wanted))
    return {
        name: fmean(recall(way(each["text"]), of, 10) for each, of in zip(asked, wanted, strict=True))
        for name, way in ways.items()
    }


@pytest.mark.recordings
def test_forty_queries_over_the_recordings(recordings: Path) -> None:
    """Measured .920 (ours), .248 (substrings), .205 (plain BM25) when they were first looked at."""
    assert len(read_queries("text_queries.toml")) == 40
    found = means(read_clips(recordings), "text_queries.toml")
    assert found["ours"] >= max(0.9, found["substrings"], found["bm25"])


def test_recall_is_that_of_the_first_ten() -> None:
    wanted = [True] * 12 + [False] * 12
    assert recall(np.arange(24.0), wanted) == 0
    assert recall(-np.arange(24.0) + 30, wanted) == 1
    assert recall(np.array([0.0, 2.0, 1.0]), [True, True, False]) == 0.5  # what is no answer finds nothing
    clips = [SaidClip(name, {"label": said[0], "file": name}, said[1:]) for name, said in SAID.items()]
    assert expected({"expected": [{"label": "WALK", "segment": "angry"}]}, clips) == [
        name == "shots/a02" for name in SAID
    ]


def test_a_lake_says_what_its_label_files_say(built_lake: Path, clips_folder: Path) -> None:
    with reading(open_lake(built_lake)) as con:
        rows = {row["clip"]: row["says"] for row in fetch(con, "clip_texts")}
    said = {clip.name: clip.text for clip in read_clips(clips_folder.parent, [clips_folder.name])}
    assert rows.keys() == said.keys()
    for clip, parts in said.items():
        assert sorted(rows[clip].splitlines()) == sorted(parts)


def label_of(lake: Path) -> str:
    return str(query(lake, "SELECT label FROM clips ORDER BY clip LIMIT 1")[0][0])


def test_the_command_finds_labels_and_says_where(built_lake: Path) -> None:
    label = label_of(built_lake)
    run = motionlake("search", "--text", label, "-k", 50, "--json", "--lake", built_lake)
    assert run.status == 0, run.err
    first = run.json[0]
    assert (first["label"], first["distance"], first["rank"]) == (label, 0.0, 1)
    assert f"label: {label}" in first["text"]
    assert [row["distance"] for row in run.json] == sorted(row["distance"] for row in run.json)
    shown = motionlake("search", "--text", label, "-k", 1, "--lake", built_lake)
    assert "text" in shown.out.splitlines()[0].split()


def test_segments_and_attributes_are_found(lake: Path) -> None:
    names = [row[0] for row in query(lake, "SELECT clip FROM clips ORDER BY clip LIMIT 2")]
    with Changed(lake) as con:
        con.execute("INSERT INTO segments VALUES ($1, 0, 5, 'handstand')", [names[0]])
        con.execute(
            "UPDATE clips SET attributes = MAP {'mood': 'utterly \x1b[31m cheerful'} WHERE clip = $1", [names[1]]
        )
    segment = motionlake("search", "--text", "upside down", "-k", 1, "--json", "--lake", lake).json[0]
    assert (segment["clip"], segment["text"]) == (names[0], "segment: handstand")
    mood = motionlake("search", "--text", "joyful", "-k", 1, "--lake", lake)
    assert names[1] in mood.out.replace("\n", "")
    assert "\x1b" not in mood.out


def test_a_number_finds_the_clips_that_are_named_by_it(built_lake: Path) -> None:
    says = LakeText(open_lake(built_lake))
    names = [row[0] for row in query(built_lake, "SELECT clip FROM clips ORDER BY clip")]
    subjects = dict(query(built_lake, "SELECT clip, subject FROM clips"))
    number = next(found for name in names for found in numbers(name))
    found = {hit.clip for hit in says.search(f"take 0{number}", 100)}
    assert found == {name for name in names if number in numbers(f"{name} {subjects[name] or ''}")}


def test_scopes_leave_clips_out(built_lake: Path) -> None:
    label = label_of(built_lake)
    dataset = query(built_lake, "SELECT DISTINCT dataset FROM clips")[0][0]
    with library.open_lake(built_lake) as lake:
        assert lake.search(text=label, k=50, dataset=dataset).df().equals(lake.search(text=label, k=50).df())
        assert len(lake.search(text=label, dataset="nothing")) == 0
        assert len(lake.search(text=label, split="train")) == 0
        assert len(lake.search(text=label, k=0)) == 0


def test_beside_a_clip_both_count(built_lake: Path) -> None:
    label = label_of(built_lake)
    other = query(built_lake, "SELECT clip FROM clips WHERE label <> $label ORDER BY clip LIMIT 1", label=label)[0][0]
    run = motionlake("search", other, "--text", label, "-k", 50, "--explain", "--json", "--lake", built_lake)
    assert run.status == 0, run.err
    alone = {row["clip"]: row for row in motionlake("search", other, "-k", 50, "--json", "--lake", built_lake).json}
    assert {row["clip"] for row in run.json} == alone.keys()
    last, first = (of(row["distance"] for row in alone.values()) for of in (max, min))
    for row in run.json:
        *alike, text = row["shares"]
        assert text["method"] == "text"
        assert sum(share["weight"] for share in row["shares"]) == pytest.approx(1)
        like = (last - alone[row["clip"]]["distance"]) / (last - first)
        assert row["distance"] == pytest.approx(1 - (like + text["near"]) / 2)
        assert alike
    named = [row for row in run.json if row["label"] == label]
    best = min(named, key=lambda row: alone[row["clip"]]["rank"])
    assert run.json[0]["clip"] == best["clip"]  # of those that are called so, the one most like the example


def test_sql_answers_the_same(built_lake: Path) -> None:
    label = label_of(built_lake)
    told = motionlake("search", "--text", label, "--json", "--lake", built_lake).json
    con = connect(built_lake)
    text = "SELECT s.clip FROM clips_saying($text) s JOIN clips USING (clip) WHERE frames > 0 ORDER BY rank"
    assert con.sql(text, params={"text": label}).fetchall() == [(row["clip"],) for row in told]
    assert con.sql("FROM clips_saying($text)", params={"text": "'; DROP TABLE zzzz; --"}).fetchall() == []
    beside = motionlake("search", told[0]["clip"], "--text", label, "--json", "--lake", built_lake).json
    named = con.sql("SELECT clip FROM clips_saying($1, query := $2)", params=[label, told[0]["clip"]]).fetchall()
    assert named == [(row["clip"],) for row in beside]


def test_an_encoder_of_ones_own(built_lake: Path) -> None:
    label = label_of(built_lake)

    def encoder(texts: Sequence[str]) -> np.ndarray:
        return np.array([[float(label in text or text == "ambulation"), 0.1] for text in texts])

    with library.open_lake(built_lake) as lake:
        assert len(lake.search(text="ambulation")) == 0
        assert lake.search(text="ambulation", encoder=encoder)[0]["label"] == label
        with pytest.raises(UserError, match=r"must give .* a row of finite numbers"):
            lake.search(text="ambulation", encoder=lambda texts: np.zeros(3))


def test_an_encoder_of_a_package(built_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    point = importlib.metadata.EntryPoint("ones", "numpy:ones_like", "motionlake.text_encoders")
    broken = importlib.metadata.EntryPoint("broken", "no_such_module:encode", "motionlake.text_encoders")
    found = importlib.metadata.EntryPoints([point, broken])
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found.select(group=group))
    refused = motionlake("search", "--text", "walk", "--encoder", "other", "--lake", built_lake)
    assert (refused.status, refused.err.count("\n")) == (2, 1)
    assert "broken, ones" in refused.err
    failed = motionlake("search", "--text", "walk", "--encoder", "broken", "--lake", built_lake)
    assert (failed.status, failed.err.count("\n")) == (2, 1)
    wrong = motionlake("search", "--text", "walk", "--encoder", "ones", "--lake", built_lake)
    assert wrong.status == 2


@pytest.mark.parametrize(
    ("words_", "says"),
    [
        (["--text", "the of a"], "no word"),
        (["--text", " ".join(f"w{'x' * i}" for i in range(101))], "the most is 100"),
        (["--text", "walk", "--explain"], "--explain: is for a clip"),
        (["--text", "walk", "--picture", "a.png"], "--picture: is for a clip"),
        (["--text", "walk", "--method", "moves"], "--method: is for a clip"),
        (["--text", "walk", "--from", "0"], "--from: is for a clip"),
        (["--encoder", "one"], "--encoder: is for --text"),
        ([], "give --text WORDS"),
    ],
)
def test_mistakes_are_said_in_one_line(built_lake: Path, words_: list[str], says: str) -> None:
    run = motionlake("search", *words_, "--lake", built_lake)
    assert (run.status, run.err.count("\n")) == (2, 1)
    assert says in run.err


def test_endings_do_not_matter() -> None:
    assert stem("walking") == stem("walks") == stem("walked") == "walk"
