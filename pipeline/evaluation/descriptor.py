"""DeepHuMS's measures on a labelled lake (section 3.3.3): descriptors, and other search methods beside them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, FloatArray
from motionlake.deep_motifs.emd import emd_many, emd_matrix
from motionlake.errors import UserError
from motionlake.evaluation.clips import Chosen, Notice, choose, read_positions, told
from motionlake.evaluation.dtw import PATIENCE, baseline_features, frame_distances, joint_error
from motionlake.evaluation.ranking import first_hits, score_split
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, check_served
from motionlake.lake.settings import served_config
from motionlake.lake.strings import read_strings
from motionlake.motion.features import body_length
from motionlake.pesta.scan import pairwise
from motionlake.pesta.strings import Repository
from motionlake.retrieval.labelled_clips import DescribedClip, DescribedClips, described_clips, lake_ground
from motionlake.retrieval.registry import methods as searchers
from motionlake.retrieval.weighing import fused_distances
from motionlake.stages.descriptors import DESCRIPTORS
from scipy.spatial.distance import cdist

TRANSPORTS_PER_SECOND: Final = 8_000  # on one core, from timings
HITS: Final = 10  # that a look-up finds


def signature_distances(con: Connection, clips: DescribedClips, chosen: Chosen, notice: Notice) -> FloatArray | None:
    """[q, r] earth mover's distances of signatures; None where a clip has none, or they would take minutes."""
    signatures = [signature for signature in clips.signatures if signature is not None]
    if not _all_have(len(signatures), clips, "signature", notice):
        return None
    pairs = len(chosen.queries) * len(chosen.repository) // (2 if chosen.names is None else 1)
    if pairs > PATIENCE * TRANSPORTS_PER_SECOND:
        notice(f"signatures are left out: {pairs} distances would take minutes; see `motionlake evaluate signatures`")
        return None
    known, ground = np.array(signatures, dtype=np.float32), lake_ground(con)
    if chosen.names is None:
        return emd_matrix(known, ground)
    return np.array([emd_many(known[query], known[chosen.repository], ground) for query in chosen.queries])


def alignment_distances(
    con: Connection, lake: Lake, clips: DescribedClips, chosen: Chosen, notice: Notice
) -> FloatArray | None:
    """[q, r] costs of alignment of whole strings as config.toml has it, the greater of both ways.

    None where a clip has no string.
    """
    try:
        strings = read_strings(con)
    except UserError:
        return None
    places = [strings.positions.get(clip.clip) for clip in clips.clips]
    known = [strings.repository.string(place) for place in places if place is not None]
    if not _all_have(len(known), clips, "string", notice):
        return None
    config = served_config(lake).alignment
    own, others = [known[i] for i in chosen.queries], [known[i] for i in chosen.repository]
    there = pairwise(own, Repository.of(others), strings.distances, config)
    back = pairwise(others, Repository.of(own), strings.distances, config)
    for costs, asked in ((there, own), (back, others)):
        costs /= np.array([len(string) for string in asked], dtype=np.float32)[:, None]
    return np.maximum(there, back.T)


def all_fused(methods: Mapping[str, FloatArray], chosen: Chosen) -> FloatArray | None:
    """[q, r] `fused_distances` of methods, each [q, r]; None of a single one."""
    if len(methods) < 2:
        return None
    may = chosen.questions.candidates
    return fused_distances({name: np.where(may, found, np.inf) for name, found in methods.items()})


def _all_have(count: int, clips: DescribedClips, what: str, notice: Notice) -> bool:
    missing = len(clips.clips) - count
    if missing and count:
        notice(f"{what}s are left out: {missing} of the clips have none; make them with `motionlake run all`")
    return not missing


@dataclass(frozen=True)
class DescriptorEvaluation:
    """What was measured, and what pictures of it need.

    Attributes:
        found: what `evaluate_descriptor` tells of.
        labels: [q] classes of the queries.
        descriptors: [q, 512] theirs.
        loss: of the network's training, as it was recorded; may be empty.
    """

    found: dict[str, Any]
    labels: list[str]
    descriptors: Float32Array
    loss: list[float]


def evaluate_descriptor(
    con: Connection,
    lake: Lake,
    *,
    dataset: str | None = None,
    queries: str | None = None,
    repository: str | None = None,
    column: str = "label",
    dtw: bool | None = None,
    notice: Notice = lambda line: None,
    min_quality: str | None = None,
) -> DescriptorEvaluation:
    """Retrieval by the lake's descriptors: clips of one split query those of another.

    Where no labelled clip is of these splits and none is asked for, every labelled clip queries all others. The other
    methods whose tables the lake has, and whole-clip DTW, answer the same queries.

    Args:
        con, lake: the lake.
        dataset: its clips only.
        queries, repository: values of the column split; "test" and "train" where they are not given.
        column: what says the class of clips.
        dtw: compute the DTW baseline; None: where it takes at most `PATIENCE` seconds.
        notice: hears what takes long, is left out or is to be doubted.
        min_quality: the worst verdict of stage "quality" that a clip may have; None: any.

    Returns:
        top1, top10, map, n (queries), pr_area, curve; dtw_error_mm: mean over queries of the joint error between query
        and first hit (`joint_error`, times body_mm: leg plus torso of the mean body of these clips); retrieval_ms: the
        ten nearest of one query by its descriptor; protocol, queries, repository, classes (counts); model: its name and
        what it was trained on; warning: None unless the network was trained on clips that are queries here; methods:
        the same measures by "signature", "alignment", "dtw" and "fused" (of the first two and descriptors), None for
        what the lake lacks or was left out (their retrieval_ms: the distances of one query from the whole repository,
        or fusing them).

    Raises:
        UserError: no such column or split, no descriptors, or nothing to measure.
    """
    network = DESCRIPTORS.served(con)
    if network is None:
        raise UserError(f"{lake.root}: has no descriptors yet; make them with `motionlake run descriptors`")
    check_served(lake, "descriptor", "signature", "alignment")
    clips = described_clips(con, dataset, column, min_quality)
    chosen = choose(clips.clips, queries, repository)
    notice(f"{chosen.protocol}: {len(chosen.queries)} queries, {len(chosen.repository)} clips to find")
    features, body = _features(lake, clips.clips)
    asked, known = clips.descriptors[chosen.queries], clips.descriptors[chosen.repository]
    distances: dict[str, FloatArray] = {}
    ways: dict[str, Callable[[], FloatArray | None]] = {
        "descriptor": lambda: cdist(asked, known),
        "signature": lambda: signature_distances(con, clips, chosen, notice),
        "alignment": lambda: alignment_distances(con, lake, clips, chosen, notice),
        "dtw": lambda: frame_distances(features, dtw, notice, chosen),
        "fused": lambda: all_fused({name: distances[name] for name in searchers("clip") if name in distances}, chosen),
    }
    measured: dict[str, Any] = {}
    for name, compute in ways.items():
        started = time.perf_counter()
        computed = compute()
        seconds = time.perf_counter() - started
        measured[name] = None
        if computed is not None:
            distances[name] = computed
            measured[name] = {
                **asdict(score_split(computed, chosen.questions)),
                "dtw_error_mm": body * _mean_error(computed, chosen, features),
                "retrieval_ms": 1000 * seconds / len(computed),
            }
    labels = [clips.labels[query] for query in chosen.queries]
    found = measured.pop("descriptor") | {
        "retrieval_ms": _look_up_ms(asked, known),
        "body_mm": body,
        "protocol": chosen.protocol,
        "queries": len(chosen.queries),
        "repository": len(chosen.repository),
        "classes": len(set(labels)),
        "model": told(network),
        "warning": _warning(network, [clips.clips[query] for query in chosen.queries]),
        "methods": measured,
    }
    if found["warning"]:
        notice(f"warning: {found['warning']}")
    return DescriptorEvaluation(found, labels, asked, list(network.metrics.get("loss", ())))


def _warning(network: Model, queries: Sequence[DescribedClip]) -> str | None:
    """Which queries the network has been trained on, as far as its metrics tell."""
    metrics = network.metrics
    if metrics.get("pretrained"):
        seen = [clip for clip in queries if clip.dataset in metrics.get("sets", ())]
        trained = "the pretrained network was trained on recordings of this dataset"
    else:
        split, dataset = metrics.get("split"), metrics.get("dataset")
        seen = [clip for clip in queries if split in (None, clip.split) and dataset in (None, clip.dataset)]
        trained = f"{network.model} was trained on " + (f"split {split}" if split else "every clip")
        trained += f" of {dataset}" if dataset else ""
    if not seen:
        return None
    return (
        f"{len(seen)} of {len(queries)} queries are clips that training has seen ({trained}): the measures flatter; "
        "`motionlake train descriptor --split train`, then `motionlake run all`, keeps them apart"
    )


def _mean_error(distances: FloatArray, chosen: Chosen, features: Sequence[Float32Array]) -> float:
    """The mean joint error between query and first hit."""
    pairs = first_hits(distances, chosen.questions).items()
    errors = [joint_error(features[chosen.queries[a]], features[chosen.repository[b]]) for a, b in pairs]
    return float(np.mean(errors))


def _features(lake: Lake, clips: list[DescribedClip]) -> tuple[list[Float32Array], float]:
    """What DTW compares, of every clip, and leg plus torso of their mean body, in millimetres."""
    found, lengths = {}, {}
    for name, fps, positions in read_positions(lake, clips):
        found[name] = baseline_features(positions, fps)
        lengths[name] = body_length(positions)
    return [found[clip.clip] for clip in clips], 1000 * float(np.mean([lengths[clip.clip] for clip in clips]))


def _look_up_ms(queries: Float32Array, repository: Float32Array) -> float:
    """Mean milliseconds of one look-up on one core, one query at a time."""
    from motionlake.deephums.nearest import DescriptorScan
    from motionlake.training import on_threads

    with on_threads(1):
        scan = DescriptorScan(repository)
        scan.nearest(queries[0], HITS)
        started = time.perf_counter()
        for query in queries:
            scan.nearest(query, HITS)
        return 1000 * (time.perf_counter() - started) / len(queries)
