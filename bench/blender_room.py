"""The indirectly lit room in Blender: Lumicut beside Cycles after the same CPU seconds, against long Cycles.

    blender -b room.blend --addons lumicut_blender -P bench/blender_room.py -- reference --folder room_reference --parts 4 --samples 1024
    blender -b room.blend --addons lumicut_blender -P bench/blender_room.py -- table --folder room_reference

`reference` renders Cycles without clamping, a part a seed, and keeps what was rendered before. `table` takes the mean of
the parts. room.blend comes from export_scripts/scenes/blender_indirect_room.py. CPU seconds are the process' own.
"""
import argparse
import os
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests/blender"))
os.environ.setdefault("LUMICUT_SOURCE_DIR", str(pathlib.Path(__file__).resolve().parents[1]))
import bpy  # noqa: E402
import numpy as np  # noqa: E402

import helpers as h  # noqa: E402

# What is tried for each budget: the clamp shrinks and lights grow with time.
SETTINGS = {
    1: [("stochastic_lightcuts", 1, {"vpls": 3000, "lights": 16})],
    5: [("illumination_cut", 4, {"vpls": 60000, "error": 0.03, "clamp_relative": 0.03})],
    20: [("illumination_cut", 8, {"vpls": 300000, "error": 0.015, "clamp_relative": 0.015})],
    60: [("illumination_cut", 16, {"vpls": 800000, "error": 0.01, "clamp_relative": 0.008})],
}


def measured(configure):
    configure()
    before, wall = os.times(), time.perf_counter()
    with h.quiet():
        image = h.radiance(h.render())
    after = os.times()
    return image, after.user + after.system - before.user - before.system, time.perf_counter() - wall


class Reference:
    """The mean of independent parts. Its own noise, known from how they differ, is taken off the errors in quadrature."""

    def __init__(self, parts):
        self.parts, self.image = parts, np.mean(parts, 0)

    def error(self, image, side=1):
        """(RMSE / mean, noise of the reference / mean) of blocks of pixels: in large ones noise averages out, bias stays."""
        a, b = h.blocks(image, side), h.blocks(self.image, side)
        noise2 = np.mean([((h.blocks(p, side) - b) ** 2).mean() for p in self.parts]) / max(1, len(self.parts) - 1)
        return float(np.sqrt(max(0.0, ((a - b) ** 2).mean() - noise2)) / b.mean()), float(np.sqrt(noise2) / b.mean())

    def row(self, name, image, cpu):
        pixel, block = self.error(image)[0], self.error(image, 8)[0]
        print(f"| {name} | {cpu:.1f} | {100 * pixel:.1f} % | {100 * block:.1f} % | "
              f"{100 * (image.mean() / self.image.mean() - 1):+.1f} % |", flush=True)


def cycles(samples, seed=1, clamp=0.0, bounces=32):
    h.set_cycles(samples, bounces)
    bpy.context.scene.cycles.seed = seed
    bpy.context.scene.cycles.sample_clamp_indirect = clamp


def small(width):
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = width, width * 3 // 4


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mode", choices=["reference", "table", "one"])
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--parts", type=int, default=4)
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--lumicut", default="", help="one: integrator,samples,name=value,...")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    small(options.width)
    options.folder.mkdir(exist_ok=True)
    if options.mode == "reference":
        for part in range(options.parts):
            path = options.folder / f"{options.samples}_{part}.npy"
            if path.exists():
                continue
            image, cpu, wall = measured(lambda: cycles(options.samples, 100 + part))
            np.save(path, image)
            print(f"part {part}: {cpu:.0f} CPU s, {wall:.0f} s", flush=True)
        return
    reference = Reference([np.load(p) for p in sorted(options.folder.glob("*.npy"))])
    _, noise = reference.error(reference.image)
    print(f"reference: {len(reference.parts)} parts, its own noise {100 * noise:.1f} % RMSE/mean")

    def lumicut(integrator, samples, values):
        image, cpu, wall = measured(lambda: h.set_lumicut(integrator, samples, **values))
        text = ", ".join(f"{k}={v:g}" for k, v in values.items())
        reference.row(f"Lumicut `{integrator}`, {samples} spp, {text}", image, cpu)
        return cpu

    if options.mode == "one":
        integrator, samples, *pairs = options.lumicut.split(",")
        values = {k: (int if k in {"vpls", "lights", "max_depth"} else float)(v) for k, v in (p.split("=") for p in pairs)}
        lumicut(integrator, int(samples), values)
        return
    measured(lambda: cycles(1))  # loads and compiles what it needs
    _, low, _ = measured(lambda: cycles(1))
    _, high, _ = measured(lambda: cycles(17))
    rate, fixed = (high - low) / 16, low - (high - low) / 16
    print(f"Cycles: {fixed:.2f} CPU s and {rate:.3f} a sample")
    print("| | CPU s | RMSE/mean | of 8x8 blocks | mean |\n|---|---|---|---|---|")
    for budget, rows in SETTINGS.items():
        spent = max(lumicut(*row) for row in rows)
        samples = max(1, round((spent - fixed) / rate))
        for clamp in (0.0, 10.0):
            image, cpu, _ = measured(lambda: cycles(samples, 1, clamp))
            reference.row(f"Cycles, {samples} spp, {'clamp 10, as it comes' if clamp else 'no clamp'}", image, cpu)


main()
