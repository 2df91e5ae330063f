#!/usr/bin/env bash
# Installs what a fresh Debian 12 machine lacks to build and test Lumicut. Says what it installs; installs nothing twice.
# ./setup.sh zip: what build_zip.sh needs alone.
set -euo pipefail

packages=(
  build-essential cmake ninja-build pkg-config git ccache               # tools
  clang libclang-rt-dev llvm                                            # builds with sanitizers and names in their reports
  clang-format clang-tidy flake8 shellcheck                             # tools/dev/lint.sh
  libembree-dev libtbb-dev libhwy-dev libboost-dev                      # the library: rays, threads, SIMD, Student's t
  libopenexr-dev libimath-dev libopenimageio-dev libtinyobjloader-dev libtinygltf-dev libassimp-dev libpugixml-dev zlib1g-dev   # the command's files
  openimageio-tools                                                     # their CMake files ask for the programs too
  nlohmann-json3-dev libcli11-dev libfmt-dev                            # the command's words
  libcgal-dev libgmp-dev libmpfr-dev                                    # geometry/ (a target of its own)
  libgtest-dev libgmock-dev libbenchmark-dev python3 python3-numpy python3-openimageio   # tests and benchmarks
  libmetis-dev libmeshoptimizer-dev libnanoflann-dev                    # rivals in the tables of bench/geometry
  binutils                                                              # a test reads the library's symbols
  chromium                                                              # a test opens the report's page
  blender xvfb xauth xdotool imagemagick libgl1-mesa-dri                # the Blender add-on's tests, with and without a window
)
case ${1-} in
  '') ;;
  zip) packages=(g++ cmake ninja-build python3 ca-certificates binutils libboost-dev) ;;
  *) echo "setup: '$1' is neither empty nor 'zip'" >&2; exit 2 ;;
esac

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q "ok installed" || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "setup: all ${#packages[@]} packages are installed"
  exit 0
fi

echo "setup: installing ${missing[*]}"
as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "setup: run as root, or install sudo" >&2; exit 1; }
  as_root=(sudo)
fi
"${as_root[@]}" apt-get update -q
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}"
echo "setup: done"
