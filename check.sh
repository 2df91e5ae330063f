#!/usr/bin/env bash
# Sets up, looks at the sources (format, clang-tidy, Python, scripts), builds everything and passes all tests.
# ./check.sh release|debug|asan|tsan does one build and its tests alone; asan runs the fuzz targets too, half a minute each.
# ./check.sh portable makes the self-contained zip, and passes the tests of a build without Embree, those of the ABI on the
# zip's library, and Blender's on the zip.
set -euo pipefail
cd "$(dirname "$0")"
build() {
  cmake --preset "$1" -DCMAKE_COMPILE_WARNING_AS_ERROR=ON  # not for users: other compilers warn of other things
  cmake --build --preset "$1"
}
step() { printf '\n== %s (%d s)\n' "$1" "$SECONDS"; }

./setup.sh
case ${1-} in
  '') ;;
  portable)
    ./build_zip.sh
    build no-embree
    ctest --preset no-embree --parallel "$(nproc)" -E '^blender'
    python3 tests/plugin/test_portable.py -v
    zip=$(echo build/portable/lumicut_blender-*.zip)
    LUMICUT_ZIP=$PWD/$zip python3 tests/blender/test_blender.py -v Batches Farms Interruption TheZip
    exit ;;
  *)
    build "$1"
    ctest --preset "$1" --parallel "$(nproc)"
    exit ;;
esac
step lint
tools/dev/lint.sh --tidy
step "build"
build release
step "tests"
ctest --preset release --parallel "$(nproc)"
step "all passed"
