#!/usr/bin/env bash
# Sets up, looks at the sources, builds everything and passes all tests; then those of the library and the readers, and a
# short run of each fuzz target, under AddressSanitizer and UndefinedBehaviorSanitizer.
# ./check.sh release|debug|asan|tsan does one build and its tests alone.
set -euo pipefail
cd "$(dirname "$0")"
build() {
  cmake --preset "$1"
  cmake --build --preset "$1"
}
step() { printf '\n== %s (%d s)\n' "$1" "$SECONDS"; }

./setup.sh
if [ $# -gt 0 ]; then
  build "$1"
  ctest --preset "$1"
  exit
fi
step lint
tools/dev/lint.sh
step "build, release"
build release
step "build, asan"
build asan
step "tests, asan"
ctest --preset asan
step "tests, release"
ctest --preset release
step "all passed"
