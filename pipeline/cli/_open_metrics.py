"""What a lake holds and has done, as OpenMetrics text, which Prometheus and its kin collect."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

_ESCAPES: Final = str.maketrans({"\\": r"\\", '"': r"\"", "\n": r"\n"})
_STATES: Final = {"batches": "done", "failed": "failed", "due": "due"}
# By column of `stage_metrics`: the name after "motionlake_stage_", its unit, and what it is.
_OF_STAGES: Final = {
    "clips": ("clips", "", "clips that are done"),
    "frames": ("frames", "", "frames that are done"),
    "bytes": ("size_bytes", "bytes", "size of the files made"),
    "tries_again": ("tries_again", "", "runs of batches after their first"),
    "work_seconds": ("work_seconds", "seconds", "time of the workers, one after the other"),
    "clips_per_second": ("clips_per_second", "", "clips by time of the workers"),
    "frames_per_second": ("frames_per_second", "", "frames by time of the workers"),
}
_OF_DATASETS: Final = {
    "clips": "clips in the lake", "frames": "frames in the lake", "rejects": "source files that stand rejected",
}  # fmt: skip


@dataclass(frozen=True)
class _Family:
    """Values of one name, by their labels; those that are not known are left out."""

    name: str
    unit: str
    told: str
    values: Sequence[tuple[Mapping[str, str], float | None]]

    def lines(self) -> Iterator[str]:
        yield f"# TYPE motionlake_{self.name} gauge"
        if self.unit:
            yield f"# UNIT motionlake_{self.name} {self.unit}"
        yield f"# HELP motionlake_{self.name} {self.told}"
        for labels, value in self.values:
            if value is not None:
                said = ",".join(f'{name}="{label.translate(_ESCAPES)}"' for name, label in labels.items())
                yield (
                    f"motionlake_{self.name}{{{said}}} {value:.17g}" if said else f"motionlake_{self.name} {value:.17g}"
                )


def open_metrics(
    datasets: Sequence[Mapping[str, Any]],
    stages: Sequence[Mapping[str, Any]],
    due: Mapping[str, int | None],
    damaged: int,
) -> str:
    """Text of OpenMetrics 1.0.

    Args:
        datasets: rows of `status_datasets`.
        stages: rows of `stage_metrics`.
        due: by stage, batches that are to do; None where it is made only when it is asked for.
        damaged: files that are missing or changed.
    """
    ran = {row["stage"]: row for row in stages}
    counted = {
        stage: {**ran.get(stage, {"batches": 0, "failed": 0}), "due": due.get(stage)} for stage in {**due, **ran}
    }
    families = [
        _Family(f"dataset_{name}", "", told, [({"dataset": row["dataset"]}, row[name]) for row in datasets])
        for name, told in _OF_DATASETS.items()
    ]
    batches = [
        ({"stage": stage, "state": state}, row[column])
        for stage, row in counted.items() for column, state in _STATES.items()
    ]  # fmt: skip
    families.append(_Family("stage_batches", "", "batches of clips", batches))
    families += [
        _Family(f"stage_{name}", unit, told, [({"stage": stage}, row[column]) for stage, row in ran.items()])
        for column, (name, unit, told) in _OF_STAGES.items()
    ]
    families.append(_Family("damaged_files", "", "files of the lake that are missing or changed", [({}, damaged)]))
    return "\n".join([*(line for family in families for line in family.lines()), "# EOF\n"])
