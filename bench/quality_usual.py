"""What is usual in a set of recordings, by the SQL of a lake, with faults planted in some of its clips."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any, Final

import duckdb
import pyarrow as pa
from motionlake.lake.catalog import run_sql
from motionlake.motion.quality import Highest, Quality
from motionlake.stages.quality import LEVEL

SPREADS: Final = (0.5, 0.25, 1.0, 1.5, 2.0)  # that are tried; the program's first
FOLDS: Final = 5  # in one of as many clips a fault is planted at once
_ROWS: Final = pa.schema([("clip", pa.string()), ("levels", pa.list_(LEVEL))])
_OWN: Final = (
    "CREATE TABLE plain AS SELECT clip, levels FROM checked_clips()",
    "CREATE TABLE planted AS FROM plain",
    "CREATE OR REPLACE MACRO checked_clips() AS TABLE FROM planted UNION ALL FROM plain ANTI JOIN planted USING (clip)",
)


class Dataset:
    """The clips of a set as they were checked, of which some may be exchanged for such with a planted fault."""

    def __init__(self, plain: Sequence[Quality]) -> None:
        self.plain = plain
        self._con = duckdb.connect()
        self._con.execute("SET threads = 1")
        self._con.execute("CREATE TABLE clips (clip VARCHAR, dataset VARCHAR)")
        run_sql(self._con, "macros/usual_faults.sql")
        for statement in _OWN:
            self._con.execute(statement)
        self._insert("plain", dict(enumerate(plain)))
        self._con.execute("INSERT INTO clips SELECT clip, 'set' FROM plain")

    def highest(self, spreads: float) -> Highest:
        """Of what is usual, above which multiple of its threshold it stands out."""
        found: dict[str, dict[str, float]] = {}
        rows = self._con.execute("SELECT fault, joint, highest FROM usual_faults(spreads := $1)", [spreads]).fetchall()
        for kind, joint, value in rows:
            found.setdefault(kind, {})[joint] = value
        return found

    def usual(self) -> dict[str, dict[str, float]]:
        """How many clips have what is usual, and the median of how many times the threshold they go."""
        rows = self._con.execute("SELECT DISTINCT fault, clips, faulty, median FROM usual_faults() ORDER BY fault")
        return {kind: {"clips": of, "faulty": faulty, "median": median} for kind, of, faulty, median in rows.fetchall()}

    @contextmanager
    def planted(self, others: Mapping[int, Quality]) -> Iterator[None]:
        """With other clips in the place of some, by number."""
        self._insert("planted", others)
        try:
            yield
        finally:
            self._con.execute("DELETE FROM planted")

    def _insert(self, table: str, clips: Mapping[int, Quality]) -> None:
        rows = pa.Table.from_pylist(
            [{"clip": str(n), "levels": [_row(asdict(each)) for each in q.levels]} for n, q in clips.items()],
            schema=_ROWS,
        )
        self._con.register("given", rows)
        self._con.execute(f"INSERT INTO {table} FROM given")
        self._con.unregister("given")


def _row(level: dict[str, Any]) -> dict[str, Any]:
    return {"fault": level["kind"], **level}
