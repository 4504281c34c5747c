"""What the tables of `motionlake evaluate` say: a line on each measure, and the rows of that of synthesis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

Row = Mapping[str, Any]

# What the columns of the tables say.
METRICS: Final = {
    "nn": "share of queries whose nearest clip is of their class; higher is better",
    "top1": "share of queries whose nearest clip is of their class; higher is better",
    "top5": "share of the first 5 hits that are of the query's class; higher is better",
    "top10": "share of the first 10 hits that are of the query's class; higher is better",
    "first_tier": "of a class of R other clips, the share among the first R hits; higher is better",
    "second_tier": "the same among the first 2 R hits; higher is better",
    "map": "mean average precision: 1 where all clips of the query's class come before all others; higher is better",
    "cross_subject_nn": "nn among clips of other subjects; higher is better",
    "one_vs_all": "share of clips that a classifier for each class gives the right class; higher is better",
    "p_at_2": "p_at_2, p_at_5, …: share of the first 2, 5, … hits that are of the query's class; higher is better",
    "pr_area": "area under the precision-recall curve, 1 at most; higher is better",
    "dtw_error_mm": "millimetres from the query's joints to those of its first hit, after DTW; lower is better",
    "retrieval_ms": "milliseconds to answer a query; lower is better",
    "accuracy": 'share of labelled words given the right class, "unknown" for a class not learned; higher is better',
    "accuracy_known": "of the words whose class was learned, each given a learned class; higher is better",
    "accuracy_known_or_unknown": 'the same, where "unknown" counts as wrong; higher is better',
    "all_p_at_2": "all_p_at_2, …: the same over all queries, those that cannot be answered counted as wrong",
    "n_refused": "queries that are one posture, which `align` refuses",
    "all_map": "map with the refused queries counted as 0; higher is better",
    "mean_of_classes": "map, mean over the classes; higher is better",
    "replaced": "share of pieces of clips that are of other classes; beside it map by method, higher is better",
    "m": "symbols of a dictionary",
    "symbols": "length of all strings together, by which a query takes time; lower is better",
    "milliseconds": "time of a query for its first 20 answers, on one thread; lower is better",
    "occupied": "symbols that the dictionary's own postures use, m at best; higher is better",
    "seconds": "time that the search took; lower is better",
    "n": "queries measured",
    "n_known": "words whose class was learned",
}
# What the rows of the table of synthesis say.
SYNTHESIS_METRICS: Final = {
    "FID": "distance of the distributions of descriptors of two seconds, made against test clips; lower is better",
    "precision": "share of made motions that lie among test clips; higher is better",
    "recall": "share of test clips that lie among made motions; higher is better",
    "density": "how many test clips a made motion lies near, 1 where both are alike",
    "coverage": "share of test clips that a made motion lies near; higher is better",
    "diversity": "how unlike made motions are one another, by descriptors; near 1 times the recorded is better",
    "multimodality": "the same of motions of one class",
    "pose spread": "body lengths between motions of one class at the same time; near the recorded is better",
    "energy, m²/s²": "mean squared speed of joints seen from the body; near the recorded is better",
    "travel speed, m/s": "of the hips, from second to second; near the recorded is better",
    "usual seconds": "share whose energy and travel nine of ten recorded seconds have; near the recorded is better",
    "jerk, m/s³": "change of acceleration; near the recorded is better",
    "skate ratio": "share of frames with a foot near the ground in which even the slowest foot slides; lower is better",
    "penetration, m": "how deep a joint goes below the ground; lower is better",
    "airborne, s": "longest time off the ground; at most the recorded is better",
    "bone-length drift, %": "lower is better",
    "path circling": "turns a metre to one side; near the recorded is better",
    "range of wrist": "degrees that the hands turn about their mean; 0 is a stiff hand",
    "range of head": "the same of the head",
    "range of toe": "the same of the toes",
    "seconds until the class": "from a start of another class, median; lower is better",
    "class within 1.5 s": "share that moves as the class does by then; higher is better",
    "jump at the seam, mm": "off the way that the joints were going; near the recorded is better",
    "first 200 ms, mm": "from what really follows, by the world; lower than the last pose held is better",
    "nearest training clip": "body lengths, median; far below the recorded is a copy",
    "copying z": "below -3 made motions are nearer to training clips than test clips are",
}
BESIDE_RECORDED: Final = (
    ("diversity", "diversity"), ("multimodality", "multimodality"), ("pose_spread", "pose spread"),
    ("energy", "energy, m²/s²"), ("travel_speed", "travel speed, m/s"), ("usual", "usual seconds"),
    ("jerk", "jerk, m/s³"), ("skate_ratio", "skate ratio"), ("penetration", "penetration, m"),
    ("airborne", "airborne, s"), ("bone_length_drift", "bone-length drift, %"), ("path_circling", "path circling"),
)  # fmt: skip


def synthesis_rows(found: dict[str, Any]) -> list[Row]:
    """Measures beside those of recorded clips, or of the last pose held."""
    held, recognised, near = found["zero_velocity"], found["recognised"] or {}, found["nearest_real"]
    last, recorded, training = "last pose held", "recorded clips", "training against test clips"
    alike = {side: found["likeness"][side] or {} for side in ("made", "training")}
    rows: list[tuple[str, Any, Any, str]] = [
        *((f"error at {t} ms, mm", error, held["errors_ms"][t], last) for t, error in found["errors_ms"].items()),
        ("mean per-joint error, mm", found["mean_per_joint_error"], held["mean_per_joint_error"], last),
        ("Euclidean distance, mm", found["euclidean"], held["euclidean"], last),
        *(
            (name, alike["made"].get(name.lower()), alike["training"].get(name.lower()), training)
            for name in ("FID", "precision", "recall", "density", "coverage")
        ),
        *((title, found[name]["made"], found[name]["real"], recorded) for name, title in BESIDE_RECORDED),
        *(
            (f"range of {name.split('_')[-1]}", found["angular_range"][name]["made"],
             found["angular_range"][name]["real"], recorded)
            for name in ("left_wrist", "head", "left_toe")
        ),
        ("class recognised, starts of other classes", recognised.get("made"), recognised.get("real"), recorded),
    ]  # fmt: skip
    if changed := found["transitions"]:
        soon, jump, first = changed["soon"], changed["jump_mm"], changed["continued_mm"]
        rows += [
            ("seconds until the class", changed["seconds"], None, ""),
            ("class within 1.5 s", soon["made"], soon["real"], recorded),
            ("jump at the seam, mm", jump["made"], jump["real"], recorded),
            ("first 200 ms, mm", first["made"], first["held"], last),
        ]
    if near:
        rows += [
            ("nearest training clip", near["made"]["median"], near["test"]["median"], recorded),
            ("copying z", near["z"], None, ""),
        ]
    return [{"measure": a, "made": b, "beside": c, "beside is": d} for a, b, c, d in rows]
