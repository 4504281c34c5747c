#!/usr/bin/env bash
#SBATCH --job-name=motionlake
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=1
#SBATCH --cpus-per-task=16
#SBATCH --mem=24G
#SBATCH --time=08:00:00
#SBATCH --signal=B:TERM@300
#
# Every stage of a lake on the nodes of a Slurm job:
#
#   sbatch --export=ALL,LAKE=/shared/mylake slurm.sh
#
# Every node sees the lake, its source folders and this environment under the same paths. STAGE names one stage (all).
# Five minutes before its time is over Slurm sends TERM: what is at work is brought to an end and kept, and the same
# command goes on there.
set -euo pipefail
: "${LAKE:?say which lake: sbatch --export=ALL,LAKE=/shared/mylake slurm.sh}"
cores=${SLURM_CPUS_PER_TASK:-1}
folder=$(mktemp -d "${SLURM_SUBMIT_DIR:-$PWD}/motionlake-XXXXXX")
address=$folder/scheduler.json

stop() {
    kill $(jobs -p) 2>/dev/null || true
    for _ in $(seq 50); do
        [ -z "$(jobs -pr)" ] && break
        sleep 0.2
    done
    kill -9 $(jobs -pr) 2>/dev/null || true # a worker that just begins hears nothing
    rm -rf "$folder"
}
trap stop EXIT

dask scheduler --scheduler-file "$address" --no-dashboard &
scheduler=$!
srun dask worker --scheduler-file "$address" --nworkers "$cores" --nthreads 1 \
    --local-directory "${TMPDIR:-/tmp}" --death-timeout 60 --no-dashboard &

until [ -s "$address" ]; do
    kill -0 "$scheduler" # it has ended, and says why above
    sleep 0.2
done

motionlake run "${STAGE:-all}" --scheduler-file "$address" --lake "$LAKE" &
work=$!
trap 'kill -TERM "$work"' TERM
status=0
wait "$work" || status=$?
# A signal ends the first wait, not the command.
while kill -0 "$work" 2>/dev/null; do
    wait "$work" || status=$?
done
exit "$status"
