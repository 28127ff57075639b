# shellcheck shell=bash disable=SC2154  # folder, stiction, ranks and fail are those of test_mpi.sh, which reads this.
# A scene without matrices: one answer, whether ranks make all of it or a slab each.
compare_column() {  # compare_column METHOD RANKS ITERATIONS OPTIONS...
  local method=$1 counts=$2 iterations=$3 ranks column=(solve --scene granular-column --size 1 --seed 3 --envs 2 --quiet)
  shift 3
  rm -f "$folder/one.json"
  column+=(--method "$method" "$@")
  for ranks in $counts; do
    ranks "$ranks" "${column[@]}" --max-iterations "$iterations" --json "$folder/ranks.json" -o "$folder/ranks$ranks.h5" \
      2> "$folder/err"
    [ $? -le 1 ] || fail "column, $ranks ranks: $(cat "$folder/err")"
    "$stiction" diff "$folder/ranks1.h5" "$folder/ranks$ranks.h5" || fail "column, $ranks ranks"
    cp -n "$folder/ranks.json" "$folder/one.json"
    same_column "$folder/one.json" "$folder/ranks.json" || fail "column, $ranks ranks: reports"
    [ "$method" = si ] || continue
    ranks "$ranks" "${column[@]}" --max-iterations "$iterations" --partition slabs --json "$folder/slabs.json" \
      2> "$folder/err"
    [ $? -le 1 ] || fail "slabs, $ranks ranks: $(cat "$folder/err")"
    same_column "$folder/one.json" "$folder/slabs.json" || fail "slabs, $ranks ranks: reports"
  done
  # From where it ended, without a step.
  ranks 2 "${column[@]}" --max-iterations 0 --warm-start "$folder/ranks1.h5" --json "$folder/again.json" 2> "$folder/err"
  [ $? -le 1 ] || fail "column, from where it ended: $(cat "$folder/err")"
  python3 - "$folder"/{one,again}.json << 'EOF' || fail "column: residuals from where it ended"
import json, sys
ended, again = (json.load(open(name))["residual"]["max"] for name in sys.argv[1:])
sys.exit(0 if abs(again - ended) < 0.01 * ended else f"{ended}, then {again}")
EOF
  rm "$folder"/{one,ranks,again}.json "$folder"/ranks?.h5
  echo "column, $method: jobs of $counts ranks have one answer"
}

same_column() {  # same_column ONE MANY
  python3 - "$1" "$2" << 'EOF'
import json, sys
one, many = (json.load(open(name)) for name in sys.argv[1:])
for key in ("hash", "iterations", "residual", "bodies", "contacts", "environments", "unconverged", "law"):
    assert one[key] == many[key], (key, one[key], many[key])
assert many["bodies"] == 120 and many["environments"] == 2 and many["contacts"] > 240, many
assert 0 < many["residual"]["max"] < 0.5, many
assert sum(rank["bodies"] for rank in many["per_rank"]) == many["bodies"], many
assert all(rank["peak_memory"] > 1 << 20 for rank in many["per_rank"]), many
EOF
}
