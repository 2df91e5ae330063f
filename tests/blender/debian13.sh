#!/usr/bin/env bash
# Runs Blender's headless tests on Debian 13 (Blender 4.3.2, Embree 4): a tree made with debootstrap, entered with chroot.
# Usage, as root: tests/blender/debian13.sh [TREE] [suite ...]; TREE (default build/debian13) is made once and kept.
# The whole network that it needs is Debian's mirror. ZIP=FILE tests that zip of the add-on as it is, with its own library:
# nothing is built, and a new tree gets Blender and no development package.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
tree=${1:-$root/build/debian13}
shift || true
suites=("$@")
[ ${#suites[@]} -gt 0 ] || suites=(Batches Farms Interruption TheZip)

[ "$(id -u)" -eq 0 ] || { echo "debian13: chroot needs root" >&2; exit 1; }
command -v debootstrap >/dev/null || { echo "debian13: install debootstrap first" >&2; exit 1; }
packages=(blender libembree-dev libtbb-dev libhwy-dev cmake ninja-build g++ python3 python3-numpy pkg-config
          nlohmann-json3-dev libboost-dev libfmt-dev libcli11-dev libopenexr-dev libimath-dev libopenimageio-dev openimageio-tools
          python3-openimageio libtinyobjloader-dev libtinygltf-dev libassimp-dev libpugixml-dev zlib1g-dev)
[ -z "${ZIP-}" ] || packages=(blender python3 python3-numpy)

if [ ! -x "$tree/usr/bin/dpkg" ]; then
  mkdir -p "$tree"
  debootstrap --variant=minbase trixie "$tree"
fi
missing=()
for package in "${packages[@]}"; do
  # shellcheck disable=SC2016  # dpkg-query expands it
  chroot "$tree" dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q "ok installed" || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  chroot "$tree" apt-get update -q
  chroot "$tree" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}"
fi

cleanup() { umount -l "$tree/proc" "$tree/dev" "$tree/src" 2>/dev/null || true; }
trap cleanup EXIT
mkdir -p "$tree/src" "$tree/build"
mountpoint -q "$tree/proc" || mount -t proc proc "$tree/proc"
mountpoint -q "$tree/dev" || mount --bind /dev "$tree/dev"  # not its submounts: unmounting them would reach the host's
mountpoint -q "$tree/src" || mount --bind -o ro "$root" "$tree/src"

if [ -n "${ZIP-}" ]; then
  cp "$ZIP" "$tree/build/"
  chroot "$tree" blender --version | head -1
  chroot "$tree" dpkg-query -W '*tbb*-dev' '*embree*-dev' 'libhwy-dev' 'cmake' 2>/dev/null || echo "no development package of what the library uses"
  chroot "$tree" env LUMICUT_ZIP="/build/${ZIP##*/}" LUMICUT_SOURCE_DIR=/src LUMICUT_BINARY_DIR=/build PYTHONDONTWRITEBYTECODE=1 \
    python3 /src/tests/blender/test_blender.py -v "${suites[@]}"
  exit
fi
chroot "$tree" cmake -S /src -B /build -G Ninja -DCMAKE_BUILD_TYPE=Release \
  -DLUMICUT_BUILD_TESTS=OFF -DLUMICUT_BUILD_BENCH=OFF -DLUMICUT_BUILD_GEOMETRY_CGAL=OFF
# TARGETS=lumicut_blender_zip leaves the command out, and with it the tests that compare F12 with the command.
read -ra targets <<<"${TARGETS:-all}"
chroot "$tree" cmake --build /build -j"${JOBS:-2}" --target "${targets[@]}"
chroot "$tree" blender --version | head -1
chroot "$tree" env LUMICUT_SOURCE_DIR=/src LUMICUT_BINARY_DIR=/build PYTHONDONTWRITEBYTECODE=1 \
  python3 /src/tests/blender/test_blender.py -v "${suites[@]}"
