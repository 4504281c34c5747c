"""The clips of a lake as a torch Dataset, for models of your own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import torch
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.frames import stored_clip
from motionlake.lake.layout import open_lake
from torch.utils.data import Dataset

Item: TypeAlias = dict[str, Any]


class ClipDataset(Dataset[Item]):
    """The canonical motion of the clips of a lake, in the order of their names.

    The catalog is read once, here; an item reads its rows of one Parquet part. So a `DataLoader` may have any number of
    workers, forked or spawned, and the lake may be written to meanwhile: the dataset stays what it was until a part is
    garbage-collected.

    Items are dicts: `positions` [T, 21, 3] float32, metres, y up; `rotations` [T, 21, 4] float32, local quaternions
    (w, x, y, z) relative to the canonical rest pose; `mask` [T], true where there are frames; `fps`; `clip`, its name;
    `label` and `subject`, empty where a clip has none; `target`, the index of its label in `classes`, -1 without one.

    Clips differ in length. Give `length`, and every item has so many frames, as `DataLoader` wants them; or leave it
    out, and give the `DataLoader` the function `collate`, which pads a batch to its longest clip.

    Examples:
        >>> from motionlake import ClipDataset, collate
        >>> from torch.utils.data import DataLoader
        >>> clips = ClipDataset("mylake", split="train")
        >>> clips.classes
        ['dance_a', 'kick', 'spin']
        >>> batch = next(iter(DataLoader(clips, batch_size=3, collate_fn=collate)))
        >>> batch["positions"].shape, batch["lengths"]
        (torch.Size([3, 110, 21, 3]), tensor([ 90,  70, 110]))

    Args:
        lake: its folder.
        split: clips of this value of the split column of labels.csv alone.
        dataset: clips of this dataset alone; by default all recorded clips.
        length: T of every item: of a longer clip a window, which torch's random generator draws; a shorter one is
            followed by zeros, where `mask` is false.
        transform: applied to every item.
        classes: labels by their index, where another dataset has set them; by default the labels of these clips by
            name.

    Attributes:
        clips: n names.
        classes: of `target`.
        targets: n indices into `classes`.

    Raises:
        UserError: there is no such lake, or it has no such clips.
        ValueError: length < 1.
    """

    def __init__(
        self,
        lake: Path | str,
        split: str | None = None,
        dataset: str | None = None,
        length: int | None = None,
        transform: Callable[[Item], Any] | None = None,
        *,
        classes: Sequence[str] | None = None,
    ) -> None:
        if length is not None and length < 1:
            raise ValueError(f"length = {length}: a window has at least 1 frame")
        self._lake, self._length, self._transform = open_lake(lake), length, transform
        with reading(self._lake) as con:
            self._rows = fetch(con, "dataset_clips", {"split": split, "dataset": dataset})
        if not self._rows:
            chosen = {"split": split, "dataset": dataset}
            wanted = " and ".join(f"{name} {value}" for name, value in chosen.items() if value is not None)
            todo = "`motionlake sql 'SELECT dataset, split, count(*) FROM clips GROUP BY ALL'`"
            raise UserError(f"{lake}: has no clips{' of ' * bool(wanted)}{wanted}; list what there is with {todo}")
        labels = {row["label"] for row in self._rows if row["label"] is not None}
        self.clips: list[str] = [row["clip"] for row in self._rows]
        self.classes: list[str] = sorted(labels) if classes is None else list(classes)
        index = {label: i for i, label in enumerate(self.classes)}
        self.targets: list[int] = [index.get(row["label"], -1) for row in self._rows]

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, at: int) -> Any:
        row = self._rows[at]
        frames = stored_clip(self._lake, row)
        window = self._window(len(frames.positions))
        item = {
            "positions": self._padded(torch.from_numpy(frames.positions[window].copy())),
            "rotations": self._padded(torch.from_numpy(frames.rotations[window].copy())),
            "mask": self._padded(torch.ones(window.stop - window.start, dtype=torch.bool)),
            "fps": frames.fps, "clip": row["clip"], "label": row["label"] or "", "target": self.targets[at],
            "subject": row["subject"] or "",
        }  # fmt: skip
        return item if self._transform is None else self._transform(item)

    def _window(self, frames: int) -> slice:
        length = frames if self._length is None else min(frames, self._length)
        start = int(torch.randint(frames - length + 1, ())) if length < frames else 0
        return slice(start, start + length)

    def _padded(self, values: torch.Tensor) -> torch.Tensor:
        """Values [t, ...] of a clip's frames, followed by zeros (false) up to the length of items."""
        missing = 0 if self._length is None else self._length - len(values)
        return torch.cat([values, values.new_zeros(missing, *values.shape[1:])]) if missing else values


def collate(items: Sequence[Mapping[str, Any]]) -> Item:
    """A batch of items of `ClipDataset`, clips of any length, for `DataLoader(collate_fn=collate)`.

    Returns:
        Every tensor of the items whose first axis is T, padded with zeros to the longest, [B, T, ...], `mask` among
        them; `lengths` [B], the frames of each; numbers as tensors [B]; all else as lists of B.
    """
    batch: Item = {"lengths": torch.stack([item["mask"].sum() for item in items])}
    for name in items[0]:
        values = [item[name] for item in items]
        if isinstance(values[0], torch.Tensor):
            batch[name] = torch.nn.utils.rnn.pad_sequence(values, batch_first=True)
        elif isinstance(values[0], int | float):
            batch[name] = torch.tensor(values)
        else:
            batch[name] = values
    return batch
