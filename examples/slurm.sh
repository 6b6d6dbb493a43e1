#!/bin/bash
# A study on a SLURM cluster, each task a part of it:
#
#     sbatch examples/slurm.sh my-lab.toml
#
# and when all have finished, on one machine:
#
#     simharness merge parts/* --into results/studies/store
#     simharness study my-lab.toml
#
# A task that was killed or preempted goes on where it stopped; kernels are compiled once for all machines of a kind.
#SBATCH --job-name=study
#SBATCH --array=1-8
#SBATCH --cpus-per-task=4
#SBATCH --mem-per-cpu=2G
#SBATCH --requeue
set -euo pipefail
export NUMBA_CACHE_DIR=${NUMBA_CACHE_DIR-$PWD/kernels}
exec simharness study "$1" --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" \
    --store "parts/$SLURM_ARRAY_TASK_ID" --workers "$SLURM_CPUS_PER_TASK"
