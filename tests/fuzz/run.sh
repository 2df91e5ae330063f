#!/usr/bin/env bash
# Fuzzes each target for so many minutes: tests/fuzz/run.sh MINUTES [TARGET...]. All targets without any named.
# The seeds in corpus/TARGET come first; what is found beside them is kept in out/fuzz/corpus/TARGET and used again, and
# inputs that crash, hang or leak are kept in out/fuzz/findings. Ends with 1 where there is one.
#   LUMICUT_FUZZ_SEED    of its random numbers (another each time)
#   LUMICUT_BINARY_DIR   the build (build/asan)        LUMICUT_FUZZ_OUTPUT   where to keep (out/fuzz)
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
binaries=${LUMICUT_BINARY_DIR:-$top/build/asan}/bin
output=${LUMICUT_FUZZ_OUTPUT:-$top/out/fuzz}
if [ $# -lt 1 ]; then
  echo "usage: $0 MINUTES [TARGET...]" >&2
  exit 2
fi
seconds=$(awk -v minutes="$1" 'BEGIN { printf "%d", 60 * minutes }')
shift
if [ $# -eq 0 ]; then
  for source in "$here"/*.cpp; do
    name=$(basename "$source" .cpp)
    set -- "$@" "$name"
  done
fi

# Readers that take a path get files in memory.
scratch=$(mktemp -d -p "$([ -d /dev/shm ] && echo /dev/shm || echo "${TMPDIR:-/tmp}")" lumicut-fuzz-run-XXXXXX)
trap 'rm -rf "$scratch"' EXIT
export TMPDIR=$scratch
# Leaks are looked for once, at the end (-detect_leaks=0 leaves that): OpenImageIO keeps what it has opened, and libFuzzer
# would look after each run. Memory that was freed is kept from use for a while; less of it is quicker.
export ASAN_OPTIONS=quarantine_size_mb=16:detect_leaks=1

failed=0
for target in "$@"; do
  seeds=$here/corpus/$target
  kept=$output/corpus/$target
  log=$output/$target.log
  mkdir -p "$seeds" "$kept" "$output/findings"
  dictionary=$here/$target.dict
  [ -f "$dictionary" ] || dictionary=
  echo "fuzz_$target: $seconds s"
  if ! "$binaries/fuzz_$target" -max_total_time="$seconds" -detect_leaks=0 -timeout=10 -rss_limit_mb=2048 -max_len=4096 -print_final_stats=1 \
      -artifact_prefix="$output/findings/$target-" ${dictionary:+-dict="$dictionary"} ${LUMICUT_FUZZ_SEED:+-seed="$LUMICUT_FUZZ_SEED"} "$kept" "$seeds" > "$log" 2>&1; then
    tail -n 40 "$log"
    echo "fuzz_$target: a finding, in $output/findings; the log is $log" >&2
    failed=1
  fi
  sed -n "s/^stat::number_of_executed_units: */fuzz_$target: executions: /p" "$log"
done
exit $failed
