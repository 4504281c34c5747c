"""What hypothesis damages, and what must hold all the same: readers, label files, configuration, functions in SQL.

Each `check_...` runs one property so many times; the tests run few (`tests/test_fuzz.py`), `make fuzz` runs many.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import duckdb
import numpy as np
from hypothesis import HealthCheck, example, given, seed, settings
from hypothesis import strategies as st
from motionlake.errors import ClipError, UserError
from motionlake.formats import read_clips
from motionlake.formats.limits_config import MIB, Limits
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import default_toml, load_config
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs

from tests.damage import DAMAGES, FOREIGN, HUGE, NO_NUMBER
from tests.lakes import motionlake
from tests.samples import SAMPLES

SMALL: Final = Limits(file_megabytes=8, frames=20_000, joints=200, bodies=20, memory_megabytes=64)
# The name of an exception, as words have it that nobody wrote for people.
NOT_FOR_PEOPLE: Final = re.compile(r"\b\w+(Error|Exception|Warning)\b|Traceback|File \"|, line \d+, in ")
MOST_DAMAGES: Final = 3
Mutation = tuple[int, int]

mutations: Final = st.lists(
    st.tuples(st.integers(0, len(DAMAGES) - 1), st.integers(0, 2**32 - 1)), min_size=1, max_size=MOST_DAMAGES
)


def damaged(data: bytes, what: Sequence[Mutation]) -> bytes:
    """The bytes after one damage upon the other, each with a seed."""
    for index, number in what:
        if len(data) > 1:
            data = DAMAGES[index](data, np.random.default_rng(number))
    return data[: 4 * MIB]


def bounded(examples: int, number: int | None) -> Callable[[Any], Any]:
    """Run a property so often: the same examples each time, or those of another seed."""
    quiet = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture]
    known = settings(
        max_examples=examples, deadline=None, database=None, derandomize=number is None, suppress_health_check=quiet
    )
    return lambda test: known(test if number is None else seed(number)(test))


def fault_of_words(words: str, longest: int = 300) -> str:
    """What is wrong with one line that tells people why something is refused; "" where nothing is."""
    if not 3 < len(words) < longest:
        return f"{len(words)} characters long"
    if not words.isprintable():
        return "holds what is no printable text"
    found = NOT_FOR_PEOPLE.search(words)
    return f"tells of {found[0]}" if found else ""


def must_be_for_people(words: str, longest: int = 300) -> None:
    """Fail where words are not as `fault_of_words` wants them."""
    fault = fault_of_words(words, longest)
    assert not fault, f"{words[:900]!r} {fault}"


def check_reader(suffix: str, folder: Path, examples: int, number: int | None = None) -> None:
    """A damaged sample is read, solved and placed in finite numbers, or refused in words for people."""
    sample = SAMPLES[suffix](folder)
    path, rigs = folder / f"damaged{suffix}", load_rigs()
    asf = folder / "sample.asf"
    skeleton = asf.read_bytes() if asf.is_file() else b""

    @bounded(examples, number)
    @given(what=mutations, of_skeleton=st.booleans())
    def holds(what: list[Mutation], of_skeleton: bool) -> None:
        in_skeleton = of_skeleton and bool(skeleton)
        if skeleton:
            asf.write_bytes(damaged(skeleton, what) if in_skeleton else skeleton)
        path.write_bytes(sample if in_skeleton else damaged(sample, what))
        try:
            for clip in read_clips(path, allowed=SMALL):
                motion = solve(clip)
                assert np.isfinite(motion.positions).all()
                canonical = canonicalise(clip, motion, identify(clip.hierarchy.joints, rigs), metres_per_unit=0.01)
                assert (np.abs(canonical.positions) < 1e5).all()
                assert (np.abs(np.linalg.norm(canonical.rotations, axis=-1) - 1.0) < 1e-6).all()
        except ClipError as error:
            must_be_for_people(error.reason)

    holds()


LABELS: Final = b'file,label,subject,split,note\na.bvh,walk,1,train,slow\nb/c.amc,"run, fast",2,test,\n'
SEGMENTS: Final = b'file,start,stop,label\na.bvh,0,10,walk\nb/c.amc,5,12,"run, fast"\n'
TEXTS: Final = (
    "../../../etc/passwd",
    "a" * 150_000,
    "[/red]",
    "\u202e",
    "=1+1",
    '"',
    "\r",
    "-5",
    "9" * 5000,
    "١٢",
    "1e5",
)


def check_label_files(lake: Path, root: Path, examples: int, number: int | None = None) -> None:
    """Damaged labels.csv and segments.csv are entered, or refused in one line; `root` is a folder the lake knows."""
    cells = st.sampled_from([text.encode() for text in TEXTS] + [*FOREIGN, *HUGE, *NO_NUMBER])

    @bounded(examples, number)
    @given(name=st.sampled_from(["labels", "segments"]), what=mutations, cell=cells, place=st.integers(0, 200))
    def holds(name: str, what: list[Mutation], cell: bytes, place: int) -> None:
        data = LABELS if name == "labels" else SEGMENTS
        data = damaged(data, what) if place < 100 else data[: place - 50] + cell + data[place - 50 :]
        file = root / f"{name}.csv"
        file.write_bytes(data)
        try:
            run = motionlake("ingest", root, "--lake", lake)
        finally:
            file.unlink()
        refused_in_one_line(run.status, run.err)

    holds()


def refused_in_one_line(status: int, said: str) -> None:
    """A command that did its work, or said in one last line why not."""
    assert status in (0, 1, 2), said
    assert "Traceback" not in said
    if status == 2:
        last = said.rstrip("\n").rpartition("\n")[2]
        assert last.startswith("motionlake: "), said
        must_be_for_people(last, 600)


_CONFIG: Final = re.sub(r"(?m)^# (?=\w+ = )", "", default_toml()).encode()


def check_config(folder: Path, examples: int, number: int | None = None) -> None:
    """A damaged config.toml is read or refused in one line."""
    path = folder / "config.toml"
    lines = _CONFIG.splitlines()

    @bounded(examples, number)
    @example(what=[], line=3, value=b"\xff", other=False)
    @given(
        what=mutations, line=st.integers(0, len(lines) - 1), other=st.booleans(),
        value=st.sampled_from([*HUGE, *NO_NUMBER, *FOREIGN, b"[" * 3000, b"-5", b"0", b'"none"', b"[]", b"1979-05-27"]),
    )  # fmt: skip
    def holds(what: list[Mutation], line: int, other: bool, value: bytes) -> None:
        data = damaged(_CONFIG, what)
        if not other:
            key = lines[line].partition(b" = ")[0]
            data = b"\n".join([*lines[:line], key + b" = " + value, *lines[line + 1 :]])
        path.write_bytes(data)
        try:
            load_config(path)
        except UserError as error:
            must_be_for_people(str(error), 900)

    holds()


NAMES: Final = (
    "''",
    "'%'",
    "'nobody'",
    "'.'",
    "'/'",
    "'/etc/passwd'",
    "chr(8238)",
    "'[/red]'",
    "repeat('x', 70000)",
    "NULL",
)
VALUES: Final = (
    "NULL", "0", "1", "-1", "-3", "3", "9223372036854775807", "-9223372036854775808", "1e308", "'nan'::DOUBLE",
    "'inf'::DOUBLE", "true", "[]", "[NULL]", "[1.0, 'nan'::FLOAT]", "['']", "['x', NULL]", "'train'", "'words'",
    "170141183460469231731687303715884105727", "''::BLOB", "{a: 1}", "DATE '2020-01-01'",
)  # fmt: skip
# What a person who wrote a query reads of a mistake in it: an error of DuckDB, or of the program within one.


def functions_of(con: Connection) -> list[tuple[str, bool, list[str]]]:
    """Functions and macros of a lake: name, whether they give a table, names of their arguments."""
    text = """
        SELECT DISTINCT function_name, function_type LIKE 'table%', parameters FROM duckdb_functions()
        WHERE NOT internal AND function_name NOT LIKE '%\\_rows' ESCAPE '\\' ORDER BY ALL
    """
    found = [(name, table, list(parameters)) for name, table, parameters in con.execute(text).fetchall()]
    return [*found, *((name, False, []) for name in ("emd", "emd_deep_motifs"))]  # which DuckDB does not list


def check_sql_functions(
    con: Connection, examples: int, number: int | None = None, left_out: Sequence[str] = ()
) -> None:
    """Functions and macros answer any arguments with rows, or with an error that was written for people."""
    known = [found for found in functions_of(con) if found[0] not in left_out]
    clip = "'" + fetch(con, "clip_names")[0]["clip"].replace("'", "''") + "'"
    value = st.sampled_from([*NAMES, *VALUES, clip, clip, clip])

    @bounded(examples, number)
    @given(chosen=st.sampled_from(known), data=st.data())
    def holds(chosen: tuple[str, bool, list[str]], data: st.DataObject) -> None:
        name, table, parameters = chosen
        few = data.draw(st.integers(0, len(parameters)))
        given_values = [clip if place == 0 and data.draw(st.booleans()) else data.draw(value) for place in range(few)]
        named = (
            data.draw(st.dictionaries(st.sampled_from(parameters[few:]), value, max_size=4)) if parameters[few:] else {}
        )
        if not parameters:
            given_values = data.draw(st.lists(value, max_size=3))
        given_values += [f'"{key}" := {text}' for key, text in named.items()]
        call = f"{name}({', '.join(given_values)})"
        ask(con, f"FROM {call}" if table else f"SELECT {call}")

    holds()


def ask(con: Connection, text: str) -> None:
    """Run a query; what it is refused with must not be a fault of the program."""
    try:
        con.execute(text).fetchall()
    except duckdb.Error as error:
        said = str(error)
        within = re.findall(r"(?m)(?:^|: )((?:\w+\.)*\w+(?:Error|Exception)): ", said)
        inner = [name for name in within if not name.startswith("duckdb")]
        assert "INTERNAL" not in said, f"{text[:300]}: {said[:500]}"
        assert all(name.rpartition(".")[2] in ("UserError", "ClipError") for name in inner), (
            f"{text[:300]}: {said[:900]}"
        )
