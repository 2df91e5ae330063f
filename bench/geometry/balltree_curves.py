#!/usr/bin/env python3
"""Omohundro's figures 7 to 22 as curves over the number of leaves: bench/geometry/balltree_curves.py [FOLDER], from the project's root.
Runs build/release/bin/bench_balltree curves (minutes; or --csv FILE of its output) and writes balltree_2d.svg, balltree_5d.svg and
balltree_10d.svg: left the volume of the trees, right the seconds of building them, a row for each of the paper's four data."""
import argparse
import csv
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / "bench"), str(ROOT / "export_scripts/scenes")]
import loglog_plot  # noqa: E402
import whole_file  # noqa: E402

NAMES = {"uniform": "uniform points", "cantor": "Cantor's points", "curve": "points on a curve", "balls": "uniform balls"}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", default=ROOT / "docs/images/geometry", type=pathlib.Path)
    parser.add_argument("--csv", type=pathlib.Path, help="what bench_balltree curves printed before")
    parser.add_argument("--smoke", action="store_true", help="a second's worth, to see that it runs")
    arguments = parser.parse_args()
    if arguments.csv:
        text = arguments.csv.read_text()
    else:
        command = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release")) / "bin/bench_balltree"
        environment = os.environ | ({"LUMICUT_BENCH_SMOKE": "1"} if arguments.smoke else {})
        text = subprocess.run([command, "curves"], check=True, stdout=subprocess.PIPE, text=True, env=environment).stdout
    rows = list(csv.DictReader(text.splitlines()))
    width, height = loglog_plot.WIDTH, loglog_plot.HEIGHT
    for dimension in ("2", "5", "10"):
        out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * width} {len(NAMES) * height}">']
        for j, kind in enumerate(NAMES):
            for i, (column, label) in enumerate((("volume", "sum of radius^d"), ("seconds", "s"))):
                series = {}
                for row in rows:
                    if (row["dimension"], row["data"]) == (dimension, kind):
                        series.setdefault(row["builder"], []).append((float(row["leaves"]), max(float(row[column]), 1e-9)))
                with tempfile.TemporaryDirectory() as folder:
                    file = pathlib.Path(folder) / "plot.svg"
                    loglog_plot.write(file, f"{NAMES[kind]}, {dimension} dimensions: {column}", "leaves", label, list(series.items()), percent=False)
                    plot = file.read_text()
                out.append(plot.replace("<svg ", f'<svg x="{i * width}" y="{j * height}" width="{width}" height="{height}" ', 1))
        arguments.folder.mkdir(parents=True, exist_ok=True)
        whole_file.write(arguments.folder / f"balltree_{dimension}d.svg", "\n".join(out) + "\n</svg>\n")


if __name__ == "__main__":
    main()
