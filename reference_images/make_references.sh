#!/usr/bin/env bash
# Makes reference_images/<scene>/{ref.exr, ref.json} anew: the exhaustive sum, small. Run from the project's root.
set -euo pipefail
cd "$(dirname "$0")/.."
vpls=3000
size=96x72
for scene in cornell_box indirect_room court; do
  folder=reference_images/$scene
  command="lumicut render $folder/$scene.json -i exhaustive --accel embree --rays fast --vpls $vpls --seed 1 --size $size --layers radiance -o $folder/ref.exr"
  # shellcheck disable=SC2086  # a command and its words
  build/release/bin/${command}
  cat > "$folder/ref.json" <<JSON
{"command": "$command", "commit": "$(git rev-parse --short HEAD)", "vpls": $vpls, "seed": 1, "width": ${size%x*}, "height": ${size#*x}}
JSON
done
