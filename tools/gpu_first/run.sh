#!/usr/bin/env bash
# The first eight minutes on a GPU, from a pack that scripts/pack_for_gpu.sh made. It asks for a C library, NVIDIA's
# driver, and xz or python3; it works in any folder, and without a network:
#
#   run.sh [RESULTS]       default: $OUT, else results in the folder where it is called
#
# Three files: results.jsonl, a line for each result at once. summary.txt, at most 40 lines, also the end of the output;
# all.tgz, with the log and ncu's tables, whatever ends it. STICTION_GPU_SECONDS limits it (default 470),
# STICTION_GPU_DEVICE=ptx rehearses it without a GPU. Exit status 0: all is right.
set -uo pipefail
pack=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
results=${1:-${OUT:-$PWD/results}}
mkdir -p "$results" && results=$(cd "$results" && pwd) || exit 2
work=$(mktemp -d) || exit 2
mkdir "$work/all"
child='' shown=''

# shellcheck disable=SC2317  # called by the trap
finish() {
  status=$?
  trap - EXIT
  if [ -n "$child" ]; then kill -TERM "$child" 2> /dev/null && wait "$child" 2> /dev/null; fi
  # The log ends with its writer, unless a check still holds it open.
  for _ in 1 2 3 4 5 6 7 8 9 10; do
    if [ -z "$shown" ] || ! kill -0 "$shown" 2> /dev/null; then break; fi
    sleep 0.2
  done
  if [ -n "$shown" ]; then kill "$shown" 2> /dev/null; fi
  tar -C "$work" -chzf "$results/all.tgz" all
  rm -rf "$work"
  exit "$status"
}
trap finish EXIT
trap 'exit 143' TERM INT HUP

fail() { echo "run.sh: $*" | tee "$results/summary.txt" >&2; exit 2; }

# The pack is whole: its files have the digests of its manifest.
sed -n 's/^file \([0-9a-f]*\) /\1  /p' "$pack/manifest.txt" > "$work/files" || fail "there is no manifest.txt beside it"
(cd "$pack" && sha256sum --quiet -c "$work/files") || fail "the pack is damaged: carry it anew"
sources=$(sed -n 's/^sources //p' "$pack/manifest.txt")

if command -v xz > /dev/null; then
  xz -dc "$pack/gpu_first.xz" > "$work/gpu_first"
else
  python3 -c 'import lzma, shutil, sys; shutil.copyfileobj(lzma.open(sys.argv[1]), sys.stdout.buffer)' "$pack/gpu_first.xz" > "$work/gpu_first"
fi || fail "neither xz nor python3 unpacks gpu_first.xz"
chmod +x "$work/gpu_first"
"$work/gpu_first" --list > "$work/all/checks.txt" 2>&1 || fail "gpu_first does not run here: $(tail -n 1 "$work/all/checks.txt")"

# Results lie where they are wanted from the first line on, and among all the others too.
: >> "$results/results.jsonl" || fail "$results cannot be written"
ln -s "$results/results.jsonl" "$work/all/results.jsonl"
cp "$pack/manifest.txt" "$work/all/"
rm -f "$results/summary.txt"
mkfifo "$work/said"
tee "$work/all/log.txt" < "$work/said" &
shown=$!
"$work/gpu_first" --plan minutes --device "${STICTION_GPU_DEVICE:-cuda}" --size "${STICTION_GPU_SIZE:-}" \
  --seconds "${STICTION_GPU_SECONDS:-470}" --out "$work/all/results.jsonl" --summary "$results/summary.txt" \
  --hashes "$pack/hashes.csv" --batches "$pack/batches" --made-of "$sources" > "$work/said" 2>&1 &
child=$!
wait "$child"
status=$?
child=''
wait "$shown"
shown=''
exit "$status"
