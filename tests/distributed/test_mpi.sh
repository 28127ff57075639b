#!/usr/bin/env bash
# stiction-mpi under mpirun, more ranks than cores: test_mpi.sh bits|column|consensus|asynchronous|newton|step|restart|restart_one|together|json|killed|hung|refused|refusing STICTION STICTION_MPI MPIEXEC [COMPARE_CHECKPOINTS]
# Bits and endings are compared, never times.
set -uo pipefail
what=$1 stiction=$2 program=$3 mpiexec=$4 compare=${5:-}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
# As root, more ranks than cores, in a container: Open MPI 4 and 5 want to be told. Other MPIs read none of it.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
export PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe OMPI_MCA_btl_vader_single_copy_mechanism=none
export OMPI_MCA_orte_execute_quiet=1

fail() {
  echo "FAILED: $*"
  exit 1
}

ranks() {  # ranks N ARGUMENTS...
  local count=$1
  shift
  timeout 200 "$mpiexec" -n "$count" "$program" "$@"
}

# One process, then 1 to 4 ranks by bisection and 3 at random: the same file of lambda, iterations and residuals.
compare() {  # compare METHOD SCENE SIZE OPTIONS...
  local method=$1 scene=$2 size=$3 ranks partition
  shift 3
  "$stiction" generate "$scene" --size "$size" --seed 3 --quiet -o "$folder/batch.h5" || fail "generate $scene"
  "$stiction" solve "$folder/batch.h5" --form bodies --solver "$method" "$@" --json "$folder/one.json" --quiet -o "$folder/one.h5"
  [ $? -le 1 ] || fail "solve $scene"
  for ranks in 1 2 3 4; do
    for partition in bisection random:7; do
      [ "$partition" = bisection ] || [ "$ranks" -eq 3 ] || continue
      ranks "$ranks" solve --scene "$scene" --size "$size" --seed 3 --method "$method" --partition "$partition" "$@" \
        --quiet --json "$folder/ranks.json" -o "$folder/ranks.h5" 2> "$folder/err"
      [ $? -le 1 ] || fail "$scene, $ranks ranks: $(cat "$folder/err")"
      "$stiction" diff "$folder/one.h5" "$folder/ranks.h5" || fail "$scene, $ranks ranks, $partition"
      python3 - "$folder/one.json" "$folder/ranks.json" << 'EOF' || fail "$scene, $ranks ranks, $partition: reports"
import json, sys
one, many = (json.load(open(name)) for name in sys.argv[1:])
for key in ("hash", "iterations", "residual", "unconverged", "law", "precision", "epoch", "solver"):
    if one[key] != many[key]:
        sys.exit(f"{key}: {one[key]} by one process, {many[key]} by ranks")
if many["reproducible"] is not True:
    sys.exit("ranks do not say that their bits are the same each time")
EOF
      rm "$folder/ranks.h5" "$folder/ranks.json"
    done
  done
  echo "$method, $scene: 5 jobs have the bits of one process, $("$stiction" hash "$folder/one.h5")"
}

# Consensus by 1 to 4 ranks: one answer, and another one with another number of subdomains.
compare_consensus() {  # compare_consensus SCENE SIZE OPTIONS...
  local scene=$1 size=$2 ranks
  shift 2
  for ranks in 1 2 3 4; do
    ranks "$ranks" solve --scene "$scene" --size "$size" --seed 3 --method consensus --subdomains 3 "$@" --quiet \
      --json "$folder/ranks$ranks.json" -o "$folder/ranks$ranks.h5" 2> "$folder/err"
    [ $? -le 1 ] || fail "$scene, $ranks ranks: $(cat "$folder/err")"
    "$stiction" diff "$folder/ranks1.h5" "$folder/ranks$ranks.h5" || fail "$scene, $ranks ranks"
  done
  ranks 2 solve --scene "$scene" --size "$size" --seed 3 --method consensus --subdomains 2 "$@" --quiet \
    --json "$folder/two.json" 2> "$folder/err"
  python3 - "$folder"/{ranks1,ranks4,two}.json << 'EOF' || fail "$scene: reports"
import json, sys
one, four, two = (json.load(open(name)) for name in sys.argv[1:])
assert one["hash"] == four["hash"] != two["hash"], (one["hash"], four["hash"], two["hash"])
assert one["method"] == "consensus" and one["subdomains"] == 3 and one["sweeps_per_round"] == 16, one
assert one["unconverged"] == 0 and one["bytes"] == 0 < four["bytes"], (one, four)
assert 16 * four["exchanges"] < 2 * four["iterations"]["max"], four
assert sum(rank["bodies"] for rank in four["per_rank"]) == four["bodies"], four
EOF
  rm "$folder"/ranks?.json "$folder"/ranks?.h5
  echo "consensus, $scene: 4 jobs have one answer"
}

# Newton's method over 4 subdomains by 1 to 4 ranks, 3 of them dealt out at random: one answer.
compare_newton() {  # compare_newton SCENE SIZE OPTIONS...
  local scene=$1 size=$2 ranks partition
  shift 2
  for ranks in 1 2 3 4; do
    partition=$([ "$ranks" -eq 3 ] && echo random:7 || echo bisection)
    ranks "$ranks" solve --scene "$scene" --size "$size" --seed 3 --method newton --subdomains 4 "$@" --quiet \
      --partition "$partition" --json "$folder/ranks$ranks.json" -o "$folder/ranks$ranks.h5" 2> "$folder/err" ||
      fail "$scene, $ranks ranks: $(cat "$folder/err")"
    "$stiction" diff "$folder/ranks1.h5" "$folder/ranks$ranks.h5" || fail "$scene, $ranks ranks"
  done
  python3 - "$folder"/ranks{1,4}.json << 'EOF' || fail "$scene: reports"
import json, sys
one, four = (json.load(open(name)) for name in sys.argv[1:])
for key in ("hash", "iterations", "residual", "sweeps", "linear_iterations"):
    assert one[key] == four[key], (key, one[key], four[key])
assert one["method"] == one["solver"] == "newton" and one["subdomains"] == 4, one
assert one["unconverged"] == 0 and one["bytes"] == 0 < four["bytes"], (one, four)
assert four["exchanges"] >= four["linear_iterations"] > four["iterations"]["max"] > 0, four
assert sum(rank["bodies"] for rank in four["per_rank"]) == four["bodies"], four
EOF
  rm "$folder"/ranks?.json "$folder"/ranks?.h5
  echo "newton, $scene: 4 jobs have one answer"
}

# shellcheck source=tests/distributed/column_over_ranks.sh
source "$(dirname "$0")/column_over_ranks.sh"

# compare_reports ONE MANY: what a run of `stiction step` and a job have in common.
compare_reports() {
  python3 - "$1" "$2" << 'EOF'
import json, sys
one, many = (json.load(open(name)) for name in sys.argv[1:])
for key in ("hash", "contacts", "residual", "quality", "ended", "deepest", "steps", "bodies", "epoch"):
    if one[key] != many[key]:
        sys.exit(f"{key}: {one[key]} by one process, {many[key]} by ranks")
# Each rank adds up its own bodies. A sum of n terms of one sign is wrong by n 2^-53 of itself; a term is rounded, too.
for key in ("begin", "end"):
    a, b = (run["energy"][key] for run in (one, many))
    if abs(a - b) > 4 * one["bodies"] * 2**-53 * abs(a):
        sys.exit(f"energy, {key}: {a} by one process, {b} by ranks")
EOF
}

# A world's steps by one process, then by 1 to 4 ranks.
compare_steps() {  # compare_steps SCENE OPTIONS...
  local scene=$1 ranks partition
  shift
  "$stiction" step "$scene" "$@" --json "$folder/one.json" -o "$folder/one.csv" --every 10 --quiet || fail "step $scene"
  for ranks in 1 2 3 4; do
    for partition in bisection random:7; do
      [ "$partition" = bisection ] || [ "$ranks" -eq 3 ] || continue
      ranks "$ranks" step "$scene" "$@" --partition "$partition" --json "$folder/ranks.json" -o "$folder/ranks.csv" \
        --every 10 --quiet 2> "$folder/err" || fail "step $scene, $ranks ranks: $(cat "$folder/err")"
      cmp "$folder/one.csv" "$folder/ranks.csv" || fail "step $scene, $ranks ranks, $partition: states"
      compare_reports "$folder/one.json" "$folder/ranks.json" || fail "step $scene, $ranks ranks, $partition"
    done
  done
  echo "step $scene: 5 jobs have the bits of one process"
}

# Jobs of 1 to 4 ranks that are killed at random moments, and go on from their checkpoint with another number of ranks.
restart() {  # restart KILLS STEPS one|parts
  local kills=$1 steps=$2 files=$3 kill ranks arguments=(step pile --envs 1 --seed 5 --steps "$2")
  RANDOM=${STICTION_SEED:-11}
  "$stiction" "${arguments[@]}" --json "$folder/one.json" --quiet || fail "one process"
  for kill in $(seq "$kills"); do
    ranks=$((RANDOM % 4 + 1))
    timeout 200 "$mpiexec" -n "$ranks" "$program" "${arguments[@]}" --checkpoint "$folder/point.h5" \
      --checkpoint-files "$files" --checkpoint-every 1 --quiet > "$folder/out" 2> "$folder/err" &
    job=$!
    sleep "$((RANDOM % 2)).$((RANDOM % 10))$((RANDOM % 10))"
    # A slow machine may not have come to a checkpoint: the last job gets the time for one.
    for _ in $(seq $((kill == kills ? 600 : 0))); do [ -e "$folder/point.h5" ] && break || sleep 0.1; done
    pkill -KILL -P "$(pgrep -P "$job" | head -1 || echo "$job")" 2> /dev/null
    pkill -KILL -P "$job" 2> /dev/null
    kill -KILL "$job" 2> /dev/null
    wait "$job" 2> /dev/null
    pkill -KILL -f -- "--checkpoint $folder/point.h5" 2> /dev/null
    grep -q '^stiction-mpi: ' "$folder/err" && fail "after kill $kill: $(cat "$folder/err")"
  done
  [ -e "$folder/point.h5" ] || fail "no job wrote a checkpoint: nothing was tested"
  mkdir "$folder/copy"
  cp "$folder"/point.h5* "$folder/copy"
  ranks 3 "${arguments[@]}" --checkpoint "$folder/point.h5" --checkpoint-files "$files" --json "$folder/ranks.json" --quiet 2> "$folder/err" ||
    fail "the last job: $(cat "$folder/err")"
  grep -q '"resumed_at": 0,' "$folder/ranks.json" && fail "the last job began anew"
  if [ "$files" = one ]; then
    [ -z "$(find "$folder" -maxdepth 1 -name 'point.h5.step*')" ] || fail "parts beside one file: $(echo "$folder"/point.h5.*)"
  else
    # One checkpoint alone, that of the last step: by 3 ranks, or by those of a job that ended before it was killed.
    ranks=$(sed -n 's/.*"resumed_at": \([0-9]*\),.*/\1/p' "$folder/ranks.json")
    [ "$ranks" = "$steps" ] && ranks=? || ranks=3
    kinds=$(cd "$folder" && printf '%s\n' point.h5.step*.part[0-9]of[0-9] | sed 's/part[0-9]of/partof/' | sort -u)
    # shellcheck disable=SC2053  # a pattern
    [[ "$kinds" == point.h5.step$steps.partof$ranks ]] || fail "parts of checkpoints that are no more: $(echo "$folder"/point.h5.*)"
  fi
  "$stiction" step "${arguments[@]:1}" --checkpoint "$folder/copy/point.h5" --json "$folder/last.json" --quiet || fail "one process goes on"
  python3 - "$kills" "$folder"/{one,ranks,last}.json << 'EOF' || fail "other bits than without a stop"
import json, sys
runs = [json.load(open(name)) for name in sys.argv[2:]]
print(f"killed {sys.argv[1]} times, gone on at step {runs[1]['resumed_at']} of {runs[1]['steps']}: {runs[1]['hash']}")
sys.exit(len({run["hash"] for run in runs}) != 1)
EOF
  "$stiction" step pile --envs 3 --seed 5 --steps "$steps" --checkpoint "$folder/point.h5" --quiet 2> "$folder/err"
  [ $? -eq 2 ] || fail "a checkpoint of another run was taken"
  grep -q 'is of another run' "$folder/err" || fail "no sentence about another run: $(cat "$folder/err")"
  another_run pile 3 "$steps" '--envs is 1 in the file and 3 here'
  another_run stack 1 "$steps" 'SCENE is pile in the file and stack here'
}

# shellcheck source=tests/distributed/mpi_checkpoints.sh
. "$(dirname "$0")/mpi_checkpoints.sh"

# By ranks, from the parts and from one file.
another_run() {  # another_run SCENE ENVS STEPS SENTENCE
  local file status
  rm -f "$folder/whole.h5"
  "$stiction" step pile --envs 1 --seed 5 --steps "$3" --iterations 1 --checkpoint "$folder/whole.h5" --quiet || fail "one process"
  for file in point.h5 whole.h5; do
    ranks 2 step "$1" --envs "$2" --seed 5 --steps "$3" --checkpoint "$folder/$file" --quiet > "$folder/out" 2> "$folder/err"
    status=$?
    [ "$status" -eq 2 ] || fail "$file of another run: exit status $status, expected 2"
    [ "$(grep -c '^stiction-mpi: ' "$folder/err")" -eq 1 ] || fail "not one sentence: $(cat "$folder/err")"
    grep -q -- "$file: is of another run: .*$4" "$folder/err" || fail "$file: $(cat "$folder/err")"
  done
}

# A job that does not end by itself; sets `job`, and `victim`, the process of one of its ranks.
start_endless() {  # start_endless RANKS OPTIONS...
  local count=$1 child
  shift
  "$mpiexec" -n "$count" "$program" solve --scene wall --size 8 --tolerance 0 --max-iterations 500000000 "$@" \
    > "$folder/out" 2> "$folder/err" &
  job=$!
  for _ in $(seq 300); do
    sleep 0.2
    victims=()
    for child in $(cat "/proc/$job/task/$job/children" 2> /dev/null); do
      [ "$(readlink "/proc/$child/exe")" = "$(readlink -f "$program")" ] && victims+=("$child")
    done
    [ ${#victims[@]} -eq "$count" ] && break
  done
  [ ${#victims[@]} -eq "$count" ] || fail "no $count ranks among the children of $mpiexec: $(cat "$folder/err")"
  sleep 3  # into the iteration
  victim=${victims[1]}
}

# The job has ended, its ranks with it. A watchdog ends one that has not, which then fails.
finish() {
  (sleep 100; kill -KILL "${victims[@]}" "$job") 2> /dev/null &
  local watchdog=$! rank
  wait "$job"
  status=$?
  pkill -P "$watchdog" 2> /dev/null
  kill "$watchdog" 2> /dev/null
  cat "$folder/err"
  [ "$status" -ne 0 ] || fail "the job ended as if nothing had happened"
  [ "$status" -ne 137 ] || [ "$what" = killed ] || fail "the job did not end by itself"
  for rank in "${victims[@]}"; do
    for _ in $(seq 50); do
      [ -e "/proc/$rank" ] || continue 2
      sleep 0.1
    done
    fail "rank with process $rank is still there"
  done
}

asynchronous=(--law convex --method consensus --subdomains 3 --asynchronous)
case $what in
  bits)
    compare si wall 5 --max-iterations 200
    cp "$folder/one.h5" "$folder/si.h5"
    compare npgs wall 5 --max-iterations 200
    "$stiction" diff "$folder/si.h5" "$folder/one.h5" || fail "si is not npgs"
    compare pgs wall 5 --max-iterations 200
    "$stiction" diff "$folder/si.h5" "$folder/one.h5" > "$folder/out" && fail "pgs has the bits of npgs"
    compare npgs wall 3 --max-iterations 5000 --tolerance 1e-6
    cp "$folder/one.h5" "$folder/start.h5"
    compare si wall 3 --max-iterations 40 --tolerance 0 --warm-start "$folder/start.h5"
    compare npgs pile 40 --max-iterations 150 --precision f32 --law convex
    ;;
  column)
    compare_column si "1 2 3 4" 100 --law coulomb
    compare_column si "1 3" 100 --precision f32 --law convex
    compare_column consensus "1 3" 400 --subdomains 4 --law convex
    compare_column newton "1 3" 3 --subdomains 4 --law convex
    ;;
  consensus)
    compare_consensus wall 4 --max-iterations 20000 --tolerance 1e-5
    compare_consensus wall 4 --max-iterations 20000 --tolerance 1e-4 --precision f32 --law convex
    ;;
  asynchronous)
    "$stiction" generate wall --size 4 --seed 3 --quiet -o "$folder/batch.h5" || fail "generate wall"
    for ranks in 1 3 4; do
      for tolerance in 1e-3 1e-5; do
        # It is for 1e-3, which it reaches. How far below one run gets is not decided (docs/math/consensus.md): what it
        # says of that has to be true.
        solved=0
        ranks "$ranks" solve "$folder/batch.h5" --law convex --method consensus --subdomains 4 --asynchronous \
          --max-iterations 50000 --tolerance $tolerance --quiet --json "$folder/ranks.json" -o "$folder/ranks.h5" \
          2> "$folder/err" || solved=$?
        [ "$solved" -eq 0 ] || { [ "$solved" -eq 1 ] && [ $tolerance = 1e-5 ]; } ||
          fail "$ranks ranks to $tolerance: status $solved, $(cat "$folder/err")"
        python3 - "$folder/ranks.json" "$ranks" "$solved" << 'EOF' || fail "$ranks ranks: report"
import json, sys
report, ranks, solved = json.load(open(sys.argv[1])), int(sys.argv[2]), int(sys.argv[3])
assert report["reproducible"] is False and report["asynchronous"] is True and report["unconverged"] == solved, report
rounds = [rank["rounds"] for rank in report["per_rank"]]
assert len(rounds) == ranks and min(rounds) >= 4 and 16 * max(rounds) <= report["iterations"]["max"], report
EOF
        # The judge has the file's A; residuals are relative to a number that depends on tangents.
        [ "$solved" -eq 1 ] || "$stiction" verify "$folder/batch.h5" "$folder/ranks.h5" --law convex \
          --tolerance "1.42e${tolerance#1e}" || fail "$ranks ranks: the judge does not find what the report says"
      done
    done
    # A rank that says nothing more: the others make what rounds they may, and wait no longer than they were told.
    start_endless 3 "${asynchronous[@]}" --deadline 2
    kill -STOP "$victim"
    finish
    [ "$status" -eq 70 ] || fail "exit status $status, expected 70"
    grep -q 'not answered within the deadline' "$folder/err" || fail "the sentence says nothing of the deadline"
    ;;
  newton)
    compare_newton wall 4 --max-iterations 200 --tolerance 1e-6 --law convex
    compare_newton wall 4 --max-iterations 200 --tolerance 1e-4 --precision f32
    ;;
  step)
    compare_steps pile --envs 2 --steps 40 --seed 3
    compare_steps pile --size 150 --envs 1 --steps 30
    compare_steps walker --envs 3 --steps 60 --precision f32 --tolerance 0 --iterations 10
    compare_steps stack --size 9 --envs 1 --steps 6 --iterations 16 --law boxed
    hash=$(grep '"hash"' "$folder/one.json")
    compare_steps stack --size 9 --envs 1 --steps 6 --iterations 16 --law boxed --solver npgs
    grep -qF "$hash" "$folder/one.json" || fail "si is not npgs"
    compare_steps stack --size 9 --envs 1 --steps 6 --iterations 16 --law boxed --solver pgs
    grep -qF "$hash" "$folder/one.json" && fail "pgs has the bits of npgs"
    true
    ;;
  restart) restart "${STICTION_KILLS:-5}" "${STICTION_STEPS:-250}" parts ;;
  restart_one) restart "${STICTION_KILLS:-5}" "${STICTION_STEPS:-250}" one ;;
  together)
    write_together stack --size 12 --envs 3 --seed 5
    write_together walker --envs 3 --precision f32
    write_together stack --size 40 --envs 1
    refuse_a_full_disk
    ;;
  json)
    ranks 2 solve --scene wall --size 4 --tolerance 0 --max-iterations 64 --json - > "$folder/report.json" 2> "$folder/err"
    python3 - "$folder/report.json" << 'EOF' || fail "the report"
import json, sys
report = json.load(open(sys.argv[1]))
assert report["ranks"] == 2 and report["partition"] == "bisection" and report["solver"] == "si", report
assert len(report["per_rank"]) == 2
assert sum(rank["bodies"] for rank in report["per_rank"]) == report["bodies"]
assert report["messages"] == sum(rank["messages"] for rank in report["per_rank"]) > 0
assert report["bytes"] == sum(rank["bytes"] for rank in report["per_rank"]) > 0
assert report["exchanges"] >= 64 and report["gathers"] > 0
assert 0 <= report["synchronisation_share"] <= 1
work = [rank["seconds"] - rank["waited"] for rank in report["per_rank"]]
assert abs(report["imbalance"] - 2 * max(work) / sum(work)) < 1e-9, (report["imbalance"], work)
EOF
    ;;
  killed)
    unset OMPI_MCA_orte_execute_quiet  # which process a signal has ended is mpirun's to say
    for method in si asynchronous; do
      [ "$method" = si ] && start_endless 3 || start_endless 3 "${asynchronous[@]}"
      kill -KILL "$victim"
      finish
      grep -qi 'signal 9\|killed' "$folder/err" || fail "$method: mpirun does not say that a rank was killed"
    done
    ;;
  hung)
    start_endless 3 --deadline 2
    kill -STOP "$victim"
    finish
    [ "$status" -eq 70 ] || fail "exit status $status, expected 70"
    [ "$(grep -c '^stiction-mpi: ' "$folder/err")" -eq 1 ] || fail "not one sentence"
    grep -q 'not answered within the deadline' "$folder/err" || fail "the sentence says nothing of the deadline"
    ;;
  refusing)  # one speaks, and the others know of it: the first as long as it does not come seconds later
    for case in "0 0 0:0" "1000 0 500:0" "0 2000 2000:0" "60000 0 3000:1"; do
      # shellcheck disable=SC2086
      ranks 3 ${case%:*} 2> "$folder/err"
      status=$?
      [ "$status" -eq 2 ] || fail "${case%:*} ms: exit status $status, expected 2"
      [ "$(grep -c '^stiction-mpi: ' "$folder/err")" -eq 1 ] || fail "${case%:*} ms: not one sentence: $(cat "$folder/err")"
      grep -q "rank ${case#*:} refuses" "$folder/err" || fail "${case%:*} ms: $(cat "$folder/err")"
      echo "after ${case%:*} ms: rank ${case#*:} speaks for three"
    done
    ;;
  refused)
    ranks 1 solve --scene wall --size 2 --max-iterations 1 --quiet -o "$folder/wall.h5" 2> "$folder/err"
    for arguments in "solve" "solve --scene nothing" "solve --scene wall --partition thirds" "solve --scene walker" \
      "solve --scene wall --deadline 0" "solve --scene wall --max-iterations -1" "solve $folder/nowhere.h5" "dance" \
      "step" "step nothing" "step pile --partition thirds" "step pile --checkpoint /nowhere/x.h5" \
      "step stack --size 2000000000" "step pile --envs 1000000000000" "step walker --size 2000000000" \
      "step pile --solver newton" "step pile --solver consensus" "step pile --solver jacobi" \
      "solve --scene wall --partition slabs" "solve --scene granular-column --partition slabs --method newton" \
      "solve --scene granular-column --partition slabs -o $folder/x.h5" "step pile --partition slabs" \
      "solve --scene granular-column --size 65" "solve --scene granular-column --size 1 --warm-start $folder/wall.h5" \
      "solve --scene wall -o /nowhere/x.h5" "solve --scene wall --method jacobi" \
      "solve --scene wall --law convex --asynchronous" "solve --scene wall --method consensus --asynchronous" "solve --scene wall --method consensus --subdomains 0"; do
      # shellcheck disable=SC2086
      ranks 2 $arguments > "$folder/out" 2> "$folder/err"
      status=$?
      [ "$status" -eq 2 ] || fail "$arguments: exit status $status, expected 2"
      [ "$(grep -c '^stiction-mpi: ' "$folder/err")" -eq 1 ] || fail "$arguments: not one sentence: $(cat "$folder/err")"
      [ ! -s "$folder/out" ] || fail "$arguments: printed $(cat "$folder/out")"
      grep '^stiction-mpi: ' "$folder/err"
    done
    # 12 bodies have 12 * 32 numbers of 8 bytes, of which two ranks have half each. An environment has a status of 32
    # bytes: 1568 bytes.
    ranks 2 step pile --envs 1000000000000 2> "$folder/err"
    grep -q "pile with 1000000000000 environments of 12 bodies (--envs, --size) takes at least 1.57 PB of memory, and " \
      "$folder/err" || fail "a scene that no memory holds: $(cat "$folder/err")"
    for solver in newton multigrid consensus; do
      ranks 2 step pile --solver $solver 2> "$folder/err"
      grep -q "solver $solver: ranks step a scene by si, npgs or pgs; choose" "$folder/err" ||
        fail "--solver $solver: the sentence says nothing of what ranks step by"
    done
    ;;
esac
