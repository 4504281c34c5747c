"""Words made ready for search, in one file: safetensors, nothing of it code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from motionlake.deep_motifs.words.neighbours import Searched
from motionlake.deep_motifs.words.word_index import WordIndex, WordSpace
from motionlake.deep_motifs.words.word_set import WordSet
from safetensors import safe_open
from safetensors.numpy import save_file

LENGTH = "length"


def save_searched(searched: Searched, path: Path, notes: Mapping[str, str]) -> None:
    """Write a corpus and its index, with notes of the caller's; what can be projected again is left out."""
    index = searched.index
    tensors = {
        **asdict(index.space),
        "centroids": index.centroids,
        "order": index.order,
        "offsets": index.offsets,
        "embedded": index.embedded,
        "frames": searched.words.frames,
        "starts": searched.words.starts,
        "groups": searched.groups,
    }
    save_file(tensors, path, {**notes, LENGTH: str(searched.words.length)})


def load_searched(path: Path) -> tuple[Searched, dict[str, str]]:
    """What `save_searched` wrote, and the notes."""
    with safe_open(path, framework="numpy") as file:
        notes = dict(file.metadata())
        found = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    space = WordSpace(found["centre"], found["basis"], found["mean"], found["components"])
    words = WordSet(found["frames"], found["starts"], int(notes.pop(LENGTH)))
    index = WordIndex.of(space, words, found["centroids"], found["order"], found["offsets"], found["embedded"])
    return Searched(words, found["groups"], index), notes
