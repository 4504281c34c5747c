"""What the pictures of symbol strings are made from: a lake's strings, its dictionary, a body for each symbol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray, Int32Array, IntArray
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.strings import LakeStrings, read_strings
from motionlake.motion.features import WordConfig
from motionlake.motion.skeleton import INDEX, JOINTS
from motionlake.pesta.config import DICTIONARY_KEY, PosturesConfig
from motionlake.pictures.motif_figures import motif_order
from motionlake.pictures.stick_figures import PoseReader
from motionlake.pictures.style import motif_colours
from motionlake.stages.postures import codes_of_clips
from motionlake.weights import read_tensors

# Joints that no dictionary over positions holds, as shares of two that it does; feet end at the ankles.
_BETWEEN: Final = {
    "spine": ("hips", "neck", 1 / 3),
    "chest": ("hips", "neck", 2 / 3),
    **{f"{side}_clavicle": ("neck", f"{side}_shoulder", 0.3) for side in ("left", "right")},
    **{f"{side}_toe": (f"{side}_ankle", f"{side}_ankle", 0.0) for side in ("left", "right")},
}


@dataclass(frozen=True)
class SymbolMaterial:
    """A lake's strings and dictionary of m symbols.

    Attributes:
        strings: of all clips.
        codes: [m, d] cluster heads.
        postures: [m, D] typical postures, in features.
        share: [m] of the lake's frames when the dictionary was first served.
        config: what the dictionary was trained for.
    """

    con: Connection
    lake: Lake
    strings: LakeStrings
    codes: Float32Array
    postures: Float32Array
    share: Float64Array
    config: PosturesConfig
    poses: PoseReader

    @cached_property
    def colours(self) -> Float64Array:
        """[m, 3]: near symbols have like colours."""
        return motif_colours(motif_order(self.codes))

    @cached_property
    def _typical(self) -> Float64Array | None:
        return posture_bodies(self.postures, self.config.frames)

    def codes_of(self, clips: Sequence[str]) -> dict[str, Int32Array]:
        """[T] symbols of the postures of clips, parts read once; without clips that are being recoded."""
        return codes_of_clips(self.con, self.lake, self.strings.model, clips)

    @property
    def about_bodies(self) -> str:
        """What the stick figures of symbols are, in a few words."""
        return "typical postures of the dictionary" if self._typical is not None else "moments of clips of that symbol"

    @property
    def about_dictionary(self) -> str:
        return f"{self.strings.model}, {len(self.codes)} symbols"

    @property
    def about_matrix(self) -> str:
        """What one sees in a matrix."""
        return (
            "The matrix has the distances of their postures (PESTA, figure 4): the lighter, the nearer. The line is "
            "what is aligned to what; symbols that it strides over are boxed. Stick figures are "
            f"{self.about_bodies}, numbers their symbols."
        )

    def bodies(self, symbols: IntArray) -> Float64Array:
        """[n, 21, 3] a body for each symbol; not finite where a symbol of a dictionary over rotations is nowhere.

        Over rotations: the first moment of the first clip whose string holds the symbol.
        """
        if self._typical is not None:
            return np.asarray(self._typical[symbols])
        kinds, places = np.unique(symbols, return_inverse=True)
        return np.asarray(np.stack([self._moment(int(symbol)) for symbol in kinds])[places])

    def _moment(self, symbol: int) -> Float64Array:
        strings = self.strings
        found = np.flatnonzero(strings.repository.symbols == symbol)
        if not len(found):
            return np.full((len(JOINTS), 3), np.nan)
        clip = strings.clips[int(np.searchsorted(strings.repository.offsets, found[0], side="right")) - 1]
        frame = int(strings.starts[found[0]]) + round(clip.fps / self.config.fps / 2)
        return np.asarray(self.poses.positions(clip.clip)[min(frame, clip.frames - 1)], dtype=np.float64)


def read_symbols(con: Connection, lake: Lake, strings: LakeStrings | None = None) -> SymbolMaterial:
    """Read what pictures of a lake's strings are made from.

    Raises:
        UserError: the lake has no strings yet (`read_strings`).
    """
    strings = strings or read_strings(con)
    file = sound(lake, fetch(con, "model_file", {"model": strings.model})[0]["file"])
    # Not `load_dictionary`: no encoder is needed, nor torch.
    tensors, kept = read_tensors(file, DICTIONARY_KEY, "codes", "postures")
    share = np.array([row["share"] for row in fetch(con, "posture_shares")], dtype=np.float64)
    codes, postures, config = tensors["codes"], tensors["postures"], PosturesConfig(**kept["config"])
    return SymbolMaterial(con, lake, strings, codes, postures, share, config, PoseReader(con, lake))


def posture_bodies(postures: FloatArray, config: WordConfig) -> Float64Array | None:
    """[m, 21, 3] bodies of postures [m, D] that are kept as `word_features` of one frame; None of rotations.

    In body lengths, the hips at the origin, facing +z. Joints that the features leave out lie between their
    neighbours, toes at the ankles.
    """
    if config.representation != "positions":
        return None
    joints = list(config.joint_indices)
    bodies = np.zeros((len(postures), len(JOINTS), 3))
    bodies[:, joints] = np.asarray(postures[:, : 3 * len(joints)], dtype=np.float64).reshape(len(postures), -1, 3)
    for name, (start, end, share) in _BETWEEN.items():
        if INDEX[name] not in joints:
            bodies[:, INDEX[name]] = (1 - share) * bodies[:, INDEX[start]] + share * bodies[:, INDEX[end]]
    return bodies
