#!/usr/bin/env bash
# Sets up, builds, renders a scene with many lights through the plug-in, and shows how near Lightcuts comes to the sum of
# all lights. ./demo.sh [SCENE.json [VPLS [WIDTHxHEIGHT]]]; pictures go to out/demo/.
set -euo pipefail
cd "$(dirname "$0")"
./setup.sh
cmake --preset release
cmake --build --preset release --target lumicut lumicut_plugin

scene=${1:-reference_images/indirect_room/indirect_room.json}
vpls=${2:-6000}
size=${3:-320x240}
out=out/demo
lumicut=build/release/bin/lumicut
mkdir -p "$out"
for run in exhaustive: lightcuts_2:error=0.02 lightcuts_1:error=0.01; do
  name=${run%%:*}
  parameter=${run#*:}
  "$lumicut" render "$scene" -i "${name%%_*}" ${parameter:+-p "$parameter"} --vpls "$vpls" --size "$size" \
    -o "$out/$name.exr" --png "$out/$name.png" --stats "$out/$name.json"
  "$lumicut" compare "$out/$name.exr" "$out/exhaustive.exr" --json --error-image "$out/$name.error.png" --scale 16 \
    > "$out/$name.compare.json"
done

python3 - "$out" "$scene" <<'PYTHON'
import json, pathlib, sys
out = pathlib.Path(sys.argv[1])
print(f"\n{sys.argv[2]}: error against the exhaustive sum over the same lights")
print(f"{'method':<16}{'seconds':>9}{'rays/pixel':>12}{'RMSE':>10}{'LMSE':>10}{'relative error':>16}")
for name in ("exhaustive", "lightcuts_2", "lightcuts_1"):
    stats = json.loads((out / f"{name}.json").read_text())
    error = json.loads((out / f"{name}.compare.json").read_text())
    print(f"{name:<16}{stats['seconds']:>9.2f}{stats['rays_per_pixel']:>12.0f}{error['rmse']:>10.5f}{error['lmse']:>10.5f}"
          f"{100 * error['mean_relative_error']:>14.2f} %")
print(f"\nPictures: {out}/exhaustive.png, lightcuts_2.png, lightcuts_1.png; errors x16: {out}/*.error.png")
PYTHON
