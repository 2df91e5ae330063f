#!/usr/bin/env python3
"""Light that surfaces which are not Lambert's throw on others: passes beside the path tracer.

    bench/lobed_lights.py -o FOLDER [--passes 3 48]

A wall that a low sun shines on from behind, lit by the floor before it, and a closed room of one material, lit by way of its
ceiling. References are path traced (768 paths a pixel, kept in the folder); their own noise is a part of all errors.
"""
import argparse
import json
import math
import os
import subprocess

from worktop import BENCH, box

MATERIALS = {
    "oren_nayar, slope .2": {"oren_nayar": "often", "roughness": 0.2},
    "oren_nayar, slope .5": {"oren_nayar": "often", "roughness": 0.5},
    "oren_nayar, slope 1": {"oren_nayar": "often", "roughness": 1},
    "burley, roughness .5": {"model": "ggx", "burley": True, "specular": [0.5, 0.5, 0.5], "roughness": 0.5},
    "burley, roughness 1": {"model": "ggx", "burley": True, "specular": [0.5, 0.5, 0.5], "roughness": 1},
    "beneath gloss, roughness .5": {"model": "ggx", "roughness": 0.5},
}


def quad(corners, material):
    return {"positions": corners, "quads": [[0, 1, 2, 3]], "material": material}


def against_the_sun(material):
    height = math.radians(14)
    return {
        "image": {"size": [32, 24]},
        "camera": {"eye": [2.5, 0, 1], "at": [-4, 0, 1], "fov_y": 40},
        "materials": [{"name": "floor", "diffuse": [0.8, 0.8, 0.8], **material}, {"name": "wall", "diffuse": [0.8, 0.8, 0.8]}],
        "meshes": [quad([[-4, -20, 0], [40, -20, 0], [40, 20, 0], [-4, 20, 0]], "floor"),
                   quad([[-4, -20, 0], [-4, 20, 0], [-4, 20, 2], [-4, -20, 2]], "wall")],
        "lights": [{"type": "sun", "direction": [math.cos(height), 0, -math.sin(height)], "value": 3}],
    }


def room(material):
    return {
        "image": {"size": [48, 36]},
        "camera": {"eye": [1.8, -1.8, 1.6], "at": [-1, 1, 1], "fov_y": 60},
        "materials": [{"name": "all", "diffuse": [0.6, 0.6, 0.6], **material}],
        "meshes": [box("all", [-2, -2, 0], [2, 2, 3], True), box("all", [-1, 0.2, 0], [-0.2, 1, 0.9])],
        "lights": [{"type": "rectangle", "position": [-0.5, 0.4, 2.2], "u": [0.3, 0, 0], "v": [0, 0.3, 0], "value": 20}],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--lumicut", default=os.path.join(BENCH, "../build/release/bin/lumicut"))
    parser.add_argument("--passes", type=int, nargs="+", default=[48])
    options = parser.parse_args()
    os.makedirs(options.output, exist_ok=True)
    print("| scene | material | passes | mean | RMSE |\n|---|---|---|---|---|")
    for make in (against_the_sun, room):
        for number, (name, material) in enumerate(MATERIALS.items()):
            stem = os.path.join(options.output, f"{make.__name__}.{number}")
            with open(f"{stem}.json", "w") as f:
                json.dump({"up": "z", **make(material)}, f)
            render = [options.lumicut, "render", f"{stem}.json", "-q", "--no-denoise"]
            if not os.path.exists(f"{stem}.reference.exr"):
                subprocess.run([*render, "-i", "path_tracer", "--spp", "16", "--passes", "48", "-o", f"{stem}.reference.exr"],
                               check=True)
            for passes in options.passes:
                subprocess.run([*render, "--preset", "good", "--passes", str(passes), "-o", f"{stem}.exr"], check=True)
                found = json.loads(subprocess.run([options.lumicut, "compare", f"{stem}.exr", f"{stem}.reference.exr", "--json",
                                                   "--no-flip"], check=True, capture_output=True).stdout)
                print(f"| {make.__name__} | {name} | {passes} | {100 * found['bias']:+.1f} % | {found['rmse']:.3f} |", flush=True)


if __name__ == "__main__":
    main()
