#!/usr/bin/env bash
#SBATCH --array=0-7
#SBATCH --cpus-per-task=8
# Solves one part of a batch in each task of a Slurm array that begins at 0.
#
#   id=$(sbatch --parsable slurm_array.sh BATCH FOLDER [options of stiction solve])
#   sbatch --dependency=afterok:"$id" --wrap "stiction merge FOLDER/solution.h5 FOLDER/part-*.h5"
#
# FOLDER is one that all nodes see. A task that failed is solved again as the part that it was, of as many:
#
#   PARTS=8 sbatch --array=3 slurm_array.sh BATCH FOLDER [the same options]
set -euo pipefail

batch=$1
folder=$2
shift 2
part=$SLURM_ARRAY_TASK_ID
parts=${PARTS:-$SLURM_ARRAY_TASK_COUNT}
mkdir -p "$folder"

# Exit status 1 says that some environment did not end as `solved`. The part is there, and its status says which.
"${STICTION:-stiction}" solve "$batch" --shard "$part/$parts" --threads "${SLURM_CPUS_PER_TASK:-0}" \
  -o "$folder/part-$part.h5" "$@" || [ $? -eq 1 ]
