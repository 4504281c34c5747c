"""motionlake search and find: answers to questions about clips."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from motionlake.cli._answers import (
    BelowOption,
    KOption,
    MirroredOption,
    OwnOption,
    PictureOption,
    check_picture,
    count_of,
)
from motionlake.cli._hits import tell_hits, what_is_alike
from motionlake.cli._output import notice, tell
from motionlake.cli._service import NoServiceOption, ask_service
from motionlake.cli.common import (
    ClipArgument,
    ClipsArgument,
    DatasetOption,
    JsonOption,
    LakeOption,
    MinQualityOption,
    RecordedOnlyOption,
    SplitOption,
    StartOption,
    StopOption,
    named_query,
    option,
)
from motionlake.errors import UserError
from motionlake.lake.layout import Lake, open_lake
from motionlake.names import printable

if TYPE_CHECKING:
    from motionlake.lake.catalog import Connection
    from motionlake.retrieval.protocol import Query, Searcher
    from motionlake.retrieval.text import LakeText
    from motionlake.retrieval.text_example import ExampleAndText


ExactOption = Annotated[
    bool,
    typer.Option("--exact", help="Compare every clip, where the method would choose some (of a large lake, minutes)."),
]


def search(
    lake: LakeOption,
    clips: ClipsArgument = None,
    start: StartOption = None,
    stop: StopOption = None,
    k: KOption = None,
    below: BelowOption = None,
    method: Annotated[
        str,
        typer.Option(
            help="What is compared: fused (signature, alignment and moves together), signature (how often which short "
            "moves occur), alignment (poses in their order), moves (how joints move, in their order), or descriptor "
            "(what a network sees)."
        ),
    ] = "fused",
    graph: Annotated[
        bool, typer.Option(help="Go along the lake's neighbour graph: near is what is near to what is near.")
    ] = True,
    exact: ExactOption = False,
    explain: Annotated[
        bool, typer.Option("--explain", help="Say what each method makes of each answer, and how much it counts.")
    ] = False,
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    min_quality: MinQualityOption = None,
    mirrored: MirroredOption = False,
    own: OwnOption = False,
    sample: Annotated[int, typer.Option(min=0, help="Also ask for so many clips of the lake, to try it out.")] = 0,
    text: Annotated[
        str | None,
        option(
            "--text", help="Clips whose labels, descriptions, segments or names say this; beside a clip both count."
        ),
    ] = None,
    encoder: Annotated[
        str | None, option("--encoder", help="--text: compare meanings too, by this encoder of an installed package.")
    ] = None,
    picture: PictureOption = None,
    no_service: NoServiceOption = False,
    as_json: JsonOption = False,
) -> None:
    """The clips most like one, nearest first.

    Where `motionlake browse` serves the lake, that answers, and sooner.

    Example: motionlake search walk_01 -k 5 --lake mylake

    A file that is not in the lake: motionlake search shots/new_take.bvh --lake mylake

    Like a part of a clip: motionlake search walk_01 --from 1s --to 3s --lake mylake

    Why these: motionlake search walk_01 -k 3 --explain --lake mylake

    By the descriptor network: motionlake search walk_01 --method descriptor --lake mylake

    In words: motionlake search --text "walks and turns left" --lake mylake

    Like a clip, and in words: motionlake search walk_01 --text angry --lake mylake

    Not by a service that runs: motionlake search walk_01 --no-service --lake mylake
    """
    target, k, names = open_lake(lake), count_of(k, below), clips or []
    if encoder is not None and text is None:
        raise UserError("--encoder: is for --text")
    asked: dict[str, Any] = {"k": k, "method": method, "explain": explain, "text": text}
    among = _scope(dataset, split, recorded_only, min_quality, mirrored, own, below)
    of_clip = {"--from": start, "--to": stop, "--explain": explain, "--mirrored": mirrored, "--below": below}
    of_clip |= {"--method": method != "fused", "--own": own}
    # What a service does not answer, and what is wrong, is told below.
    plain = graph and not (exact or no_service or encoder or picture or sample)
    if plain and (names or (text is not None and not _given(of_clip))):
        served = ask_service(target, "clip", names, start, stop, among, **asked)
        if served is not None:
            _tell_all(names, served.rows, served.notices, mirrored=mirrored, explain=explain, as_json=as_json)
            return
    from motionlake.lake.catalog import fetch, reading
    from motionlake.retrieval.protocol import Scope
    from motionlake.retrieval.registry import check_exact, check_method, searcher

    check_method("clip", method)
    check_exact("clip", method, "--exact", exact=exact)
    if method != "fused" and (explain or not graph):
        raise UserError(f"--{'explain' if explain else 'no-graph'}: is for --method fused")
    how = {"graph": graph, "explain": explain} if method == "fused" else {}
    scope = Scope(**among)
    with reading(target) as con:
        names = [*names, *(row["clip"] for row in fetch(con, "sample_clips", {"count": sample}))]
        if text is not None and not names:
            _check_clip_named({**of_clip, "--picture": picture, "--no-graph": not graph})
            said = [hit.as_row() for hit in _text(target, encoder).search(text, k, scope)]
            _tell_all([], [said], [], mirrored=False, explain=False, as_json=as_json)
            return
        if not names:
            raise UserError("search: name a clip or a clip file, give --text WORDS, or --sample N")
        check_picture(picture, len(names))
        alike = searcher("clip", method, target, exact=exact, **how)
        found: Searcher | ExampleAndText = alike
        if text is not None:
            from motionlake.retrieval.text_example import ExampleAndText

            found = ExampleAndText(alike, _text(target, encoder), text, explain=explain)
        queries = [named_query(con, target, name, start, stop) for name in names]
        answers = [[hit.as_row() for hit in hits] for hits in found.search(queries, k, scope)]
        _save_picture(con, target, picture, method, zip(names, queries, answers, strict=True))
    _tell_all(names, answers, _left_out(alike, queries), mirrored=mirrored, explain=explain, as_json=as_json)


def _scope(
    dataset: str | None, split: str | None, recorded_only: bool, min_quality: str | None, mirrored: bool, own: bool,
    below: float | None,
) -> dict[str, Any]:  # fmt: skip
    """The arguments of `Scope`."""
    return {
        "dataset": dataset, "split": split, "recorded_only": recorded_only, "mirrored": mirrored, "own": own,
        "min_quality": min_quality, "below": below,
    }  # fmt: skip


def _tell_all(
    names: Sequence[str], answers: Sequence[Sequence[Mapping[str, Any]]], left_out: Iterable[str], *, mirrored: bool,
    explain: bool, as_json: bool,
) -> None:  # fmt: skip
    """The answers to each clip, or those to a text alone."""
    for line in left_out:
        notice(f"by the other methods alone: {line}")
    if not names:
        tell_hits(answers[0], mirrored=False, as_json=as_json)
        return
    if as_json:
        tell([{"query": name, **row} for name, rows in zip(names, answers, strict=True) for row in rows], as_json=True)
        return
    for name, rows in zip(names, answers, strict=True):
        if len(names) > 1:
            print(f"\n{printable(name)}")
        tell_hits(rows, mirrored=mirrored, as_json=False)
        for line in what_is_alike(rows) if explain else ():
            print(line)


def find(
    lake: LakeOption,
    query: ClipArgument,
    start: StartOption = None,
    stop: StopOption = None,
    k: KOption = None,
    below: BelowOption = None,
    method: Annotated[
        str,
        typer.Option(
            help="What is compared: fused (short moves and how joints move, along the graph of likeness), words (which "
            "short moves occur), alignment (poses in their order), submotion (what a network sees; one answer a clip), "
            "or moves (how joints move, in their order; one answer a clip)."
        ),
    ] = "fused",
    dataset: DatasetOption = None,
    split: SplitOption = None,
    recorded_only: RecordedOnlyOption = False,
    min_quality: MinQualityOption = None,
    mirrored: MirroredOption = False,
    own: OwnOption = False,
    exact: ExactOption = False,
    picture: PictureOption = None,
    no_service: NoServiceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Where a piece of motion occurs inside other clips, nearest first.

    Frames are the clip's own, from 0. The piece must last 0.6 s for "fused" and "words" and 0.3 s for "submotion" and
    "moves", by default.

    Example: motionlake find 13_29 --from 4s --to 6s -k 5 --lake mylake

    Of a file that is not in the lake: motionlake find shots/new_take.bvh --from 0 --to 120 --lake mylake

    By the network: motionlake find 13_29 --from 480 --to 540 --method submotion --lake mylake

    Not by a service that runs: motionlake find 13_29 --from 4s --to 6s --no-service --lake mylake
    """
    target, k = open_lake(lake), count_of(k, below)
    among = _scope(dataset, split, recorded_only, min_quality, mirrored, own, below)
    if not (exact or no_service or picture):
        served = ask_service(target, "range", [query], start, stop, among, k=k, method=method)
        if served is not None:
            tell_hits(served.rows[0], mirrored=mirrored, as_json=as_json)
            return
    from motionlake.lake.catalog import reading
    from motionlake.retrieval.protocol import Scope
    from motionlake.retrieval.registry import check_exact, check_method, searcher

    check_method("range", method)
    check_exact("range", method, "--exact", exact=exact)
    check_picture(picture, 1)
    with reading(target) as con:
        found = searcher("range", method, target, exact=exact)
        piece = named_query(con, target, query, start, stop)
        (hits,) = found.search([piece], k, Scope(**among))
        rows = [hit.as_row() for hit in hits]
        _save_picture(con, target, picture, method, [(query, piece, rows)])
    tell_hits(rows, mirrored=mirrored, as_json=as_json)


def _left_out(searcher: Searcher, queries: Iterable[Query]) -> list[str]:
    """Why a method could not compare a query, whose answers are by the others."""
    from motionlake.retrieval.fused import FusedSearcher

    if not isinstance(searcher, FusedSearcher):
        return []
    return [reason for query in queries for reason in searcher.left_out[query.name]]


def _given(options: Mapping[str, object]) -> list[str]:
    """The names of those options that were given."""
    return [name for name, value in options.items() if value is not None and value is not False]


def _text(lake: Lake, encoder: str | None) -> LakeText:
    from motionlake.retrieval.text import LakeText, encoder_named

    return LakeText(lake, None if encoder is None else encoder_named(encoder))


def _check_clip_named(given: Mapping[str, object]) -> None:
    """Raises `UserError` where an option is given that says something of the clip to search for, and none is."""
    for name in _given(given):
        raise UserError(f"{name}: is for a clip to search for; name one beside --text")


def _save_picture(
    con: Connection,
    lake: Lake,
    path: Path | None,
    method: str,
    answers: Iterable[tuple[str, Query, Sequence[Mapping[str, Any]]]],
) -> None:
    """Draw the answers (what the query was called, the query, rows) of a search, if a file is named."""
    if path is None:
        return
    from motionlake.pictures.hits_page import hits_page
    from motionlake.pictures.html import picture, write_hits

    pages = [
        picture(
            f"hits-{i}", f"hits for {name}", "",
            hits_page(con, lake, query.source, rows, query.start, query.stop, about=f"distances by {method}"),
        )
        for i, (name, query, rows) in enumerate(answers, start=1)
    ]  # fmt: skip
    write_hits(path, pages)
