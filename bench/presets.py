#!/usr/bin/env python3
"""Presets and what lies beside them: CPU seconds against errors, so that a dominated preset shows.

    bench/presets.py -o FOLDER SCENE REFERENCE [SCENE REFERENCE ...] [--size 120x90]

Denoised methods are compared by their denoised layer. A row is dominated where another of its scene takes no longer and has
no greater FLIP and mean relative error. CPU seconds of the whole process, one thread.
"""
import argparse
import json
import os
import resource
import subprocess

BENCH = os.path.dirname(os.path.abspath(__file__))
METHODS = {  # the layer that is measured, and how it is rendered
    "Draft": ("radiance", ["--preset", "draft"]),
    "lightcuts as Draft": ("radiance", ["-i", "lightcuts", "--vpls", "10000", "-p", "error=0.05"]),
    "Good in 4 passes": ("denoised", ["--preset", "good", "--passes", "4"]),
    "Good": ("denoised", ["--preset", "good"]),
    "Final": ("denoised", ["--preset", "final"]),
    "Reference in 16 passes": ("radiance", ["--preset", "reference", "--passes", "16", "--no-denoise"]),
    "the same, denoised": ("denoised", ["--preset", "reference", "--passes", "16"]),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", help="scene and reference, in turns")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--lumicut", default=os.path.join(BENCH, "../build/release/bin/lumicut"))
    parser.add_argument("--size", default="120x90")
    options = parser.parse_args()
    os.makedirs(options.output, exist_ok=True)
    print("| scene | method | CPU s | RMSE | mean relative error | p99 | FLIP | dominated by |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for scene, reference in zip(options.scenes[::2], options.scenes[1::2]):
        rows = []
        for name, (layer, arguments) in METHODS.items():
            image = os.path.join(options.output, "image.exr")
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([options.lumicut, "render", scene, "-q", *arguments, "--size", options.size, "--threads", "1", "--seed", "3",
                            "--layers", layer, "-o", image], check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            rows.append((name, seconds, json.loads(subprocess.run(
                [options.lumicut, "compare", image, reference, "--layer", layer, "--reference-layer", "radiance", "--json"],
                check=True, capture_output=True).stdout)))
        for name, seconds, e in rows:
            by = [other for other, s, o in rows if other != name and s <= seconds and o["flip"] <= e["flip"]
                  and o["mean_relative_error"] <= e["mean_relative_error"]]
            print(f"| {os.path.splitext(os.path.basename(scene))[0]} | {name} | {seconds:.2f} | {100 * e['rmse']:.1f} % | "
                  f"{100 * e['mean_relative_error']:.1f} % | {100 * e['p99_relative_error']:.0f} % | {e['flip']:.3f} | {', '.join(by)} |",
                  flush=True)


if __name__ == "__main__":
    main()
