#!/usr/bin/env bash
# Installs what is missing (Debian 12), builds, solves recorded and generated contact batches with every solver on
# every device there is, and prints a table. Writes out/residual.png (residual against iterations) and out/graph.svg
# (one contact graph, coloured). Runs from any directory, and again.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

out=$root/out
begin=$SECONDS
say "packages"
install_packages "${build_packages[@]}"
make_venv "$root/tools/requirements-pictures.txt"
find_nvcc

say "build"
# For this machine's instruction set alone. A build that makes the command line already, as that of scripts/test.sh,
# keeps its options.
if ! { [ -f "$build/build.ninja" ] && cmake --build "$build" --target help 2> /dev/null | grep '^stiction_cli: phony' > /dev/null; }; then
  configure -DSTICTION_CPU_KERNELS=native -DSTICTION_BUILD_TESTS=OFF -DSTICTION_BUILD_BENCH=OFF -DSTICTION_BUILD_EXAMPLES=OFF \
    -DSTICTION_BUILD_PYTHON=OFF
fi
build_targets stiction_cli
stiction=$build/bin/stiction

say "machine"
"$stiction" info
devices=(cpu)
if "$stiction" info --json | "${python:-python3}" -c '
import json, sys
sys.exit(0 if any(d["usable"] and d["device"].startswith("cuda") for d in json.load(sys.stdin)["devices"]) else 1)'; then
  devices+=(cuda)
fi

say "batches"
mkdir -p "$out"
generated=$out/walker-4096.h5
[ -f "$generated" ] || "$stiction" generate walker --envs 4096 --seed 1 -o "$generated"
batches=("$root"/examples/data/*.h5 "$generated")
stat -c '   %9s bytes  %n' "${batches[@]}"

# An environment that misses the tolerance is exit status 1 and a number in the table; anything else ends the demo.
solve() {
  local status=0
  "$stiction" solve "$@" --quiet || status=$?
  [ "$status" -le 1 ] || exit "$status"
}

say "solve"
note "double precision, relative residual 1e-6 (pgs and jacobi: 1e-4), at most 10000 iterations"
reports=()
for batch in "${batches[@]}"; do
  name=$(basename "$batch" .h5)
  note "$name, $((SECONDS - begin)) s"
  for solver in npgs apgd pgs jacobi; do
    case $solver in npgs | apgd) tolerance=1e-6 ;; *) tolerance=1e-4 ;; esac
    for device in "${devices[@]}"; do
      report=$out/$name-$solver-$device.json
      solve "$batch" --solver "$solver" --device "$device" --precision f64 --tolerance "$tolerance" \
        --max-iterations 10000 --json "$report"
      reports+=("$name=$report")
    done
  done
done
status=0
python3 "$root/tools/report_table.py" "${reports[@]}" || status=$?

say "pictures"
shown=$root/examples/data/hand_cube.h5
curves=()
for solver in npgs apgd pgs jacobi; do
  solve "$shown" --solver "$solver" --precision f64 --max-iterations 1000 --convergence "$out/$solver.csv"
  curves+=("$solver=$out/$solver.csv")
done
if "${python:-python3}" "$root/tools/plot_convergence.py" "${curves[@]}" -o "$out/residual.png" --title "hand_cube, f64" \
  > /dev/null 2>&1
then note "out/residual.png    residual against iterations, four solvers"
else note "out/residual.png    not drawn: no matplotlib (out/*.csv hold the numbers)"
fi
if command -v dot > /dev/null; then
  "$stiction" inspect "$root/examples/data/pile.h5" --env 5 --graph "$out/graph.svg" > /dev/null
  note "out/graph.svg       contact graph of one environment, coloured as it is solved"
else
  note "out/graph.svg       not drawn: no graphviz"
fi
note "$((SECONDS - begin)) s in all"
exit "$status"
