#!/usr/bin/env bash
# Checkpoints that ranks write together; test_mpi.sh reads this, and has what is not defined here.
# shellcheck disable=SC2154

# One file of 2 to 4 ranks is that of one process, number for number; parts that were there before are gone.
write_together() {  # write_together SCENE OPTIONS...
  local ranks files
  rm -f "$folder"/*.h5*
  "$stiction" step "$@" --steps 12 --checkpoint "$folder/one.h5" --quiet || fail "one process"
  for ranks in 2 3 4; do
    for files in parts one; do
      ranks "$ranks" step "$@" --steps "$([ "$files" = one ] && echo 12 || echo 6)" --checkpoint "$folder/together.h5" --checkpoint-files "$files" --quiet \
        2> "$folder/err" || fail "$ranks ranks, $files: $(cat "$folder/err")"
    done
    [ "$(echo "$folder"/together.h5*)" = "$folder/together.h5" ] || fail "more than one file: $(echo "$folder"/together.h5*)"
    "$compare" "$folder/one.h5" "$folder/together.h5" || fail "$ranks ranks: another file than of one process"
    "$stiction" step "$@" --steps 20 --checkpoint "$folder/together.h5" --json "$folder/last.json" --quiet || fail "one process goes on"
    grep -q '"resumed_at": 12,' "$folder/last.json" || fail "one process began anew"
    rm "$folder/together.h5"
  done
}

# A limit of the files' length stands for a disk that is full.
refuse_a_full_disk() {
  # Messages of the ranks then go through no shared file.
  OMPI_MCA_btl=self,tcp timeout 60 "$mpiexec" -n 3 bash -c 'trap "" XFSZ; ulimit -f 16; exec "$@"' - "$program" step pile --size 150 \
    --steps 2 --checkpoint "$folder/full.h5" --checkpoint-files one --quiet 2> "$folder/err"
  [ $? -eq 2 ] || fail "a full disk: $(cat "$folder/err")"
  [ "$(grep -c '^stiction-mpi: ' "$folder/err")" -eq 1 ] || fail "a full disk: not one sentence: $(cat "$folder/err")"
  grep -q 'full.h5: cannot be written: ' "$folder/err" || fail "a full disk: $(cat "$folder/err")"
  [ "$(wc -l < "$folder/err")" -eq 1 ] || fail "a full disk: more than a sentence: $(cat "$folder/err")"
  [ -z "$(find "$folder" -name 'full.h5*')" ] || fail "a full disk: $(echo "$folder"/full.h5*) stays"
  cat "$folder/err"
}
