#!/usr/bin/env bash
# Checks the sources without building them: format, Python, scripts; with --tidy clang-tidy too, which takes minutes.
# Prints all findings, not only the first.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
failed=''
look() {
  local what=$1 output
  shift
  output=$("$@" 2>&1) || { printf '%s\n' "$output"; failed+=" $what"; }
}

files() { find . \( -name build -o -name out -o -name .git \) -prune -o -type f \( "$@" \) -print; }
mapfile -t cpp < <(files -name '*.cpp' -o -name '*.h' -o -name '*.hpp' -o -name '*.c')
mapfile -t python < <(files -name '*.py')
mapfile -t scripts < <(files -name '*.sh' -o -path './.ci/*' -o -path './tools/dev/pre-commit')

look format clang-format --dry-run -Werror "${cpp[@]}"
look flake8 flake8 --isolated --select=E9,F "${python[@]}"  # E9: syntax; F: pyflakes
look shellcheck shellcheck "${scripts[@]}"
[ -z "$failed" ] || { echo "lint: failed:$failed" >&2; exit 1; }

if [ "${1-}" = --tidy ]; then
  # clang-tidy needs the compile commands and the one generated header.
  configure() { cmake --preset release && cmake --build --preset release --target lumicut_git_version; }
  look configure configure
  [ -n "$failed" ] || look clang-tidy tools/dev/tidy.py build/release
  [ -z "$failed" ] || { echo "lint: failed:$failed" >&2; exit 1; }
fi
echo "lint: ${#cpp[@]} C++ files, ${#python[@]} Python files, ${#scripts[@]} scripts: nothing found"
