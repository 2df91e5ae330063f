#!/usr/bin/env bash
# Makes the zip of the Blender add-on that needs nothing of the machine it runs on but Linux on x86-64 with glibc 2.28:
# build/portable/lumicut_blender-VERSION.zip. Wants Debian 12 (the compiler's own libraries are linked in), installs what
# it lacks to compile, and gets the sources of oneTBB and Highway (4 MB) from Debian's mirror.
set -euo pipefail
cd "$(dirname "$0")"
./setup.sh zip
cmake --preset portable
cmake --build --preset portable --target lumicut_blender_zip
python3 tests/plugin/test_portable.py Symbols
ls -l build/portable/lumicut_blender-*.zip
