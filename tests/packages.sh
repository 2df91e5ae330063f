#!/usr/bin/env bash
# The Debian packages (cmake --build --preset packages --target package) in a bare Debian 12 tree: the commands run, hosts
# find the libraries with CMake and with pkg-config, one in C loads one, and Python and Blender have theirs. Lintian reads
# them before. As root, with debootstrap and lintian: tests/packages.sh [FOLDER OF PACKAGES [TREE]]; the tree is made anew.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
packages=$(cd "${1:-$root/build/packages}" && pwd)
tree=${2:-$root/build/packages_tree}
[ "$(id -u)" -eq 0 ] || { echo "packages: chroot needs root" >&2; exit 1; }
for tool in debootstrap lintian; do
  command -v $tool >/dev/null || { echo "packages: install $tool first" >&2; exit 1; }
done

step() { printf '\n== %s\n' "$*"; }
step lintian
# Two exceptions: there is no bug number of an intent to package, and CPack writes scripts that call ldconfig, beside the
# trigger that does the same.
lintian --allow-root --fail-on error,warning --suppress-tags initial-upload-closes-no-bugs,maintscript-calls-ldconfig \
  "$packages"/*.deb

step "a bare tree"
rm -rf --one-file-system "$tree"
debootstrap --variant=minbase bookworm "$tree" > "$packages/debootstrap.log"
cp -L /etc/resolv.conf /etc/hosts "$tree/etc/"
printf '#!/bin/sh\nexit 101\n' > "$tree/usr/sbin/policy-rc.d"  # no service starts
chmod +x "$tree/usr/sbin/policy-rc.d"
cleanup() { umount "$tree/proc" "$tree/dev" 2>/dev/null || true; }
trap cleanup EXIT
mount -t proc proc "$tree/proc"
mount --bind /dev "$tree/dev"
mkdir "$tree/work"
cp "$packages"/*.deb "$root/tests/plugin/c_host.c" "$tree/work/"
cp -r "$root/reference_images/cornell_box" "$tree/work/"
inside() { chroot "$tree" env HOME=/root DEBIAN_FRONTEND=noninteractive sh -euc "cd /work; $1"; }
install() { inside "apt-get -qq install -y --no-install-recommends $*" > "$packages/apt.log" 2>&1 || { tail -20 "$packages/apt.log"; exit 1; }; }
! inside "dpkg-query -W 'libtbb*' 'libembree*' 'libhwy*'" 2>/dev/null | grep . || { echo "packages: the tree is not bare" >&2; exit 1; }
inside "apt-get -qq update"

step "the command renders"
install ./liblumicut1_*.deb ./lumicut_*.deb
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n' > "$tree/work/a.ply"
inside "lumicut render a.ply --vpls 10 --size 4x4 -o ply.exr -q"  # assimp's module and what it needs
inside "lumicut render cornell_box/cornell_box.json --vpls 500 --size 48x36 -o box.exr --png box.png -q && ls -l box.exr box.png"
inside "lumicut convert cornell_box/cornell_box.json box.json"
# manual PROGRAM: it and each of its commands have a page, and completion knows them.
manual() {
  local command commands
  commands=$(inside "$1 --help" | sed -n '/^Subcommands:/,$s/^  \([a-z-]*\)  .*/\1/p')
  [ -n "$commands" ] || { echo "packages: $1 names no commands" >&2; exit 1; }
  for command in '' $commands; do
    inside "test -s /usr/share/man/man1/$1${command:+-$command}.1.gz" || { echo "packages: no page for $1 $command" >&2; exit 1; }
  done
  inside "bash -c '. /usr/share/bash-completion/completions/$1
    COMP_WORDS=($1 ${command:0:3}) COMP_CWORD=1; _${1//-/_}; test \"\${COMPREPLY[*]}\" = $command'"
}
manual lumicut

step "the geometry's command runs"
install ./lumicut-geometry_*.deb
printf '0,0\n1,0\n0,1\n1,1\n.5,.5\n' > "$tree/work/points.csv"
printf '0,0,.8\n1,1,.8\n' > "$tree/work/disks.csv"
inside "lumicut-geometry hitting-set --points points.csv --disks disks.csv --out - --picture disks.png && test -s disks.png"
inside "lumicut-geometry net --points points.csv --epsilon .5"  # by CGAL
manual lumicut-geometry

step "Python renders"
install ./python3-lumicut_*.deb
cat > "$tree/work/render_python.py" <<'P'
import lumicut
scene = lumicut.Scene(lumicut.Device())
scene.set_materials([lumicut.Material(diffuse=(0.5, 0.5, 0.5))])
scene.add_mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], [[0, 1, 2]])
scene.set_lights([lumicut.Light(type=lumicut.POINT, color=(1, 1, 1), value=9, position=(0, 0, 1))])
scene.set_camera(lumicut.look_at((0, -3, 2), (0, 0, 0)))
scene.commit()
print("mean radiance", lumicut.render(scene, width=32, height=24, vpls=100).mean())
P
inside "python3 render_python.py"
install ./liblumicut-geometry1_*.deb ./liblumicut-geometry-cgal1_*.deb
cat > "$tree/work/geometry_python.py" <<'P'
from lumicut import geometry
points = [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0.5]]
chosen, known = geometry.hitting_set(points, [[0, 0, 0.8], [1, 1, 0.8]])
assert list(chosen) == [4] and known["lower_bound"] == 1
assert len(geometry.epsilon_net(points, 0.5)) > 0  # by CGAL
P
inside "python3 geometry_python.py"

step "hosts find the library"
install ./liblumicut-dev_*.deb ./liblumicut-geometry-dev_*.deb gcc libc6-dev cmake make pkg-config
cat > "$tree/work/host.c" <<'C'
#include <lumicut/lumicut.h>
#include <stdio.h>
int main(void) {
  puts(lumicut_version(NULL, NULL));
  return 0;
}
C
cat > "$tree/work/tree_host.c" <<'C'
#include <lumicut/lumicut_geometry.h>
#include <stdio.h>
int main(void) {
  const double points[] = {0, 0, 1, 0, 0, 1};
  lumicut_balltree tree;
  size_t leaves = 0;
  if (lumicut_balltree_create(points, NULL, 3, 2, LUMICUT_BALLTREE_KD, &tree)) return puts(lumicut_geometry_error()), 1;
  lumicut_balltree_measure(tree, &leaves, NULL, NULL);
  lumicut_balltree_release(tree);
  printf("%s, %zu leaves\n", lumicut_geometry_version(), leaves);
  return leaves != 3;
}
C
cat > "$tree/work/net_host.c" <<'C'
#include <lumicut/lumicut_geometry.h>
#include <stdio.h>
int main(void) {
  const double points[] = {0, 0, 1, 0, 0, 1};
  lumicut_indices net;
  if (lumicut_epsilon_net(points, NULL, 3, 0.5, 0, 0, 1, &net)) return puts(lumicut_geometry_error()), 1;
  printf("a net of %zu\n", lumicut_indices_count(net));
  lumicut_indices_release(net);
  return 0;
}
C
mkdir "$tree/work/project"
cat > "$tree/work/project/CMakeLists.txt" <<'C'
cmake_minimum_required(VERSION 3.22)
project(hosts LANGUAGES C)
find_package(lumicut 1.0 REQUIRED)
find_package(lumicut_geometry 1.0 REQUIRED)
foreach(host host tree_host net_host)
  add_executable(${host} ../${host}.c)
endforeach()
target_link_libraries(host PRIVATE lumicut::lumicut)
target_link_libraries(tree_host PRIVATE lumicut::geometry)
target_link_libraries(net_host PRIVATE lumicut::geometry_cgal)
C
inside "cmake -S project -B project/build > cmake.log && cmake --build project/build > build.log"
inside "for host in host tree_host net_host; do project/build/\$host; done"
for pair in host:lumicut tree_host:lumicut_geometry net_host:lumicut_geometry_cgal; do
  inside "cc -std=c99 ${pair%:*}.c -o ${pair%:*} \$(pkg-config --cflags --libs ${pair#*:}) && ./${pair%:*}"
done
# shellcheck disable=SC2016
inside 'cc -std=c99 c_host.c -o c_host $(pkg-config --cflags lumicut) -ldl -lm && ./c_host liblumicut.so.1 image && ls -l image.ppm'

step "Blender has the add-on"
install ./lumicut-blender_*.deb
cat > "$tree/work/render.py" <<'P'
import bpy
from lumicut_blender import runtime
assert runtime.require().origin == "system", runtime.failure()
scene = bpy.context.scene
scene.render.engine = "LUMICUT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.filepath = 48, 36, "/work/blender.png"
bpy.ops.render.render(write_still=True)
P
inside "blender -b --factory-startup --addons lumicut_blender --python-exit-code 1 -P render.py > blender.log 2>&1 || { tail -20 blender.log; exit 1; }; ls -l blender.png"
step "all passed"
