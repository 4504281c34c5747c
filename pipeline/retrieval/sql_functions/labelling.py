"""What is learned from labels, clusters and near-duplicates, in SQL."""

from __future__ import annotations

from motionlake.deep_motifs.duplicates import MAX_DISTANCE, Duplicate
from motionlake.lake.catalog import reading
from motionlake.retrieval.classes import ClassifiedClip, LakeClassifier
from motionlake.retrieval.clusters import ClusteredClip, clusters_of_lake
from motionlake.retrieval.protocol import EVERYTHING, ClipFilter, Scope
from motionlake.retrieval.segments import LabelledBand, LakeSegmenter, Lessons, corpus_of
from motionlake.retrieval.sql_functions import Served, columns, sql_function


@sql_function(columns(ClassifiedClip, "label", "confidence", "distance"))
def classify_clip(
    served: Served,
    query: str,
    k: int = 5,
    dataset: str | None = None,
    split: str | None = None,
    min_quality: str | None = None,
) -> list[ClassifiedClip]:
    """The class of a clip by a vote of the first k recorded, labelled clips found, as `motionlake classify`."""
    scope = Scope(dataset, split, dataset is None, min_quality=min_quality)
    classifier: LakeClassifier = served.once(LakeClassifier, k=k, scope=scope)
    return classifier.classify([served.query(query)])


@sql_function(columns(LabelledBand))
def segment_clip(
    served: Served,
    query: str,
    teach: list[str] | None = None,
    teach_clips: list[str] | None = None,
    mirrored: bool = True,
    min_quality: str | None = None,
) -> list[LabelledBand]:
    """The classes along a clip, as `motionlake segment`: learned from datasets, from clips, or from the whole lake."""
    names = None if teach_clips is None else [str(served.query(name).source) for name in teach_clips]
    lessons = Lessons(teach, names, mirrored=mirrored, min_quality=min_quality)
    return LakeSegmenter(served.lake, lessons, corpus=served.once(corpus_of)).segment(served.query(query))


@sql_function(columns(ClusteredClip))
def clip_clusters(served: Served, k: int | None = None, clips: ClipFilter = EVERYTHING) -> list[ClusteredClip]:
    """Every clip in one of k clusters, as `motionlake cluster`; NULL takes the best number."""
    with reading(served.lake) as con:
        return clusters_of_lake(con, served.lake, k, clips)[0]


@sql_function(columns(Duplicate))
def near_duplicates(
    served: Served, max_distance: float = MAX_DISTANCE, dataset: str | None = None, across: bool = False,
    mirrored: bool = False, split: str | None = None, recorded_only: bool = False,
    min_quality: str | None = None,
) -> list[Duplicate]:  # fmt: skip
    """Pairs of clips that are one recording, as `motionlake duplicates`."""
    from motionlake.retrieval.duplicates import near_duplicates

    with reading(served.lake) as con:
        scope = Scope(dataset, split, recorded_only, mirrored, min_quality=min_quality)
        return near_duplicates(con, served.lake, scope, max_distance=max_distance, across=across)
