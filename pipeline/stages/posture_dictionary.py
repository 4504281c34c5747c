"""The posture dictionary (PESTA, section 5.2), trained on the clips of a lake or taken pretrained."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Progress
from motionlake.errors import UserError
from motionlake.lake import frames
from motionlake.lake.catalog import fetch
from motionlake.lake.config import LakeConfig
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.features import word_features
from motionlake.pesta import config as postures_config
from motionlake.pesta import occupancy
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.reader import LakeReader

if TYPE_CHECKING:
    from motionlake.pesta.dictionary import PostureDictionary

MOST_CLIPS = 2_000


class PostureDictionaryKind(ModelKind[list[Float32Array]]):
    """What turns a posture into a symbol. Once trained it is frozen: new clips are coded with it (section 8.5.1)."""

    name = "postures"
    config = postures_config.PosturesConfig
    title = "dictionary"
    use = "codes the frames"
    command = "postures"
    help = """Train the posture dictionary that config.toml names; `motionlake run all` then codes with it.

    [postures] in config.toml says which dictionary ("neural_gas", "kmeans", "som", or the autoencoders "information"
    and "adversarial"), how many symbols, and from which seed. An autoencoder's training that was interrupted goes on
    where it stopped.

    Example: motionlake train postures --lake mylake
    """
    said = "code with it: motionlake run all --lake {lake}"
    pretrained = postures_config.PRETRAINED_POSTURES
    kept = ("clips", "postures", "m", "occupied", "perplexity")

    def takes_pretrained(self, at: LakeReader) -> bool:
        wanted = at.config.postures
        if not self.fits(at.config):
            return False
        return wanted.weights == "pretrained" or _count(at) < postures_config.ENOUGH * wanted.m

    def announce(self, at: LakeReader) -> str:
        config = at.config.postures
        return f"will train a dictionary of {config.m} symbols ({config.dictionary})"

    def data(self, at: LakeReader, where: Selection) -> list[Float32Array] | None:
        """[T, D] postures of clips drawn at random, the same share of each, up to `max_postures`; in order of the
        clips."""
        rows, config = fetch(at.con, "clip_lengths"), at.config.postures
        random = np.random.default_rng(config.seed)
        chosen = sorted(random.permutation(len(rows))[:MOST_CLIPS].tolist())
        clips = {rows[i]["clip"]: rows[i] for i in chosen}
        seconds = sum(row["frames"] / row["fps"] for row in clips.values())
        share = min(1.0, config.max_postures / max(1.0, seconds * config.fps))
        found: dict[str, Float32Array] = {}
        for dataset, part in sorted({(row["dataset"], row["part"]) for row in clips.values()}):
            path = sound(at.lake, at.lake.frames_part(dataset, part))
            for stored in frames.read_clips(path, [name for name, row in clips.items() if row["part"] == part]):
                clip = stored.recorded()
                positions, rotations = clip.positions.astype(float), clip.rotations.astype(float)
                found[clip.clip] = word_features(positions, rotations, clip.fps, config.frames)
        return [_some(found[name], share, random) for name in clips] or None

    def fit(
        self, lake: Lake, config: LakeConfig, data: list[Float32Array], checkpoint: Path, progress: Progress
    ) -> PostureDictionary:
        from motionlake.pesta.dictionary_fitting import fit_dictionary

        try:
            return fit_dictionary(data, config.postures, checkpoint=checkpoint, progress=progress)
        except ValueError as error:
            count = sum(map(len, data))
            raise UserError(
                f"{lake.root}: holds {count} postures to train on: {error}; take in more clips, or set m below "
                f"[postures] in {lake.config_file} to {count // 2} or less"
            ) from error

    def load(self, path: Path) -> PostureDictionary:
        from motionlake.pesta.dictionary import load_dictionary

        return load_dictionary(path)

    def hints(self, config: LakeConfig, metrics: Mapping[str, Any]) -> list[str]:
        return [occupancy.line(metrics)]


POSTURE_DICTIONARY: Final = PostureDictionaryKind()


def _count(at: LakeReader) -> float:
    """About how many postures the lake holds."""
    seconds = sum(row["frames"] / row["fps"] for row in fetch(at.con, "clip_lengths"))
    return float(at.config.postures.fps * seconds)


def _some(features: Float32Array, share: float, random: np.random.Generator) -> Float32Array:
    count = int(np.ceil(share * len(features)))
    return features[np.sort(random.choice(len(features), count, replace=False))]
