"""What faults are planted in, by groups of modules, and which tests are to find them, the quick ones first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Module:
    """A module that faults are planted in.

    Attributes:
        tests: files that are to find them, in the order that they run.
        functions: where in it, and in what is defined in them; all of it where none are named.
    """

    tests: tuple[str, ...]
    functions: tuple[str, ...] = ()


def _tests(names: str) -> tuple[str, ...]:
    return tuple(f"tests/test_{name}.py" for name in names.split())


_ALIGN: Final = Module(_tests("alignment alignment_long_query align align_ranges"))
_LONG: Final = Module(_tests("alignment_long_query align"))
_SYMBOLS: Final = Module(_tests("squares symbols tandem cycles"))
_EMD: Final = Module(_tests("emd nearest_signatures"))
_MOVES: Final = Module(_tests("track moves_windows moves"))
_KEYS: Final = _tests("stage_keys")

GROUPS: Final[Mapping[str, Mapping[str, Module]]] = {
    "alignment": {
        "pipeline/pesta/kernels.py": _ALIGN,
        "pipeline/pesta/scan.py": _ALIGN,
        "pipeline/pesta/nearest.py": _ALIGN,
        "pipeline/pesta/matches.py": _ALIGN,
        "pipeline/pesta/vectors.py": _ALIGN,
        "pipeline/pesta/selection.py": _ALIGN,
        "pipeline/pesta/strings.py": _ALIGN,
        "pipeline/pesta/segments.py": _ALIGN,
        "pipeline/pesta/strip_rows.py": _LONG,
        "pipeline/pesta/paths.py": _ALIGN,
        "pipeline/pesta/cycles.py": Module(_tests("cycles align_ranges")),
        "pipeline/pesta/long_query.py": _LONG,
        "pipeline/pesta/long_query_paths.py": _LONG,
    },
    "symbols": {
        "pipeline/pesta/symbols.py": _SYMBOLS,
        "pipeline/pesta/tandem.py": _SYMBOLS,
        "pipeline/pesta/squares.py": _SYMBOLS,
    },
    "emd": {
        "pipeline/deep_motifs/emd.py": _EMD,
        "pipeline/deep_motifs/emd_bounds.py": _EMD,
        "pipeline/deep_motifs/emd_search.py": _EMD,
    },
    "dtw": {
        "pipeline/motion/dtw.py": Module(_tests("dtw subsequence split_retrieval evaluate shortlist")),
        "pipeline/motion/moves.py": _MOVES,
        "pipeline/motion/moves_index.py": _MOVES,
        "pipeline/motion/moves_windows.py": _MOVES,
    },
    "losses": {
        "pipeline/early_stopping.py": Module(_tests("deep_motifs_recipe postures")),
        "pipeline/deep_motifs/words/training.py": Module(
            _tests("training"), ("_loss", "_rate", "_curve", "_triplet_loss", "_metric_loss")
        ),
        "pipeline/deep_motifs/words/deep_motifs.py": Module(
            _tests("deep_motifs_recipe"), ("_loss", "drawn", "_batched", "triplet_loss")
        ),
        "pipeline/deephums/training.py": Module(
            _tests("descriptor_network"), ("_loss", "contrastive_loss", "class_contrast", "_mean")
        ),
        "pipeline/deephums/submotions.py": Module(_tests("submotion_search"), ("_loss",)),
        "pipeline/glogen/training.py": Module(_tests("glogen"), ("_loss", "_block_loss", "unseen", "_error")),
        "pipeline/glogen/inbetweening.py": Module(
            _tests("locgen"), ("_frames_loss", "_examples", "_between_loss", "poses_between")
        ),
        "pipeline/pesta/autoencoder_training.py": Module(
            _tests("postures"),
            ("held_out", "_step", "_made_again", "_little_information", "_entropy", "_unlike_one_hot", "_is",
             "_validated"),
        ),
    },
    "keys": {
        "pipeline/lake/config.py": Module(_KEYS, ("config_hash",)),
        "pipeline/lake/models.py": Module(_KEYS, ("current_model", "fitting_model", "file_hash")),
        "pipeline/stages/stage.py": Module(_KEYS),
        "pipeline/stages/key_cache.py": Module(_KEYS),
        "pipeline/stages/model_kind.py": Module(_KEYS),
        "pipeline/stages/reader.py": Module(_KEYS),
        "pipeline/stages/frames.py": Module(
            _KEYS, ("due", "plan", "intake_of", "_new_shards", "shard_of", "content_key", "clips_key")
        ),
        "pipeline/stages/sources.py": Module(
            _KEYS, ("shaping", "shaping_hash", "compare", "_hashed")
        ),
        "pipeline/stages/source_files.py": Module(_KEYS, ("scan", "_files", "content_hash")),
        "pipeline/stages/motif_model.py": Module(_KEYS, ("key",)),
        "pipeline/stages/word_network.py": Module(_KEYS, ("key", "takes_pretrained")),
        "pipeline/stages/posture_dictionary.py": Module(_KEYS, ("takes_pretrained",)),
        "jobs/models.py": Module(_KEYS, ("obtain", "train", "_make")),
    },
}  # fmt: skip
