#!/usr/bin/env python3
"""Blots on a glossy worktop: a scene with one, and what trace_gloss makes of it, raw and denoised.

    bench/worktop.py -o FOLDER [--roughness 0.2 0.35] [--passes 4 16 64]

A kitchen's corner, lit by way of its ceiling. The reference is path traced (1,500 paths a pixel, kept in the folder); its
own noise is a part of all errors. CPU seconds of the whole process, one thread, denoising included.
"""
import argparse
import json
import os
import resource
import subprocess

BENCH = os.path.dirname(os.path.abspath(__file__))


def box(material, low, high, inwards=False):
    positions = [[x, y, z] for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])]
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return {"positions": positions, "quads": [q[::-1] for q in quads] if inwards else quads, "material": material}


def worktop(roughness):
    return {
        "up": "z",
        "image": {"size": [120, 90]},
        "camera": {"eye": [2, -0.6, 1.6], "at": [2, 2.2, 0.95], "fov_y": 45},
        "materials": [
            {"name": "wall", "diffuse": [0.7, 0.68, 0.62]},
            {"name": "red", "diffuse": [0.6, 0.15, 0.1]},
            {"name": "green", "diffuse": [0.15, 0.45, 0.15]},
            {"name": "top", "model": "ggx", "diffuse": [0.25, 0.2, 0.15], "roughness": roughness, "ior": 1.5},
            {"name": "steel", "model": "ggx", "diffuse": [0.6, 0.6, 0.6], "metallic": 1, "roughness": roughness},
        ],
        "meshes": [box("wall", [0, -1.5, 0], [4, 3, 2.6], True), box("top", [0.2, 1.2, 0.85], [3.8, 2.9, 0.9]),
                   box("wall", [0.2, 1.3, 0], [3.8, 2.9, 0.85]), box("red", [0.8, 2.2, 0.9], [1.1, 2.5, 1.3]),
                   box("green", [2.6, 2.3, 0.9], [3.0, 2.6, 1.2]), box("steel", [1.6, 2.0, 0.9], [2.1, 2.5, 1.05])],
        "lights": [{"type": "rectangle", "position": [2, 1.0, 1.9], "u": [0.5, 0, 0], "v": [0, 0.3, 0], "value": 60}],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--lumicut", default=os.path.join(BENCH, "../build/release/bin/lumicut"))
    parser.add_argument("--roughness", type=float, nargs="+", default=[0.2, 0.35])
    parser.add_argument("--passes", type=int, nargs="+", default=[4, 16, 64])
    options = parser.parse_args()
    os.makedirs(options.output, exist_ok=True)
    print("| roughness | passes | trace_gloss | CPU s | RMSE raw | denoised | p99 raw | denoised | FLIP raw | denoised | bias |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for roughness in options.roughness:
        scene, reference = (os.path.join(options.output, f"{roughness}{end}") for end in (".json", ".reference.exr"))
        with open(scene, "w") as f:
            json.dump(worktop(roughness), f)
        render = [options.lumicut, "render", scene, "-q", "--threads", "1"]
        if not os.path.exists(reference):
            subprocess.run([*render, "-i", "path_tracer", "-p", "samples=1500", "-o", reference], check=True)
        for passes in options.passes:
            for traced in ("false", "true"):
                image = os.path.join(options.output, f"{roughness}.{passes}.{traced}.exr")
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                subprocess.run([*render, "-i", "lightcuts", "-p", "compensate=true", "-p", "error=0.05", "--vpls", "3000", "-p",
                                f"trace_gloss={traced}", "--passes", str(passes), "--denoise", "--layers", "radiance,denoised",
                                "-o", image], check=True)
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
                raw, denoised = (
                    json.loads(subprocess.run([options.lumicut, "compare", image, reference, "--layer", layer, "--reference-layer",
                                               "radiance", "--json"], check=True, capture_output=True).stdout)
                    for layer in ("radiance", "denoised"))
                print(f"| {roughness} | {passes} | {traced} | {seconds:.2f} | {100 * raw['rmse']:.1f} % | {100 * denoised['rmse']:.1f} % | "
                      f"{100 * raw['p99_relative_error']:.0f} % | {100 * denoised['p99_relative_error']:.0f} % | {raw['flip']:.3f} | "
                      f"{denoised['flip']:.3f} | {100 * denoised['bias']:+.1f} % |", flush=True)


if __name__ == "__main__":
    main()
