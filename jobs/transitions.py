"""Job "transitions": compare the clips of a dataset pair by pair of parts, then the contexts of what is near."""

from __future__ import annotations

from motionlake.errors import UserError
from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.stages import embed, motifs, transitions

PAIRS = StageJob(transitions.NAME, transitions.run, transitions.load)
CONTEXTS = StageJob(transitions.CONTEXTS, transitions.run_contexts, transitions.load_contexts, one_load=True)


def run(session: Session, dataset: str | None = None) -> Outcome:
    """Bring the transitions of one dataset, or of all, up to date.

    Raises:
        UserError: no such dataset.
    """
    lake, config = session.lake, session.config
    with reading(lake) as con:
        known = transitions.parts_of(con)
        if dataset is not None and dataset not in known:
            raise UserError(f"{dataset}: no such dataset in {lake.root}; it holds {', '.join(known) or 'none'}")
        network = embed.fitting_network(con, config)
        if network is None or motifs.fitting_motifs(con, config, network) is None:
            session.notice("transitions: there are no motifs yet; `motionlake run all` makes every stage")
            return Outcome()
        shards = transitions.plan(con, config, dataset)
    outcome = session.execute(PAIRS, shards)
    with reading(lake) as con:
        shards = transitions.plan_contexts(con, lake, config, dataset)
    if shards:
        made = session.execute(CONTEXTS, shards)
        outcome.ok += made.ok
        outcome.failed += made.failed
        outcome.reason = made.reason or outcome.reason
    return outcome
