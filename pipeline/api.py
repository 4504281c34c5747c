"""A lake in Python: `motionlake.open_lake(path)`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict, TypeVar, Unpack, cast

from motionlake.errors import UserError, told_by_sql
from motionlake.lake import layout, stores
from motionlake.lake.rows import Rows

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa
    from motionlake.lake.clip_dataset import ClipDataset
    from motionlake.lake.safe import LakeConnection
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.pictures.answers import Asked, Hits
    from motionlake.retrieval.alignment import AlignmentRangeSearcher
    from motionlake.retrieval.protocol import Finds, Searcher
    from motionlake.retrieval.text import Encoder

T = TypeVar("T")
Clip: TypeAlias = str | Path  # a clip of the lake by its name or the end of it, else a clip file, as is every `Path`
ClipRange: TypeAlias = tuple[Clip, int | None, int | None]  # its frames [start, stop)


class ScopeOptions(TypedDict, total=False):
    """Which clips may be answers (`motionlake.retrieval.protocol.Scope`)."""

    dataset: str | None
    split: str | None
    recorded_only: bool
    min_quality: str | None
    mirrored: bool
    own: bool
    below: float | None


def open_lake(path: str | Path) -> Lake:
    """Open a lake to ask it for clips, motions and the nearest of them.

    Make one first: `motionlake ingest FOLDER --lake PATH`, then `motionlake run all --lake PATH`.

    Examples:
        >>> import motionlake
        >>> lake = motionlake.open_lake("mylake")
        >>> lake
        <motionlake.Lake mylake>

    Args:
        path: its folder; the address that `motionlake browse` prints ("http://127.0.0.1:8765/?token=…"): then the
            service answers (docs/browse.md); or its address in a bucket ("s3://bucket/lake"): then a copy in the user's
            cache, which is brought up to date now (docs/buckets.md).

    Raises:
        UserError: there is no lake, or it is of another version; nobody answers at the address.
    """
    if str(path).startswith(("http://", "https://")):
        remote: Lake = import_module("motionlake.client").RemoteLake(str(path))
        return remote
    if isinstance(path, str) and stores.is_address(path):
        found = import_module("motionlake.lake.bucket").Bucket(path)
        return Lake(import_module("motionlake.lake.cached").copy_of(found, lambda what, done, total: None))
    return Lake(path)


class Lake:
    """A lake that is open for reading.

    Clips are named as on the command line: in full ("clips/humanoid3d_walk.txt"), or by an end that no other clip has
    ("humanoid3d_walk"). Queries may also be clip files, which need not be in the lake. What is wrong with a name or a
    number is said by a `motionlake.UserError` of one line.

    A lake may be written to while it is open here: the next call answers from what there is then. Use one `Lake` for
    each thread. Close it, or open it `with motionlake.open_lake(path) as lake:`.

    Attributes:
        path: its folder.
    """

    def __init__(self, path: str | Path) -> None:
        from motionlake.lake.catalog import reading

        self._lake, self.path = layout.open_lake(path), Path(path)
        with reading(self._lake):
            pass  # a lake of another version is told of here, not by the first question
        self._connection: LakeConnection | None = None
        self._served: tuple[int, int] | None = None
        self._kept: dict[tuple[object, ...], Any] = {}

    def clips(self, where: str | None = None, **equal: str | float | None) -> Rows:
        """The clips and what is known of each: dataset, rig, frames, fps, seconds, label, subject, split and more.

        Examples:
            >>> lake.clips(label="kick")[0]["seconds"]
            2.3333333333333335
            >>> [row["clip"] for row in lake.clips("seconds > 3.2")]
            ['clips/humanoid3d_jump.txt', 'clips/humanoid3d_spin.txt']

        Args:
            where: a condition in SQL over the columns of the table `clips`.
            equal: a column and the value that it must have; None where it must be empty.

        Raises:
            UserError: a condition that DuckDB does not understand, or no such column.
        """
        return Rows(_asked(lambda: self._clips(where, equal).order("clip").to_arrow_table()))

    def motion(self, clip: Clip) -> CanonicalMotion:
        """The motion of a clip on the canonical skeleton of 21 joints.

        Examples:
            >>> motion = lake.motion("humanoid3d_walk")
            >>> motion
            <CanonicalMotion: 60 frames, 30 a second, 2 s>
            >>> motion.positions.shape, motion.rotations.shape  # metres, y up; (w, x, y, z)
            ((60, 21, 3), (60, 21, 4))
            >>> motion.joints[:3], motion.parents[:3], motion.rest_offsets.shape
            (('hips', 'spine', 'chest'), (-1, 0, 1), (21, 3))

        Args:
            clip: of the lake, or a clip file (its first body).

        Raises:
            UserError: no clip or several are meant, or the file cannot be read.
        """
        from motionlake.lake.frames import canonical_motion
        from motionlake.stages.frames import first_body

        query = self._query(clip)
        if isinstance(query, Path):
            return first_body(self._lake, query)[1]
        return canonical_motion(self._con.own, self._lake, query)

    def frames(
        self,
        clip: str | None = None,
        where: str | None = None,
        *,
        columns: Sequence[str] | None = None,
        **equal: str | float | None,
    ) -> pa.Table:
        """Stored frames as an Arrow table, a row a frame: by clip and frame, a column for each channel.

        Channels are `root_x` to `root_z` (the hips), `<joint>_x` to `<joint>_z` of the other joints, in metres, y up,
        and `<joint>_qw` to `<joint>_qz`, local rotations. Of a large lake, ask for few columns or by `sql`.

        Examples:
            >>> lake.frames("humanoid3d_walk", columns=["frame", "root_x"]).shape
            (60, 2)
            >>> lake.frames(label="kick").column("frame").to_pylist()[:3]
            [0, 1, 2]

        Args:
            clip: the frames of one clip.
            where: the frames of the clips that `clips` gives for this condition.
            equal: and for these values.
            columns: these alone.

        Raises:
            UserError: as `clips` and `motion`; or no such column.
        """
        named = {} if clip is None else {"clip": self._name(clip)}

        def ask() -> pa.Table:
            chosen = self._clips(where, equal | named)
            found = self._con.table("frames").join(chosen, "clip", how="semi").order("clip, frame")
            return (found if columns is None else found.select(*columns)).to_arrow_table()

        return _asked(ask)

    def search(
        self,
        query: Clip | None = None,
        k: int = 10,
        *,
        start: int | None = None,
        stop: int | None = None,
        method: str = "fused",
        text: str | None = None,
        encoder: str | Encoder | None = None,
        exact: bool = False,
        **scope: Unpack[ScopeOptions],
    ) -> Hits:
        """The clips most like one, or those that say what is asked for, nearest first.

        Examples:
            >>> hits = lake.search("humanoid3d_walk", k=3)
            >>> hits
            <3 rows: rank, clip, distance, mirrored, label, dataset, seconds>
            >>> hits.df()["rank"].tolist()
            [1, 2, 3]
            >>> len(lake.search("humanoid3d_walk", k=2, method="descriptor"))
            2
            >>> lake.search(text="somebody kicks", k=1)[0]["clip"]
            'clips/humanoid3d_kick.txt'

        Args:
            query: a clip of the lake, or a clip file; None: look for the text alone.
            k: how many at most.
            method: "fused" (signature, alignment and moves together, along the neighbour graph), "signature"
                (histograms of motion words; Deep Motifs, section 4.3), "alignment" (strings of postures; PESTA, section
                6), "moves" (joints over time, warped) or "descriptor" (one vector a clip; DeepHuMS, section 3.2).
            start: first frame of the part of it that counts, at its own rate; None: its first.
            stop: frame after the last; None: after its last.
            text: what labels, descriptions, segments or names of clips should say; beside a clip, both count the same.
            encoder: compare meanings of texts as well: a function that gives n texts [n, d] numbers, or the name of one
                that an installed package brings.
            exact: compare every clip, where the method would choose some (of a large lake, minutes).
            scope: `dataset`: from its clips only; `split`: from clips of this split only; `recorded_only`: synthetic
                clips are no answers; `min_quality`: the worst verdict of stage "quality" that an answer may have ("ok",
                "doubtful"); `mirrored`: search for the mirror image too, the nearer of both counts; `own`: the
                query may be an answer itself; `below`: answers are nearer than this distance.

        Raises:
            UserError: as `motion`; an unknown method, or the lake is not ready for it; neither a clip nor a text.
        """
        if text is None:
            if query is None:
                raise UserError("search: name a clip or a clip file, or give a text")
            return self._search("clip", method, (query, start, stop), k, scope, **self._exactly("clip", method, exact))
        if exact:
            raise UserError("exact: is for a clip without a text")
        return self._search_text(text, encoder, None if query is None else (query, start, stop), k, method, scope)

    def find(
        self,
        query: Clip,
        start: int | None = None,
        stop: int | None = None,
        k: int = 10,
        *,
        method: str = "fused",
        exact: bool = False,
        **scope: Unpack[ScopeOptions],
    ) -> Hits:
        """Where a motion occurs inside the clips: ranges of frames, nearest first.

        Examples:
            >>> hits = lake.find("humanoid3d_walk", 0, 30, k=2)
            >>> hits.columns[:5]
            ['rank', 'clip', 'start', 'stop', 'distance']

        Args:
            query: a clip of the lake, or a clip file.
            start: its first frame that is asked for, at its own rate; by default 0.
            stop: the frame after the last; by default that after its last.
            k: how many at most.
            method: "fused" (words and moves together), "words" (histograms of motion words; Deep Motifs, section
                6.1), "alignment" (see `align`), "moves" (how joints move) or
                "submotion" (a network that says which clips hold the motion; DeepHuMS, section 3.3.5).
            exact: look into every clip, where the method would choose some.
            scope: as of `search`; `own`: ranges that overlap the query in its own clip may be answers.

        Raises:
            UserError: as `search`; the query has no such frames, or too few.
        """
        return self._search("range", method, (query, start, stop), k, scope, **self._exactly("range", method, exact))

    def suggest_labels(self, dataset: str | None = None, column: str = "label", min_quality: str | None = None) -> Rows:
        """Labels for the clips that have none: those of the labelled clips most like them, the surest first.

        Nothing is written into the lake.

        Examples:
            >>> len(lake.suggest_labels())  # every clip has one
            0

        Args:
            dataset: only for clips of this dataset.
            column: of labels.csv that holds the labels.
            min_quality: learn from clips with this verdict at worst.

        Raises:
            UserError: no such column, fewer than two labelled clips, or the lake is not ready for search.
        """
        from motionlake.retrieval.suggestions import LabelSuggester

        by = self._searcher("clip", "fused")
        found = LabelSuggester(self._lake, by, column, min_quality=min_quality).suggest(dataset)
        return Rows.of(asdict(each) for each in found)

    def align(
        self,
        query: Clip,
        start: int | None = None,
        stop: int | None = None,
        k: int = 10,
        *,
        method: str | None = None,
        stride: int | None = None,
        gaps: bool | None = None,
        boundaries: str | None = None,
        path: bool = False,
        whole: bool = False,
        ways: str | None = None,
        window: int | None = None,
        **scope: Unpack[ScopeOptions],
    ) -> Hits:
        """Where a motion occurs inside the clips, by alignment of postures: ranges, cheapest first (PESTA, section 6).

        Of motion that repeats every cycle is an answer, or as many in a row as the query has; "cycles" counts them, and
        "speed" is how much faster they are than the query.

        Examples:
            >>> hits = lake.align("humanoid3d_walk", 0, 30, k=2, path=True)
            >>> sorted(hits[0]["path"][0])
            ['clip', 'query']

        Args:
            query: a clip of the lake, or a clip file.
            start: its first frame that is asked for, at its own rate; by default 0.
            stop: the frame after the last; by default that after its last.
            k: how many at most; of `window`, to each window.
            method: "sta" (strided temporal alignment), "dtw" or "sw" (Smith-Waterman); by default that of config.toml.
            stride: how many symbols "sta" may skip at a time, plus one; by default that of config.toml.
            gaps: of "sta": symbols may be left out of both sides at a price; by default as config.toml says.
            boundaries: of clips: "kept" (default); "crossed", a match may begin in one clip and end in a later one; or
                "dropped", clips are one string, and matches that cross are left out.
            path: tell which frames are aligned to which.
            whole: rank whole clips, and not ranges inside them.
            ways: of `whole`, the "max" (default) or "mean" of both ways, or "query", the query in the clip alone.
            window: answer every window of so many symbols, sliding by a third of them ("query_start", "query_stop").
            scope: as of `find`.

        Raises:
            UserError: as `find`; options that make no sense together.
        """
        from motionlake.retrieval.alignment import check_together

        mirrored = scope.get("mirrored", False)
        check_together(whole=whole, window=window, boundaries=boundaries, ways=ways, mirrored=mirrored)
        how: dict[str, Any] = {"method": method, "stride": stride, "gaps": gaps, "paths": path}
        part = query, start, stop
        if whole:
            return self._search("clip", "alignment", part, k, scope, **how, ways=ways)
        if window is None:
            return self._search("range", "alignment", part, k, scope, **how, boundaries=boundaries)
        return self._windows(part, window, k, scope, **how, boundaries=boundaries)

    def sql(self, text: str, parameters: Mapping[str, Any] | Sequence[Any] | None = None) -> Rows:
        """The answer to a query in SQL, with the lake's tables, macros and functions.

        Examples:
            >>> lake.sql("SELECT count(*) AS clips FROM clips WHERE seconds > $least", {"least": 3}).fetchall()
            [(2,)]
            >>> lake.sql("FROM similar_clips('clips/humanoid3d_walk.txt', 2)").arrow().num_rows
            2

        Args:
            text: one query; the lake cannot be changed.
            parameters: by name (`$name`), or in their order (`?`).

        Raises:
            UserError: DuckDB does not understand it, or there is no statement in it.
        """
        found = _asked(lambda: self._con.sql(text, params=parameters))
        if found is None:
            raise UserError("sql: there is no statement in the text")
        return Rows(_asked(found.to_arrow_table))

    def dataset(
        self,
        split: str | None = None,
        dataset: str | None = None,
        length: int | None = None,
        transform: Callable[[dict[str, Any]], Any] | None = None,
        *,
        classes: Sequence[str] | None = None,
    ) -> ClipDataset:
        """The motion of the clips as a torch `Dataset`, for networks of your own; see `ClipDataset`.

        Examples:
            >>> from torch.utils.data import DataLoader
            >>> batch = next(iter(DataLoader(lake.dataset(length=90), batch_size=3)))
            >>> batch["positions"].shape, batch["mask"].sum(dim=1)
            (torch.Size([3, 90, 21, 3]), tensor([90, 90, 70]))
        """
        from motionlake.lake.clip_dataset import ClipDataset

        return ClipDataset(self._lake.root, split, dataset, length, transform, classes=classes)

    def synthesize(
        self,
        classes: str | Sequence[str] = (),
        seconds: float | None = None,
        *,
        seed: int = 0,
        start: Clip | None = None,
        split: str | None = None,
        pace: float = 1.0,
        temperature: float = 1.0,
        min_quality: str | None = None,
        path: str | Path | Sequence[tuple[float, float]] | None = None,
        speed: float | None = None,
        facing: float | None = None,
        loop: bool = False,
        continues: Clip | None = None,
        keyframes: Sequence[str] = (),
        edit: Clip | None = None,
        first: int | None = None,
        last: int | None = None,
        style: Clip | None = None,
    ) -> CanonicalMotion:
        """New motion of known classes, which nobody recorded. The same arguments give the same motion.

        The lake is not changed: `motionlake synthesize` makes clips of it. A generator comes first:
        `motionlake run synth`.

        Examples:
            >>> lake.synthesize("walk", seconds=2, start="humanoid3d_walk")
            <CanonicalMotion: 60 frames, 30 a second, 2 s>

        Args:
            classes: one, or several that follow one another in equal shares of the time, or each for its own
                ("walk:3").
            seconds: length; by default what the classes say, else what a path takes, else 8.
            seed: another seed, another motion.
            start: start from the first poses of this recorded clip or clip file; by default from one that is drawn.
            split: draw it from this split.
            pace: 2 is twice as fast.
            temperature: how much chance varies the motion; 0 not at all.
            min_quality: draw it from clips with this verdict at worst.
            path: on the ground, from where the motion starts: "circle", "eight:2" (radius 2 m), a CSV file with columns
                x and z, or points in metres. This and what follows need recordings that are labelled with the classes,
                which motion matching plays.
            speed: metres a second; by default as recorded.
            facing: degrees to the left of where it starts to head that the body keeps facing; by default along its way.
            loop: the end meets the beginning.
            continues: go on from the end of this recorded clip or clip file.
            keyframes: poses that it passes through, "CLIP@FRAME", or "CLIP@FRAME=SECONDS" for when; it then lasts from
                the first to the last, and `classes` may be left out.
            edit: make frames [`first`, `last`) of this clip anew, of one class; the motion is the whole clip, at its
                own rate, with the other frames as they are.
            first, last: of the frames that are made anew.
            style: recorded frames that look like those of this clip or clip file are preferred.

        Raises:
            UserError: there is no generator, it does not know a class, there is nothing to start from, a number
                that no motion can have, or a path that the recipe cannot follow or that leaves no time.
        """
        from motionlake.lake.settings import served_config
        from motionlake.stages.synthesis import open_generator
        from motionlake.stages.synthesis_control import Request
        from motionlake.stages.synthesis_edits import with_edit
        from motionlake.stages.synthesis_keys import marked, style_of, with_keyframes
        from motionlake.stages.synthesis_options import begun, path_text, timed_classes
        from motionlake.stages.synthesis_requests import canonical_motion, make, motions_of
        from motionlake.stages.synthesis_settling import settle
        from motionlake.stages.synthesis_starts import find_starts

        names, shares = timed_classes((classes,) if isinstance(classes, str) else tuple(classes))
        named: Clip | None = begun(start, continues)
        seed_clip = None if named is None else self._query(named)
        clip = None if seed_clip is None else str(seed_clip)
        outside = isinstance(seed_clip, Path)
        way = None if path is None else path_text(path)
        asked = Request(
            names, seconds, seed, clip, outside, split, pace, temperature, min_quality, shares, way, speed, facing,
            loop, continues is not None,
        )  # fmt: skip
        if style is not None:
            asked = replace(asked, style=style_of(self._con.own, self._lake, self._query(style)))
        if edit is not None:
            asked = with_edit(self._con.own, self._lake, asked, self._query(edit), first, last)
        elif keyframes:
            frames = [marked(text) for text in keyframes]
            frames = [replace(frame, source=self._query(str(frame.source))) for frame in frames]
            asked = with_keyframes(self._con.own, self._lake, asked, frames)
        config = served_config(self._lake)
        chosen, request = settle(self._con.own, self._lake, config, asked)
        model = chosen.model
        starts = find_starts(self._con.own, self._lake, model, request)
        generator = self._keep(("synthesize", model.model), lambda: open_generator(self._lake, model))
        return canonical_motion(make(generator, self._lake, request, motions_of(request, starts, [1]))[0])

    def inbetween(
        self,
        poses: Clip,
        keys: str | Path | Sequence[int] = "all",
        classes: str | Sequence[str] = (),
        *,
        spacing: float | None = None,
        fps: float | None = None,
        seed: int = 0,
        temperature: float = 0.0,
    ) -> CanonicalMotion:
        """Motion through given poses: frames of a clip of the lake or of a clip file, at the times of these frames.

        Examples:
            >>> lake.inbetween("humanoid3d_walk", [0, 10, 20, 30])
            <CanonicalMotion: 31 frames, 30 a second, 1.033 s>

        Args:
            poses: the clip or file that holds the poses.
            keys: its frames, "all" of them, or a CSV file with the columns frame and, if wanted, seconds.
            classes: as which it moves between them; by default as any that the generator knows.
            spacing: seconds from pose to pose; by default as the frames are apart.
            fps: frames a second of the motion; by default 30.
            seed: another seed, other motion between the poses.
            temperature: how much chance varies it.

        Raises:
            UserError: there is no generator, the file cannot be read or has another skeleton, it does not have such a
                frame, or times do not rise.
        """
        from motionlake.stages.synthesis_inbetween import inbetween

        names = (classes,) if isinstance(classes, str) else tuple(classes)
        return inbetween(
            self._con.own, self._lake, self._query(poses), keys, names, spacing=spacing, fps=fps, seed=seed,
            temperature=temperature,
        ).motion  # fmt: skip

    def close(self) -> None:
        """Let go of the catalog; the next call opens it again."""
        self._kept.clear()
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def __enter__(self) -> Lake:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<motionlake.Lake {self.path}>"

    def _repr_html_(self) -> str:
        """How many clips there are, the datasets and what stages have made, for notebooks."""
        from motionlake.pictures.notebook import lake_html

        return lake_html(self.path, self.sql)

    @property
    def _con(self) -> LakeConnection:
        """A connection to the catalog that is served now: every run of a command puts another in its place."""
        from motionlake.retrieval.sql_functions import connect

        served = self._lake.served()
        if self._connection is None or self._served != served:
            self.close()
            self._connection, self._served = connect(self._lake.root), served
        return self._connection

    def _keep(self, key: tuple[object, ...], make: Callable[[], T]) -> T:
        """What was made for this key from the catalog that is served, made when first asked for."""
        self._con  # noqa: B018 - drops what was made from an earlier catalog
        if key not in self._kept:
            self._kept[key] = make()
        kept: T = self._kept[key]
        return kept

    def _query(self, clip: Clip) -> Clip:
        """The clip of the lake that a name means, in full, or the path of a clip file, which a `Path` means first."""
        from motionlake.lake.resolve import clip_file, clip_or_file

        file = clip_file(clip) if isinstance(clip, Path) else None
        found = file or clip_or_file(self._con.own, str(clip))
        return found.absolute() if isinstance(found, Path) else found

    def _name(self, clip: str) -> str:
        from motionlake.lake.resolve import resolve_clip

        return resolve_clip(self._con.own, clip)

    def _clips(self, where: str | None, equal: Mapping[str, str | float | None]) -> duckdb.DuckDBPyRelation:
        import duckdb

        found = self._con.own.table("clips")
        for name, value in equal.items():
            if name not in found.columns:
                raise UserError(f"clips: have no column {name}; they have {', '.join(found.columns)}")
            column = duckdb.ColumnExpression(name)
            found = found.filter(column.isnull() if value is None else column == duckdb.ConstantExpression(value))
        return found if where is None else found.filter(where)

    def _search(self, finds: Finds, method: str, part: ClipRange, k: int, scope: ScopeOptions, /, **how: Any) -> Hits:
        from motionlake.retrieval.protocol import Query, Scope

        query = Query(self._query(part[0]), *part[1:])
        found = self._searcher(finds, method, **how).search([query], k, Scope(**scope))[0]
        return self._hits((hit.as_row() for hit in found), (query.source, *part[1:]))

    @staticmethod
    def _exactly(finds: Finds, method: str, exact: bool) -> dict[str, bool]:
        """The option of a searcher that compares every clip; none where it is not asked for."""
        from motionlake.retrieval.registry import check_exact

        check_exact(finds, method, "exact", exact=exact)
        return {"exact": True} if exact else {}

    def _windows(self, part: ClipRange, window: int, k: int, scope: ScopeOptions, /, **how: Any) -> Hits:
        from motionlake.retrieval.protocol import Query, Scope

        aligner = cast("AlignmentRangeSearcher", self._searcher("range", "alignment", **how))
        query = Query(self._query(part[0]), *part[1:])
        long = aligner.long_query(query, Scope(**scope), window)
        found = long.windows(window, k, paths=how["paths"])
        return self._hits((hit.as_row() for hit in found), (query.source, *part[1:]))

    def _search_text(
        self,
        text: str,
        encoder: str | Encoder | None,
        part: ClipRange | None,
        k: int,
        method: str,
        scope: ScopeOptions,
    ) -> Hits:
        from motionlake.retrieval.protocol import Query, Scope
        from motionlake.retrieval.text import LakeText, encoder_named
        from motionlake.retrieval.text_example import ExampleAndText

        encode = encoder_named(encoder) if isinstance(encoder, str) else encoder
        says = self._keep(("text", encode), lambda: LakeText(self._lake, encode))
        if part is None:
            told = says.search(text, k, Scope(**scope))
            return self._hits((hit.as_row() for hit in told), (None, None, None))
        query = Query(self._query(part[0]), *part[1:])
        both = ExampleAndText(self._searcher("clip", method), says, text)
        found = both.search([query], k, Scope(**scope))[0]
        return self._hits((hit.as_row() for hit in found), (query.source, *part[1:]))

    def _hits(self, rows: Iterable[Mapping[str, object]], asked: Asked) -> Hits:
        """Answers as rows that can be drawn; `asked`: of the lake or a file, by its full name."""
        from motionlake.pictures.answers import Hits

        return Hits(Rows.of(rows).arrow(), self.motion, asked)

    def _searcher(self, finds: Finds, method: str, /, **how: Any) -> Searcher:
        from motionlake.retrieval.registry import searcher

        return self._keep((finds, method, *how.items()), lambda: searcher(finds, method, self._lake, **how))


def _asked(ask: Callable[[], T]) -> T:
    """What DuckDB answers; its errors as `UserError`."""
    import duckdb

    try:
        return ask()
    except duckdb.Error as error:
        raise UserError(f"SQL: {' '.join(told_by_sql(str(error)).split())}") from error
