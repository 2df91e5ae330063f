#!/usr/bin/env bash
# Sets up, builds everything and passes all tests. ./check.sh [debug|asan|tsan] does it with another preset.
set -euo pipefail
cd "$(dirname "$0")"
preset=${1:-release}
./setup.sh
cmake --preset "$preset"
cmake --build --preset "$preset"
ctest --preset "$preset"
