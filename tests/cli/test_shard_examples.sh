#!/usr/bin/env bash
# Runs the examples of examples/shards as a scheduler would, and compares with one call: test_shard_examples.sh slurm|ray
# STICTION SOURCE [PYTHON]
set -euo pipefail
what=$1 stiction=$2 source=$3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$stiction" generate wall --envs 7 --size 2 --quiet -o "$folder/batch.h5"
"$stiction" solve "$folder/batch.h5" --quiet --max-iterations 2000 --tolerance 1e-6 -o "$folder/whole.h5" || [ $? -eq 1 ]

case $what in
  slurm)
    # An array of three tasks, in no order; its second task is then lost and solved again by itself.
    for task in 2 0 1; do
      SLURM_ARRAY_TASK_ID=$task SLURM_ARRAY_TASK_COUNT=3 SLURM_CPUS_PER_TASK=1 STICTION=$stiction \
        bash "$source/examples/shards/slurm_array.sh" "$folder/batch.h5" "$folder/parts" --max-iterations 2000 --tolerance 1e-6 --quiet
    done
    rm "$folder/parts/part-1.h5"
    if "$stiction" merge "$folder/solution.h5" "$folder"/parts/part-*.h5 2> "$folder/err"; then
      echo "a missing part was not noticed"
      exit 1
    fi
    cat "$folder/err"
    PARTS=3 SLURM_ARRAY_TASK_ID=1 SLURM_ARRAY_TASK_COUNT=1 STICTION=$stiction \
      bash "$source/examples/shards/slurm_array.sh" "$folder/batch.h5" "$folder/parts" --max-iterations 2000 --tolerance 1e-6 --quiet
    "$stiction" merge "$folder/solution.h5" "$folder"/parts/part-*.h5
    ;;
  ray)
    "${4:?}" "$source/examples/shards/ray_shards.py" "$folder/batch.h5" "$folder/solution.h5" --parts 3 --stiction "$stiction" \
      -- --max-iterations 2000 --tolerance 1e-6
    ;;
esac
cmp "$folder/whole.h5" "$folder/solution.h5"
"$stiction" hash "$folder/solution.h5"
