"""Configuration: one frozen dataclass a stage, read from the lake's config.toml, hashed as canonical JSON.

Each table that comes with the program is a field of `LakeConfig`, by which type checkers know it. A module of any room
whose name ends with `_config` adds a table: `TABLE` names it, `CONFIG` is its dataclass.
"""

from __future__ import annotations

import hashlib
import json
import reprlib
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Final, TypeVar

from motionlake.deep_motifs.config import NeighboursConfig, NetworkConfig, TransitionsConfig
from motionlake.deephums.config import DescriptorsConfig, SubmotionConfig
from motionlake.errors import UserError
from motionlake.glogen.config import SynthesisConfig
from motionlake.motion.features import WordConfig
from motionlake.pesta.config import AlignmentConfig, PosturesConfig, SymbolsConfig

Table = TypeVar("Table")


@dataclass(frozen=True)
class FramesConfig:
    """How canonical frames are stored.

    Attributes:
        position_step: metres; positions are multiples of it (2^-13 m is 0.12 mm).
        rotation_step: quaternion components are multiples of it (2^-13 is below 0.02 degrees).
    """

    position_step: float = 2.0**-13
    rotation_step: float = 2.0**-13


@dataclass(frozen=True)
class MotifsConfig:
    """Motifs (Deep Motifs, section 4.1): their number K and the seed of the clustering."""

    k: int = 100
    seed: int = 0


def _added_tables() -> dict[str, Any]:
    files = sorted(Path(__file__).parents[1].glob("*/*_config.py"))
    modules = [import_module(f"motionlake.{file.parent.name}.{file.stem}") for file in files]
    return {module.TABLE: module.CONFIG() for module in modules}


@dataclass(frozen=True)
class LakeConfig:
    """All of a lake's configuration; each part is a table of config.toml."""

    frames: FramesConfig = field(default_factory=FramesConfig)
    words: WordConfig = field(default_factory=WordConfig)
    network: NetworkConfig = field(default_factory=NetworkConfig)
    motifs: MotifsConfig = field(default_factory=MotifsConfig)
    neighbours: NeighboursConfig = field(default_factory=NeighboursConfig)
    transitions: TransitionsConfig = field(default_factory=TransitionsConfig)
    postures: PosturesConfig = field(default_factory=PosturesConfig)
    symbols: SymbolsConfig = field(default_factory=SymbolsConfig)
    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    descriptors: DescriptorsConfig = field(default_factory=DescriptorsConfig)
    submotion: SubmotionConfig = field(default_factory=SubmotionConfig)
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)
    added: Mapping[str, Any] = field(default_factory=_added_tables)

    def tables(self) -> dict[str, Any]:
        """Every table by its name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "added"} | dict(self.added)

    def of(self, table: type[Table]) -> Table:
        """The table that a dataclass describes."""
        return next(found for found in self.tables().values() if isinstance(found, table))

    def replacing(self, found: Any) -> LakeConfig:
        """This configuration with another table of its class."""
        name = next(name for name, table in self.tables().items() if type(table) is type(found))
        if name in self.added:
            return replace(self, added={**self.added, name: found})
        return replace(self, **{name: found})


def canonical_json(value: Any) -> str:
    """One spelling for one value: sorted keys, no spaces."""
    return _encode(value)


_encode: Final = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode


def plain(value: Any) -> Any:
    """A dataclass or plain value as `config_hash` spells it.

    Models in lakes were keyed while `weights = "pretrained"` was called "shipped": their keys stay.
    """
    found = asdict(value) if hasattr(value, "__dataclass_fields__") else value
    named = isinstance(found, dict) and found.get("weights") == "pretrained"
    return {**found, "weights": "shipped"} if named else found


def config_hash(*values: Any) -> str:
    """sha256 over the canonical JSON of dataclasses and plain values."""
    return hashlib.sha256(canonical_json([plain(value) for value in values]).encode()).hexdigest()


def load_config(path: Path) -> LakeConfig:
    """Read config.toml; what it leaves out keeps its default. Raises `UserError` on unknown or unfit values."""
    if not path.is_file():
        return LakeConfig()
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: is not UTF-8 ({error.reason} at byte {error.start}); save it as UTF-8") from error
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, lists in thousands of lists
        raise UserError(f"{path}: not valid TOML: {error}") from error
    config = LakeConfig()
    known = config.tables()
    for name, table in tables.items():
        if name not in known or not isinstance(table, dict):
            raise UserError(f"{path}: unknown table [{_shown(name)}]; known are {', '.join(sorted(known))}")
        config = config.replacing(_override(known[name], table, f"{path}: [{name}]"))
    return config


def _override(default: Any, table: dict[str, Any], where: str) -> Any:
    known = {f.name for f in fields(default)}
    for key, value in table.items():
        if key not in known:
            raise UserError(f"{where} {_shown(key)}: unknown; known are {', '.join(sorted(known))}")
        wanted = type(getattr(default, key))
        number = wanted is float and type(value) is int
        if type(value) is not wanted and not number:
            raise UserError(f"{where} {key} = {reprlib.repr(value)}: must be of type {wanted.__name__}")
    try:
        return replace(default, **{k: type(getattr(default, k))(v) for k, v in table.items()})
    except (ValueError, OverflowError) as error:
        raise UserError(f"{where}: {error}") from error


def _shown(name: str) -> str:
    """A name as it is, or, where that is long or no printable text, as Python writes a part of it."""
    return name if name.isprintable() and len(name) < 40 else reprlib.repr(name)


def default_toml() -> str:
    """The text of a config.toml that states every default, commented out."""
    lines = [
        "# Configuration of this lake. A changed value redoes its stage and what hangs on it; [limits] redo nothing.",
        "",
    ]
    for name, table in LakeConfig().tables().items():
        lines.append(f"[{name}]")
        lines += [f"# {key} = {json.dumps(value)}" for key, value in asdict(table).items()]
        lines.append("")
    return "\n".join(lines)
