#!/usr/bin/env bash
# Sets up, looks at the sources (format, Python, scripts), builds everything and passes all tests.
# ./check.sh release|debug|asan|tsan does one build and its tests alone; asan runs the fuzz targets too.
# ./check.sh tidy: clang-tidy on the library and the tools.
set -euo pipefail
cd "$(dirname "$0")"
build() {
  cmake --preset "$1"
  cmake --build --preset "$1"
}
step() { printf '\n== %s (%d s)\n' "$1" "$SECONDS"; }

./setup.sh
case ${1-} in
  '') ;;
  tidy) exec tools/dev/lint.sh --tidy ;;
  *)
    build "$1"
    ctest --preset "$1"
    exit ;;
esac
step lint
tools/dev/lint.sh
step "build"
build release
step "tests"
ctest --preset release
step "all passed"
