"""The clips of a lake as a torch Dataset."""

from __future__ import annotations

from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from motionlake import ClipDataset
from motionlake.errors import UserError
from motionlake.lake.clip_dataset import collate
from motionlake.motion.skeleton import JOINTS
from torch.utils.data import DataLoader

from tests.lakes import Changed, query


@pytest.fixture
def split_lake(lake: Path) -> Path:
    """Clips by name: train, test, test, train, test, test, ...; the second without a label."""
    with Changed(lake) as con:
        con.execute(
            "UPDATE clips SET split = CASE WHEN n % 3 = 1 THEN 'train' ELSE 'test' END, "
            "label = CASE WHEN n <> 2 THEN label END "
            "FROM (SELECT clip AS name, row_number() OVER (ORDER BY clip) AS n FROM clips) WHERE clip = name"
        )
    return lake


def test_items_are_the_lakes_frames(split_lake: Path) -> None:
    found = ClipDataset(split_lake)
    rows = query(split_lake, "SELECT clip, label, subject, fps, frames FROM clips ORDER BY clip")
    assert found.clips == [row[0] for row in rows]
    assert found.classes == sorted({row[1] for row in rows if row[1] is not None})
    assert found.targets[1] == -1
    for item, (clip, label, subject, fps, frames) in zip([found[i] for i in range(4)], rows[:4], strict=True):
        assert (item["clip"], item["label"], item["subject"], item["fps"]) == (clip, label or "", subject or "", fps)
        assert item["target"] == (found.classes.index(label) if label else -1)
        assert item["positions"].shape == (frames, 21, 3)
        assert item["rotations"].shape == (frames, 21, 4)
        assert item["mask"].tolist() == [True] * frames
        assert {item["positions"].dtype, item["rotations"].dtype} == {torch.float32}
        text = "SELECT root_x, {0}_x, {0}_qw FROM frames WHERE clip = $clip ORDER BY frame".format(JOINTS[7])
        stored = np.array(query(split_lake, text, clip=clip))
        np.testing.assert_array_equal(item["positions"][:, [0, 7], 0], stored[:, :2])
        np.testing.assert_allclose(item["rotations"][:, 7, 0], stored[:, 2], atol=1e-3)


def test_splits_and_datasets(split_lake: Path) -> None:
    whole, train, test = ClipDataset(split_lake), ClipDataset(split_lake, "train"), ClipDataset(split_lake, "test")
    assert train.clips == whole.clips[::3]
    assert sorted(train.clips + test.clips) == whole.clips
    assert ClipDataset(split_lake, dataset="clips").clips == whole.clips
    known = ClipDataset(split_lake, "test", classes=train.classes)
    assert known.classes == train.classes
    assert [known[i]["target"] for i in range(len(known))] == known.targets
    nowhere: tuple[dict[str, Any], ...] = ({"split": "validation"}, {"dataset": "elsewhere"})
    for arguments in nowhere:
        with pytest.raises(UserError, match="has no clips of"):
            ClipDataset(split_lake, **arguments)
    with pytest.raises(UserError, match="no lake here"):
        ClipDataset(split_lake / "frames")
    with pytest.raises(ValueError, match="length = 0"):
        ClipDataset(split_lake, length=0)


def speeds(item: dict[str, Any]) -> dict[str, Any]:
    """A transform; at the top of its module, where spawned workers find it."""
    return item | {"speeds": torch.diff(item["positions"], dim=0, prepend=item["positions"][:1])}


def test_a_loader_with_two_workers(split_lake: Path) -> None:
    """Batches hold what items do, padded and masked, in order."""
    found = ClipDataset(split_lake, transform=speeds)
    loader = DataLoader(found, batch_size=4, collate_fn=collate, num_workers=2)
    batches = list(loader)
    assert [clip for batch in batches for clip in batch["clip"]] == found.clips
    for first, batch in zip(range(0, len(found), 4), batches, strict=True):
        items = [found[i] for i in range(first, min(first + 4, len(found)))]
        assert batch["mask"].shape == batch["positions"].shape[:2]
        assert batch["mask"].sum(1).tolist() == batch["lengths"].tolist() == [len(i["positions"]) for i in items]
        assert batch["target"].tolist() == [item["target"] for item in items]
        assert batch["fps"].tolist() == pytest.approx([item["fps"] for item in items])
        assert batch["label"] == [item["label"] for item in items]
        for name in ("positions", "rotations", "speeds"):
            for at, item in enumerate(items):
                assert torch.equal(batch[name][at][batch["mask"][at]], item[name])
                assert not batch[name][at][~batch["mask"][at]].any()


def test_a_spawned_worker_can_be_sent_one(split_lake: Path) -> None:
    found = ClipDataset(split_lake, "train", length=9, transform=speeds)
    sent = ForkingPickler.loads(ForkingPickler.dumps(found))
    assert (sent.clips, sent.classes) == (found.clips, found.classes)
    assert sent[0]["speeds"].shape == (9, 21, 3)


def test_windows_are_drawn_from_long_clips(split_lake: Path) -> None:
    whole, cut = ClipDataset(split_lake), ClipDataset(split_lake, length=20)
    starts = set()
    torch.manual_seed(0)
    drawn = [cut[0] for _ in range(10)]
    for item in drawn:
        everywhere = whole[0]["rotations"].unfold(0, 20, 1).permute(0, 3, 1, 2)
        at = torch.nonzero((everywhere == item["rotations"]).all(dim=(1, 2, 3)))[:, 0]
        assert torch.equal(whole[0]["positions"][at[0] : at[0] + 20], item["positions"])
        starts.add(int(at[0]))
    assert len(starts) > 3
    torch.manual_seed(0)
    assert all(torch.equal(cut[0]["positions"], item["positions"]) for item in drawn)


def test_clips_shorter_than_the_length_are_padded(split_lake: Path) -> None:
    """The `DataLoader` makes batches by itself, of long clips and short ones, with labels and without."""
    whole = ClipDataset(split_lake)
    length = sorted(len(whole[i]["positions"]) for i in range(len(whole)))[len(whole) // 2]
    loader = DataLoader(ClipDataset(split_lake, length=length), batch_size=4, num_workers=2)
    batches = list(loader)
    assert [clip for batch in batches for clip in batch["clip"]] == whole.clips
    assert [label for batch in batches for label in batch["label"]][1] == ""
    padded = 0
    for first, batch in zip(range(0, len(whole), 4), batches, strict=True):
        assert batch["positions"].shape == (len(batch["clip"]), length, 21, 3)
        for at in range(len(batch["clip"])):
            clip, mask = whole[first + at], batch["mask"][at]
            assert int(mask.sum()) == min(length, len(clip["positions"]))
            if len(clip["positions"]) <= length:
                assert torch.equal(batch["positions"][at][mask], clip["positions"])
                assert torch.equal(batch["rotations"][at][mask], clip["rotations"])
                assert not batch["positions"][at][~mask].any()
                padded += 1
    assert 0 < padded < len(whole)


def test_collate_counts_the_frames_of_padded_items(split_lake: Path) -> None:
    padded, whole = ClipDataset(split_lake, length=100_000), ClipDataset(split_lake)
    batch = collate([padded[0], padded[1]])
    assert batch["lengths"].tolist() == [len(whole[0]["positions"]), len(whole[1]["positions"])]
    assert torch.equal(batch["positions"][0][batch["mask"][0]], whole[0]["positions"])
