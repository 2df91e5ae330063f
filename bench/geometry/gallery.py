#!/usr/bin/env python3
"""The pictures of docs/geometry_gallery.md, by lumicut-geometry: bench/geometry/gallery.py [FOLDER], from the project's root.
Needs build/release/bin/lumicut-geometry; the running horse needs LUMICUT_SCENES (../shared/scenes), else it is left out."""
import argparse
import math
import os
import pathlib
import random
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def cantor(rng):
    """A number of Cantor's set."""
    return sum(2 * rng.randrange(2) * 3.0 ** -k for k in range(1, 12))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", default=ROOT / "docs/images/geometry", type=pathlib.Path)
    parser.add_argument("--smoke", action="store_true", help="a second's worth, to see that it runs")
    arguments = parser.parse_args()
    out, rng = arguments.folder, random.Random(5)
    count = 60 if arguments.smoke else 1
    command = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release")) / "bin/lumicut-geometry"
    scenes = pathlib.Path(os.environ.get("LUMICUT_SCENES", ROOT.parent / "shared/scenes"))

    def run(*words):
        subprocess.run([command, *map(str, words)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    with tempfile.TemporaryDirectory() as folder:
        def write(name, rows):
            path = pathlib.Path(folder) / name
            path.write_text("".join(",".join(map(repr, row)) + "\n" for row in rows))
            return path

        points = write("cantor.csv", [(cantor(rng), cantor(rng)) for _ in range(101)])
        for builder in ("kd", "top-down", "insertion", "cheap-insertion", "bottom-up"):
            run("balltree", points, "--builder", builder, "--picture", out / f"balltree_{builder}.png", "--size", 240)
        cities = [(rng.gauss(x, 0.06), rng.gauss(y, 0.06)) for x, y in [(rng.random(), rng.random()) for _ in range(9)] for _ in range(150 // count + 1)]
        instance = write("cities.csv", cities)
        disks = write("disks.csv", [(*rng.choice(cities), rng.uniform(0.02, 0.1)) for _ in range(250 // count + 1)])
        run("hitting-set", "--points", instance, "--disks", disks, "--picture", out / "hitting_set.png", "--size", 480, "--out", pathlib.Path(folder) / "h.csv")
        if "without CGAL" not in subprocess.run([command, "net", "--points", instance], capture_output=True, text=True, check=False).stderr:
            run("net", "--points", instance, "--epsilon", 0.02, "--picture", out / "epsilon_net.png", "--size", 480, "--out", pathlib.Path(folder) / "n.csv")
        spiral = write("spiral.csv", [((4 + 0.05 * t) * math.cos(0.11 * t), (2 + 0.04 * t) * math.sin(0.11 * t)) for t in range(500)])
        run("hull", spiral, "--window", 220, "--summary", "--picture", out / "hull.png", "--size", 480)
        tight, tight_disks, start = (pathlib.Path(folder) / name for name in ("tight.csv", "tight_disks.csv", "tight_start.csv"))
        run("instance", "tight", "--side", 5, "--points", tight, "--disks", tight_disks, "--start", start)
        for k in (3, 4):
            run("hitting-set", "--points", tight, "--disks", tight_disks, "--method", "local", "--start", start, "--exchange", k,
                "--picture", out / f"tight_{k}.png", "--size", 480, "--out", pathlib.Path(folder) / "h.csv")
        run("independent-set", "--disks", disks, "--picture", out / "independent_set.png", "--size", 480, "--out", pathlib.Path(folder) / "i.csv")
        horse = scenes / "horse/horse.obj"
        if horse.exists() and not arguments.smoke:
            run("recluster", horse, "--z-up", "--frames", 6, "--amount", 0.16, "--reach", 0.35, "--clusters", 128, "--width", 320, "--height", 320, "--out", folder)
            run("recluster", horse, "--frames", 1, "--clusters", 96, "--no-pictures", "--height", 480, "--atlas-picture", out / "atlas.png", "--out", folder + "/atlas")
            for i, frame in enumerate((0, 1, 3)):
                (out / f"clusters_{i}.png").write_bytes((pathlib.Path(folder) / f"frame_000{frame}.png").read_bytes())
        elif not arguments.smoke:
            print(f"gallery: {horse} is not there: no face clusters")


if __name__ == "__main__":
    main()
