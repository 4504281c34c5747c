"""PESTA's experiments on a labelled lake, by name."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, Final

from motionlake.arrays import StepProgress
from motionlake.errors import UserError
from motionlake.evaluation.clips import LabelledOptions
from motionlake.evaluation.pesta.holistic import measure_holistic
from motionlake.evaluation.pesta.measuring import Measuring
from motionlake.evaluation.pesta.robustness import measure_robustness
from motionlake.evaluation.pesta.several_labels import measure_several_labels
from motionlake.evaluation.pesta.sizes import measure_sizes
from motionlake.evaluation.pesta.sub_queries import measure_sub_queries
from motionlake.evaluation.pesta.whole import measure_whole
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.lake.strings import read_strings

WHOLE: Final = "whole"
PROTOCOLS: Final[Mapping[str, Callable[[Measuring], dict[str, Any] | None]]] = {
    WHOLE: measure_whole,
    "sub-queries": measure_sub_queries,
    "holistic": measure_holistic,
    "several-labels": measure_several_labels,
    "robustness": measure_robustness,
    "sizes": measure_sizes,
}
USUAL: Final = (WHOLE, "sub-queries")


def evaluate_pesta(
    con: Connection,
    lake: Lake,
    options: LabelledOptions,
    *,
    stride: int | None = None,
    gaps: bool | None = None,
    protocols: Collection[str] = USUAL,
    progress: StepProgress = lambda what, done, total: None,
) -> dict[str, Any]:
    """Retrieval by the lake's strings.

    Args:
        con, lake: the lake.
        options: which clips.
        stride: w of "sta"; the paper's if not given: 3 for whole clips, 2 for parts of them.
        gaps: of "sta"; as config.toml says if not given. Sub-queries of long queries have none.
        protocols: names of `PROTOCOLS`.
        progress: hears what is done, and how much of it.

    Returns:
        Of "whole" by method, as `measure_whole` has it, with none where no two clips share a label; of each other
        protocol, by its name with "_" for "-", what it returns; None where clips have nothing that it measures by.

    Raises:
        UserError: no such column or protocol, no strings, or nothing to measure.
    """
    if unknown := sorted(set(protocols) - set(PROTOCOLS)):
        raise UserError(f"no protocol {', '.join(unknown)}; there are {', '.join(PROTOCOLS)}")
    check_served(lake, "alignment")
    strings, chosen = read_strings(con), options.coded(con)
    measuring = Measuring(con, lake, strings, chosen, options, stride, gaps, progress)
    found = {name: measure(measuring) for name, measure in PROTOCOLS.items() if name in protocols}
    if not any(found.values()):
        raise UserError(
            f"no two of the {len(chosen.labelled().labels)} clips with a {options.column} share one, and no two clips "
            "have segments of one class: there is nothing to measure; --label-column names another column of labels.csv"
        )
    whole = found.pop(WHOLE, None) or {}
    return {**whole, **{name.replace("-", "_"): rows for name, rows in found.items()}}
