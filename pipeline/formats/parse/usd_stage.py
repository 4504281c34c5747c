"""A USD stage of one file alone.

USD is made to compose files: a layer names others, by any path or address. Here a file stands for itself: one that
names another is rejected before the stage is opened, but for layers within one package (.usdz).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from motionlake.errors import ClipError
from motionlake.names import printable

# What a file begins with says its kind; its name may say ".usd" of any.
KINDS: Final = {b"#usda": ".usda", b"PXR-USDC": ".usdc", b"PK": ".usdz"}
LONGEST: Final = 80  # characters of a file that are told


def open_alone(data: bytes, folder: Path) -> Any:
    """The stage of a file, whose bytes go into an empty folder, so that nothing is beside it.

    Raises:
        ClipError: no USD, or a file that names others.
    """
    from pxr import Sdf, Usd

    kind = next((suffix for start, suffix in KINDS.items() if data.startswith(start)), None)
    if kind is None:
        raise ClipError("is no USD file: it begins as none")
    path = folder / f"scene{kind}"
    path.write_bytes(data)
    layer = _layer(str(path))
    package = Sdf.ZipFile.Open(str(path)).GetFileNames() if kind == ".usdz" else ()
    _check_alone(layer, frozenset(f"{path}[{name}]" for name in package), set())
    return Usd.Stage.Open(layer)


def _layer(name: str) -> Any:
    from pxr import Sdf

    layer = Sdf.Layer.FindOrOpen(name)
    if layer is None:
        raise ClipError("USD cannot read it")
    return layer


def _check_alone(layer: Any, package: frozenset[str], seen: set[str]) -> None:
    """Reject a layer that names other files, by any means; those within its package are looked at too."""
    from pxr import Sdf

    seen.add(layer.identifier)
    with_clips = []

    def look(path: Any) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, Sdf.PrimSpec) and spec.HasInfo("clips"):
            with_clips.append(path)

    layer.Traverse(Sdf.Path.absoluteRootPath, look)
    if with_clips:
        raise ClipError("has value clips, which are other files: write it with usdcat --flatten")
    for name in layer.GetCompositionAssetDependencies():
        if not name:  # a reference within the layer
            continue
        within = Sdf.ComputeAssetPathRelativeToLayer(layer, name)
        if within not in package:
            shown = printable(name)[:LONGEST]
            raise ClipError(f"is made of other files, which are not read ({shown}): write it with usdcat --flatten")
        if within not in seen:
            _check_alone(_layer(within), package, seen)
