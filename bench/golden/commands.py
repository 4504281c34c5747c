"""What is run and compared, as data: commands, what is renamed, what is left out.

Templates are split as a shell splits them; `{lake}`, `{own}`, `{src}`, `{out}` and the clips of `bench.golden.lakes`
are put in. `--lake {lake}` is added where a template names no lake of its own.
"""

from __future__ import annotations

from typing import Final

# Old name → new name. A name without a slash is renamed wherever it stands as a part of an entry's name (a table, a
# column, a key of JSON); one with slashes is the beginning of an entry's name.
RENAMED: Final[dict[str, str]] = {
    # Every answer has a distance, by which answers are ranked; that of an alignment is its cost for each symbol.
    "normalised_cost": "distance",
}

# Columns that tell time.
CLOCK_COLUMNS: Final = {
    "files": ("mtime_ns",),
    "manifest": ("seconds", "finished"),
    "models": ("seconds", "created"),
    "runs": ("started", "finished"),
    "sources": ("mtime_ns",),
}
# Keys of JSON that tell time, wherever they stand, and those that do where another key stands beside them.
CLOCK_KEYS: Final = ("wall_seconds", "retrieval_ms", "share_of_time")
CLOCKS_BESIDE: Final = {"created": ("created", "seconds"), "all_n": ("seconds",)}
# Left out of the comparison altogether: the lock, config.toml, and notices on stderr, of which some come by the clock.

# The lake of pretrained models, with every table.
BUILD: Final = {
    "init": "init {lake} --json",
    "ingest": "ingest {src}/hdm05 {src}/cmu_dance {src}/utd_mhad {src}/bandai1 {src}/cmu_bvh {src}/mixed --json",
    "ingest again": "ingest {src}/hdm05 --licence CC-BY-SA-3.0 --json",
    "status before": "status --json",
    "run all": "run all --json",
    "run again": "run all --json",
    "run neighbours": "run neighbours --json",
    "run transitions": "run transitions --json",
    "run synth": "run synth --json",
    "synthesize": (
        "synthesize --class walk --class salsa --seconds 3 --count 2 --seed 3 --from {salsa} --bvh {out}/made --json"
    ),
    "synthesize in its own time": (
        "synthesize --class walk --seconds 2 --pace 1.5 --temperature 0.5 --dataset slow --json"
    ),
    "run all for made clips": "run all --json",
}
# Stages of their own are due again once clips are made; the lake of the reading commands has them up to date.
UP_TO_DATE: Final = {"run neighbours again": "run neighbours --json", "run transitions again": "run transitions --json"}
REMOVE: Final = {
    "remove": "remove {hop} --json",
    "remove dataset": "remove --dataset slow --json",
    "status after": "status --json",
}

# A second lake, whose models are trained on its clips in seconds, by both recipes.
OWN_BUILD: Final = {
    "init": "init {own} --json",
    "ingest": "ingest {src}/hdm05 {src}/utd_mhad {src}/bandai1 --json --lake {own}",
    "run words": "run words --json --lake {own}",
    "train words": "train words --json --lake {own}",
    "train postures": "train postures --json --lake {own}",
    "train descriptor": "train descriptor --split train --json --lake {own}",
    "train submotion": "train submotion --split train --json --lake {own}",
    "train synthesis": "train synthesis --split train --json --lake {own}",
    "run all": "run all --json --lake {own}",
    "run synth": "run synth --json --lake {own}",
    "synthesize": "synthesize --class swipe_left --seconds 2 --seed 5 --json --lake {own}",
    "classes": "synthesize --classes --json --lake {own}",
    "search": "search {kick} -k 5 --method fused --json --lake {own}",
    "evaluate synthesis": "evaluate synthesis --dataset utd_mhad --count 1 --seconds 1 --json --lake {own}",
    "fine-tune words": "train words --fine-tune --json --lake {own}",
}
OTHER_BUILD: Final = {
    "other train words": "train words --json --lake {own}",
    "other train postures": "train postures --json --lake {own}",
    "other train descriptor": "train descriptor --json --lake {own}",
    "other train submotion": "train submotion --dataset utd_mhad --json --lake {own}",
    "other train synthesis": "train synthesis --dataset utd_mhad --json --lake {own}",
    "other run all": "run all --json --lake {own}",
    "other align": "align {kick} --whole -k 5 --json --lake {own}",
}

# What is asked of the first lake.
ASK: Final = {
    "status": "status --json",
    "status as text": "status",
    "search": "search {hop} {salsa} -k 5 --json",
    "search mirrored": "search {kick} -k 5 --mirrored --json",
    "search real": "search {salsa} -k 5 --recorded-only --json",
    "search in": "search {kinect} -k 5 --dataset bandai1 --json",
    "search sample": "search --sample 3 -k 2 --json",
    "search as text": "search {hop} -k 3",
    "search by name": "search 08_01 -k 3 --json",
    "search alignment": "search {kick} -k 5 --method alignment --json",
    "search descriptor": "search {kick} -k 5 --method descriptor --json",
    "search fused": "search {kick} -k 5 --method fused --json",
    "search file": "search {src}/{walk} -k 5 --json",
    "search file mirrored": "search {src}/{kinect} -k 5 --mirrored --json",
    "search file alignment": "search {src}/{walk} -k 5 --method alignment --json",
    "search file descriptor": "search {src}/{walk} -k 5 --method descriptor --json",
    "search file fused": "search {src}/{kick} -k 5 --method fused --recorded-only --dataset hdm05 --json",
    "find": "find {salsa} --from 240 --to 480 -k 5 --json",
    "find mirrored": "find {kick} -k 5 --mirrored --json",
    "find own": "find {salsa} --from 240 --to 480 -k 3 --own --json",
    "find real": "find {salsa} --from 240 --to 480 -k 3 --recorded-only --dataset cmu_dance --json",
    "find file": "find {src}/{walk} --from 0 --to 200 -k 5 --json",
    "find submotion": "find {salsa} --from 240 --to 480 -k 5 --method submotion --json",
    "find submotion own": "find {salsa} --from 240 --to 480 -k 3 --method submotion --own --recorded-only --json",
    "find submotion file": "find {src}/{walk} --from 0 --to 200 -k 5 --method submotion --dataset cmu_bvh --json",
    "align": "align {salsa} --from 240 --to 480 -k 5 --json",
    "align path": "align {walk} --from 0 --to 120 -k 2 --path --json",
    "align whole": "align {kick} --whole -k 5 --json",
    "align stride": "align {kick} --stride 3 -k 5 --json",
    "align dtw": "align {salsa} --from 240 --to 480 -k 5 --method dtw --json",
    "align sw": "align {salsa} --from 240 --to 480 -k 5 --method sw --json",
    "align crossing": "align {kick} -k 5 --boundaries crossed --recorded-only --json",
    "align whole dtw": "align {kick} --whole -k 5 --method dtw --recorded-only --json",
    "align whole sw": "align {kick} --whole -k 5 --method sw --dataset hdm05 --json",
    "align file": "align {src}/{walk} --from 0 --to 200 -k 5 --json",
    "duplicates": "duplicates --json",
    "duplicates mirrored": "duplicates --mirrored --max-distance 0.3 --recorded-only --json",
    "duplicates across": "duplicates --across --json",
    "duplicates within": "duplicates --dataset utd_mhad --max-distance 0.5 --json",
    "cluster": "cluster --json",
    "cluster in": "cluster --k 3 --dataset utd_mhad --json",
    "cluster real": "cluster --k 5 --recorded-only --json",
    "segment": "segment {walk} --json",
    "segment by signatures": "segment {walk} --method signatures --window 5 --reach 3 --json",
    "segment taught": "segment {salsa} --dataset bandai1 --dataset hdm05 --no-unknown --json",
    "segment by clips": (
        "segment {stride} --labelled-clip {walk} --labelled-clip {run} --no-mirrored --method signatures --window 5 "
        "-k 3 --json"
    ),
    "segment file": "segment {src}/{run} --dataset cmu_bvh --json",
    "classify": "classify {kick} {kinect} --json",
    "classify one-vs-all": "classify {kick} --method one-vs-all --dataset hdm05 --json",
    "classify unlabelled": "classify --unlabelled --write-labels {out}/found.csv --json",
    "classify file": "classify {src}/{kick} -k 3 --label-column subject --json",
    "compose": (
        "compose --sample --dataset cmu_dance --seconds 10 --seed 1 --no-constraint --distance-quantile 1 "
        "-o {out}/new.bvh --lineage {out}/new.csv --json"
    ),
    "compose constrained": (
        "compose {salsa} --seconds 5 --seed 2 --context-quantile 1 --distance-quantile 1 -o {out}/constrained.bvh "
        "--json"
    ),
    "evaluate signatures": "evaluate signatures --dataset hdm05 --json",
    "evaluate signatures of all": "evaluate signatures --baseline none --json",
    "evaluate signatures by subject": (
        "evaluate signatures --label-column subject --only label=salsa --baseline dtw --json"
    ),
    "evaluate pesta": "evaluate pesta --dataset hdm05 --stride 3 --json",
    "evaluate pesta with segments": "evaluate pesta --dataset cmu_bvh --baseline none --json",
    "evaluate descriptor": "evaluate descriptor --dataset utd_mhad --json",
    "evaluate descriptor by split": "evaluate descriptor --dataset hdm05 --split test --train-split train --json",
    "evaluate segmentation": "evaluate segmentation --dataset cmu_bvh --json",
    "evaluate segmentation by signatures": (
        "evaluate segmentation --dataset cmu_bvh --method signatures --window 5 --reach 3 --json"
    ),
    "rigs": "rig --json",
    "rig": "rig {src}/{dash} --json",
    "rig starter": "rig {src}/{walk} --starter",
    "classes": "synthesize --classes --json",
    "export": "export {kick} -o {out}/own.bvh --json",
    "export canonical": "export {kinect} --rig canonical --from 5 --to 25 -o {out}/canonical.bvh --json",
    "export made": "export synthetic/walk+salsa-s3-0001 -o {out}/made.bvh --json",
    "view": "view {kick} --out {out}/view.html --json",
    "view beside": "view {walk} --beside {src}/{run} --from 0 --to 100 --out {out}/beside.png --json",
    "view moving": "view {kinect} --beside none --out {out}/moving.gif --json",
    "report": "report --out {out}/report.html --json",
    "pictured search": "search {kick} -k 2 --picture {out}/hits.html --json",
    "pictured align": "align {kick} --whole -k 2 --picture {out}/aligned.html --json",
    "no such clip": "search nothing_of_that_name --json",
    "no such method": "search {hop} --method nothing --json",
    "no such dataset": "search {hop} --dataset nothing --json",
    "too short": "find {hop} --from 0 --to 3 --json",
    "no such column": "evaluate signatures --label-column nothing --json",
    "no stage": "run nothing",
}
# Every macro and function of docs/architecture.md, asked of the first lake by `motionlake sql`.
_LIKE: Final = "(SELECT signature FROM signatures WHERE clip = '{kick}')"
_MIRRORED: Final = "(SELECT signature FROM mirrored_signatures WHERE clip = '{kick}')"
_DESCRIPTOR: Final = "(SELECT descriptor FROM descriptors WHERE clip = '{kick}')"
_PIECE: Final = "(SELECT descriptor FROM submotions WHERE clip = '{salsa}' ORDER BY start, stop LIMIT 1)"
_SYMBOLS: Final = "(SELECT symbols[2:9] FROM symbol_strings WHERE clip = '{salsa}')"
_OTHER: Final = "(SELECT signature FROM signatures WHERE clip = '{hop}')"
SQL: Final = {
    "similar_clips": "FROM similar_clips('{kick}', 5)",
    "similar_clips real": "FROM similar_clips('{kick}', k := 5, dataset := 'hdm05', recorded_only := true)",
    "clips_like": f"FROM clips_like({_LIKE}, 5, without := '{{kick}}')",
    "clips_like old model": f"FROM clips_like({_LIKE}, 5, model := 'motifs-9')",
    "similar_or_mirrored_clips": "FROM similar_clips('{kick}', k := 5, mirrored := true, recorded_only := true)",
    "clips_like_either": f"FROM clips_like({_LIKE}, 5, {_MIRRORED}, dataset := 'hdm05')",
    "synthesize": "FROM synthesize(['walk', 'salsa'], seconds := 1, seed := 3, start := '{salsa}')",
    "find_motion": "FROM find_motion('{salsa}', 240, 480, k := 5, mirrored := true)",
    "near_duplicates": "FROM near_duplicates(max_distance := 0.2, across := true, mirrored := true)",
    "segment_clip": "FROM segment_clip('{salsa}', teach := ['bandai1', 'hdm05'], mirrored := false)",
    "classify_clip": "FROM classify_clip('{kick}', k := 3, dataset := 'hdm05')",
    "clip_clusters": "FROM clip_clusters(k := 4)",
    "clip_clusters of a dataset": "FROM clip_clusters(dataset := 'utd_mhad')",
    "align_motion": "FROM align_motion('{salsa}', 240, 480, k := 5, stride := 3, recorded_only := true)",
    "align_motion sw": "FROM align_motion('{kick}', NULL, NULL, k := 5, method := 'sw')",
    "align_symbols": f"FROM align_symbols({_SYMBOLS}, k := 5)",
    "align_symbols old model": f"FROM align_symbols({_SYMBOLS}, k := 5, model := 'postures-9')",
    "align_windows": "FROM align_windows('{kick}', 6, k := 2)",
    "aligned_clips": "FROM aligned_clips('{kick}', k := 5, dataset := 'hdm05')",
    "find_motion too short": "FROM find_motion('{salsa}', 0, 3)",
    "similar_clips of none": "FROM similar_clips('nothing_of_that_name')",
    "emd": f"SELECT emd({_LIKE}, {_OTHER}) AS emd, emd_deep_motifs({_LIKE}, {_OTHER}) AS emd_deep_motifs",
    "find_submotion": "FROM find_submotion('{salsa}', 240, 480, k := 5, own := true)",
    "nearest_clips": "FROM nearest_clips('{kick}', k := 5, recorded_only := true)",
    "clips_near": f"FROM clips_near({_DESCRIPTOR}, k := 5, dataset := 'hdm05')",
    "clips_holding": f"FROM clips_holding({_PIECE}, k := 5, without := '{{salsa}}', first := 0, last := 60)",
    "similar_words": "FROM similar_words('{walk}', 2, 5)",
    "clip_symbols": "FROM clip_symbols('{kick}')",
    "transitions_from": "FROM transitions_from('{salsa}') LIMIT 10",
    "overlapping_motifs": "FROM overlapping_motifs('{kick}', 5)",
    "find_clip": "FROM find_clip('05')",
    "clip_segments": "FROM clip_segments('{walk}')",
    "frames": "SELECT clip, max(root_y) - min(root_y) AS rise FROM frames GROUP BY clip ORDER BY ALL LIMIT 5",
    "functions": (
        "SELECT function_name, function_type, parameters FROM duckdb_functions() WHERE NOT internal "
        "AND function_name NOT LIKE 'pg_%' ORDER BY ALL"
    ),
    "wrong": "SELECT nothing FROM clips",
}

# The small form: a lake of made clips and pretrained models.
SMALL_BUILD: Final = {
    "init": "init {lake} --json",
    "ingest": "ingest {src}/clips --json",
    "run all": "run all --json",
    "run synth": "run synth --json",
    "synthesize": "synthesize --class walk --seconds 1 --seed 3 --from {kinect} --json",
}
SMALL_ASK: Final = {
    "status": "status --json",
    "search": "search {kinect} -k 3 --json",
    "search mirrored": "search {ntu} -k 3 --mirrored --json",
    "search alignment": "search {kinect} -k 3 --method alignment --json",
    "search descriptor": "search {kinect} -k 3 --method descriptor --json",
    "search fused": "search {mimic} -k 3 --method fused --json",
    "search file": "search {src}/{ntu} -k 3 --json",
    "find": "find {kinect} --from 0 --to 40 -k 3 --json",
    "find submotion": "find {kinect} --from 0 --to 40 -k 3 --method submotion --json",
    "align": "align {kinect} --from 0 --to 40 -k 3 --path --json",
    "align whole": "align {mimic} --whole -k 3 --method dtw --json",
    "duplicates": "duplicates --mirrored --json",
    "cluster": "cluster --k 3 --json",
    "classify": "classify {kinect} --json",
    "evaluate signatures": "evaluate signatures --baseline none --json",
    "rig": "rig {src}/{kinect} --json",
    "export": "export {kinect} --from 3 --to 9 -o {out}/clip.bvh --json",
    "no such clip": "search nothing_of_that_name --json",
    "sql similar_clips": "sql \"FROM similar_clips('{kinect}', 3)\" --json",
    "sql nearest_clips": "sql \"FROM nearest_clips('{kinect}', k := 3)\" --json",
    "sql find_motion": "sql \"FROM find_motion('{kinect}', 0, 40, k := 3)\" --json",
    "sql align_motion": "sql \"FROM align_motion('{kinect}', 0, 40, k := 3)\" --json",
    "sql clip_symbols": "sql \"FROM clip_symbols('{mimic}')\" --json",
}
SMALL_REMOVE: Final = {"remove": "remove {ntu} --json", "status after": "status --json"}
