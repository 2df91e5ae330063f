#!/usr/bin/env python3
"""Does the progressive image converge to the path tracer's, and do its intervals hold? Tables and curves of docs/progressive.md.

    bench/progressive.py truth SCENE.json --folder out/cornell --size 96x72 --spp 64 --paths 32 --parts 8
    bench/progressive.py curve SCENE.json --folder out/cornell --size 96x72 --passes 1 4 16 64 256 1024 -- -p compensate=true --vpls 1000
    bench/progressive.py plot out/cornell out/kitchen --output curve.svg
    bench/progressive.py coverage SCENE.json --folder out/cornell --size 48x36 --passes 8 16 32 --seeds 6 -- -p compensate=true --vpls 300
    bench/progressive.py coverage SCENE.json --folder out/cornell --denoised --passes 16 -- -p compensate=true --vpls 3000

`truth` renders the path tracer in parts of their own seeds, and keeps what was rendered before: how the parts differ is the
noise of their mean, which is taken off errors in quadrature. `curve` goes on from one number of passes to the next by its
checkpoint. The truth that `coverage` compares with may be of so many times the size; `--denoised` looks at the filtered image and its
interval. What follows -- is given to `lumicut render`, with `truth` in place of the path tracer's options. Needs numpy and OpenImageIO's Python module (python3-openimageio).
"""
import argparse
import json
import pathlib
import subprocess
import sys

import numpy as np
import OpenImageIO as oiio

import loglog_plot

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "export_scripts/scenes"))
import whole_file  # noqa: E402

CELLS = 4  # a side: sixteen parts


def render(options, output, *arguments):
    command = [str(options.command), "render", str(options.scene), "--size", options.size, "-q", "-o", str(output), *map(str, arguments)]
    if subprocess.run(command).returncode != 0:
        sys.exit(f"failed: {' '.join(command)}")


def load(path, layer="radiance"):
    """Rows x columns of RGB, or of the layer's only component."""
    buffer = oiio.ImageBuf(str(path))
    names = list(buffer.spec().channelnames)
    pixels = buffer.get_pixels(oiio.FLOAT).astype(np.float64)
    if f"{layer}.V" in names:
        return pixels[..., names.index(f"{layer}.V")]
    return pixels[..., [names.index(c if layer == "radiance" else f"{layer}.{c}") for c in "RGB"]]


def cells(image):
    h, w = image.shape[:2]
    return np.array([[image[i * h // CELLS:(i + 1) * h // CELLS, j * w // CELLS:(j + 1) * w // CELLS].mean()
                      for j in range(CELLS)] for i in range(CELLS)])


class Truth:
    def __init__(self, folder):
        self.parts = [load(p) for p in sorted(folder.glob("truth.*.exr"))]
        if len(self.parts) < 2:
            sys.exit(f"{folder}: fewer than two parts of the truth; make them with `truth`")
        self.image = np.mean(self.parts, 0)
        n = len(self.parts)
        self.noise2 = sum(((p - self.image) ** 2).mean() for p in self.parts) / (n * (n - 1))
        self.cell_noise = np.sqrt(sum((cells(p) - cells(self.image)) ** 2 for p in self.parts) / (n * (n - 1)))

    def row(self, image):
        """RMSE, mean and the worst part's mean, as shares of the truth's mean."""
        mean = self.image.mean()
        rmse = np.sqrt(max(0.0, ((image - self.image) ** 2).mean() - self.noise2)) / mean
        return rmse, image.mean() / mean - 1, np.abs(cells(image) - cells(self.image)).max() / mean


def truth(options):
    for part in range(options.parts):
        path = options.folder / f"truth.{part:02}.exr"
        if not path.exists():
            of = options.arguments or ["-i", "path_tracer", "-p", f"samples={options.paths}", "--spp", options.spp]
            render(options, path, *of, "--seed", 1000 + part, "--layers", "radiance")
    t = Truth(options.folder)
    mean = t.image.mean()
    print(f"{len(t.parts)} parts; noise of the mean {100 * np.sqrt(t.noise2) / mean:.2f} % a pixel, "
          f"at most {100 * t.cell_noise.max() / mean:.2f} % in a sixteenth")


def curve(options):
    t = Truth(options.folder)
    checkpoint = options.folder / f"{options.name}.checkpoint"
    checkpoint.unlink(missing_ok=True)
    points = []
    print("| passes | RMSE / mean | mean | worst of 16 parts |\n|---|---|---|---|")
    for passes in options.passes:
        path = options.folder / f"{options.name}.{passes:05}.exr"
        render(options, path, *options.arguments, "--passes", passes, "--checkpoint", checkpoint, "--resume", "--layers", "radiance,error",
               "--png", path.with_suffix(".png"))
        rmse, mean, worst = t.row(load(path))
        points.append((passes, rmse))
        print(f"| {passes} | {100 * rmse:.1f} % | {100 * mean:+.2f} % | {100 * worst:.1f} % |", flush=True)
    whole_file.write(options.folder / f"{options.name}.curve.json", json.dumps(points))


def plot(options):
    series = []
    for folder in options.folders:
        for path in sorted(folder.glob("*.curve.json")):
            series.append((f"{folder.name}, {path.name.split('.')[0]}", json.loads(path.read_text())))
    loglog_plot.write(options.output, "Error of the mean of passes against the path tracer", "passes", "RMSE / mean", series, slope=-0.5)


def coverage(options):
    weights = [0.2126, 0.7152, 0.0722]
    luminance = Truth(options.folder).image @ weights
    layers = ("denoised", "denoised_error") if options.denoised else ("radiance", "error")
    print("| passes | within their interval | least and largest of the seeds | RMSE / mean | mean |\n|---|---|---|---|---|")
    for passes in options.passes:
        shares, errors, means = [], [], []
        for seed in range(1, options.seeds + 1):
            path = options.folder / f"{options.name}.{passes}.seed{seed}.exr"
            render(options, path, *options.arguments, "--passes", passes, "--seed", seed, "--layers", ",".join(dict.fromkeys(("radiance", *layers))),
                   "--denoise" if options.denoised else "--no-denoise")
            image = load(path, layers[0]) @ weights
            side = luminance.shape[0] // image.shape[0]  # of the truth's pixels in one of these
            off = np.abs(image - luminance.reshape(image.shape[0], side, image.shape[1], side).mean((1, 3)))
            shares.append((off <= load(path, layers[1])).mean())
            errors.append(np.sqrt((off ** 2).mean()) / luminance.mean())
            means.append(image.mean() / luminance.mean() - 1)
        print(f"| {passes} | {100 * np.mean(shares):.1f} % | {100 * min(shares):.1f}-{100 * max(shares):.1f} % | "
              f"{100 * np.mean(errors):.1f} % | {100 * np.mean(means):+.2f} % |", flush=True)


def main():
    arguments = sys.argv[1:]
    rest = arguments[arguments.index("--") + 1:] if "--" in arguments else []
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    modes = parser.add_subparsers(dest="mode", required=True)
    for name, run in (("truth", truth), ("curve", curve), ("coverage", coverage)):
        mode = modes.add_parser(name)
        mode.set_defaults(run=run)
        mode.add_argument("scene", type=pathlib.Path)
        mode.add_argument("--folder", type=pathlib.Path, required=True)
        mode.add_argument("--size", default="96x72")
        mode.add_argument("--command", type=pathlib.Path, default=ROOT / "build/release/bin/lumicut")
        if name == "truth":
            mode.add_argument("--parts", type=int, default=8)
            mode.add_argument("--spp", type=int, default=64)
            mode.add_argument("--paths", type=int, default=32, help="paths a sample")
        else:
            mode.add_argument("--passes", type=int, nargs="+", default=[1, 4, 16, 64, 256])
            mode.add_argument("--name", default="lightcuts", help="of the files, and of the curve")
        if name == "coverage":
            mode.add_argument("--seeds", type=int, default=6)
            mode.add_argument("--denoised", action="store_true", help="of the filtered image")
    mode = modes.add_parser("plot")
    mode.set_defaults(run=plot)
    mode.add_argument("folders", type=pathlib.Path, nargs="+")
    mode.add_argument("--output", type=pathlib.Path, required=True)
    options = parser.parse_args(arguments[:len(arguments) - len(rest) - ("--" in arguments)])
    options.arguments = rest
    if hasattr(options, "folder"):
        options.folder.mkdir(parents=True, exist_ok=True)
    options.run(options)


if __name__ == "__main__":
    main()
