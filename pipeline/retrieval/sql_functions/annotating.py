"""What people decided about clips, in SQL."""

from __future__ import annotations

from motionlake.lake.annotations import Annotation, Annotations
from motionlake.retrieval.sql_functions import Served, columns, sql_function


@sql_function(columns(Annotation, "id", "clip", "kind", "value", "start", "stop", "who", "made_at"))
def clip_annotations(served: Served, kind: str | None = None) -> list[Annotation]:
    """The tags, labels, segments and verdicts of people that hold now; what the source says is in `clips`."""
    return Annotations(served.lake).current(kind=kind)
