#!/usr/bin/env python3
"""What importance saves: CPU time at equal error with and without, in the office building and in one room.

    bench/importance.py -o FOLDER [--lumicut build/release/bin/lumicut] [--passes 8 32] [SCENE ...]

Without scenes it makes the building of 40 rooms, the same with point lamps, and one room of it (bench/office.py). Times are CPU seconds of the whole
process with one thread, errors RMSE over the mean against many compensated passes of another seed (made once and kept in
the folder). The last column is what the same error costs without, over what it costs with importance: errors fall with
the root of passes, so that each table row stands for RMSE² times seconds.
"""
import argparse
import json
import os
import resource
import subprocess
import sys

BENCH = os.path.dirname(os.path.abspath(__file__))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--lumicut", default=os.path.join(BENCH, "../build/release/bin/lumicut"))
    parser.add_argument("--size", default="120x90")
    parser.add_argument("--passes", type=int, nargs="+", default=[8, 32])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--reference-passes", type=int, default=400)
    parser.add_argument("--vpls", type=int, default=3000)
    options = parser.parse_args()
    os.makedirs(options.output, exist_ok=True)

    def render(scene, name, *arguments):
        image = os.path.join(options.output, name)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([options.lumicut, "render", scene, "-q", "-i", "lightcuts", "-p", "compensate=true", "-p", "error=0.05",
                        "--size", options.size, "--threads", "1", "-o", image, *arguments], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return image, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    if not options.scenes:
        for name, arguments in (("office", []), ("point_lamps", ["--lamps", "point"]), ("room", ["--rows", "1", "--columns", "1"])):
            scene = os.path.join(options.output, name + ".json")
            subprocess.run([sys.executable, os.path.join(BENCH, "office.py"), *arguments, "-o", scene], check=True)
            options.scenes.append(scene)
    print("| scene | passes | importance | CPU s | RMSE | mean relative error | bias | seconds at equal RMSE, without : with |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for scene in options.scenes:
        name = os.path.splitext(os.path.basename(scene))[0]
        reference = os.path.join(options.output, name + ".reference.exr")
        if not os.path.exists(reference):
            render(scene, name + ".reference.exr", "-p", "importance=true", "--vpls", "4000", "--passes",
                   str(options.reference_passes), "--seed", "77777")
        for passes in options.passes:
            cost = {}
            for importance in ("false", "true"):
                seconds, square, relative, bias = 0.0, 0.0, 0.0, 0.0
                for seed in options.seeds:
                    image, s = render(scene, f"{name}.{importance}.exr", "-p", f"importance={importance}", "--vpls",
                                      str(options.vpls), "--passes", str(passes), "--seed", str(seed))
                    compared = json.loads(subprocess.run([options.lumicut, "compare", image, reference, "--no-flip", "--json"],
                                                         check=True, capture_output=True).stdout)
                    n = len(options.seeds)
                    seconds, square = seconds + s / n, square + compared["rmse"] ** 2 / n
                    relative, bias = relative + compared["mean_relative_error"] / n, bias + compared["bias"] / n
                cost[importance] = square * seconds
                ratio = f"{cost['false'] / cost['true']:.2f}" if importance == "true" else ""
                print(f"| {name} | {passes} | {importance} | {seconds:.2f} | {100 * square ** 0.5:.1f} % | {100 * relative:.1f} % | "
                      f"{100 * bias:+.1f} % | {ratio} |", flush=True)


if __name__ == "__main__":
    main()
