"""Keys of the parts of a stage, each worked out once in a process."""

from __future__ import annotations

import hashlib
from functools import lru_cache

from motionlake.lake.config import canonical_json


class PartKeys(dict[str, str]):
    """What `config_hash` gives of a stage, its version, the key of what it reads and the values whose canonical JSON is
    `shaping`, by that key; each worked out once, for a command asks a dozen times for those of all parts."""

    def __init__(self, stage: str, version: int, shaping: str) -> None:
        super().__init__()
        self._before = f"{canonical_json([stage, version])[:-1]},"
        self._after = "]" if shaping == "[]" else f",{shaping[1:]}"

    def __missing__(self, upstream: str) -> str:
        # JSON spells keys, which are hexadecimal, as they stand.
        told = f'"{upstream}"' if upstream.isascii() and upstream.isalnum() else canonical_json(upstream)
        spelled = f"{self._before}{told}{self._after}"
        self[upstream] = found = hashlib.sha256(spelled.encode()).hexdigest()
        return found


@lru_cache
def keys_of_parts(stage: str, version: int, shaping: str) -> PartKeys:
    """Of a stage, for this process."""
    return PartKeys(stage, version, shaping)
