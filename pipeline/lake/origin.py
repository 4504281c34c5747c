"""Which versions of which buckets a copy of a lake is: `bucket.json` in it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing


@dataclass(frozen=True)
class Origin:
    """Which version of a bucket a copy was when it was last pushed there or pulled from there.

    Attributes:
        address: of the bucket.
        number: of the version; 0 of a copy of nothing.
        own: sha256 of the catalog, settings and annotations of the version, by name.
        taking: whether another version is being taken: what lies there is neither, until the next pull.
        part: whether the copy may lack files of the version, which are fetched when they are first read.
        token: of the version that was being published last: a push that is killed may not hear that it was.
    """

    address: str
    number: int
    own: Mapping[str, str]
    taking: bool = False
    token: str = ""
    part: bool = False

    @classmethod
    def all(cls, lake: Lake) -> dict[str, Origin]:
        """What `bucket.json` says, by address, that of the last push or pull last; nothing where it is damaged."""
        try:
            found: Any = json.loads(origin_file(lake).read_bytes())
            read = [
                cls(
                    str(row["address"]),
                    int(row["number"]),
                    dict(row["own"]),
                    bool(row["taking"]),
                    str(row["token"]),
                    bool(row.get("part", False)),
                )
                for row in found
            ]
        except (OSError, ValueError, KeyError, TypeError):
            return {}
        return {each.address: each for each in read}

    def keep(self, lake: Lake) -> None:
        before = {address: each for address, each in Origin.all(lake).items() if address != self.address}
        with replacing(origin_file(lake)) as temporary:
            rows = [vars(each) for each in (*before.values(), self)]
            temporary.write_text(json.dumps(rows, sort_keys=True) + "\n", encoding="utf-8")


def origin_file(lake: Lake) -> Path:
    """Where it is said."""
    return lake.root / "bucket.json"
