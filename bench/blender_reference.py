"""What the benches in Blender share: long Cycles as the reference, its noise, and CPU seconds of a render."""
import io
import os
import pathlib
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests/blender"), str(ROOT / "export_scripts/scenes")]
os.environ.setdefault("LUMICUT_SOURCE_DIR", str(ROOT))
import bpy  # noqa: E402
import numpy as np  # noqa: E402

import helpers as h  # noqa: E402
import whole_file  # noqa: E402


def measured(configure):
    configure()
    before, wall = os.times(), time.perf_counter()
    with h.quiet():
        image = h.radiance(h.render())
    after = os.times()
    return image, after.user + after.system - before.user - before.system, time.perf_counter() - wall


class Reference:
    """The mean of independent parts. Its own noise, known from how they differ, is taken off the errors in quadrature."""

    def __init__(self, folder):
        self.folder = folder
        self.parts = [np.load(p) for p in sorted(folder.glob("*.npy"))]
        self.image = np.mean(self.parts, 0)

    def error(self, image, side=1):
        """(RMSE / mean, noise of the reference / mean) of blocks of pixels: in large ones noise averages out, bias stays."""
        a, b = h.blocks(image, side), h.blocks(self.image, side)
        noise2 = np.mean([((h.blocks(p, side) - b) ** 2).mean() for p in self.parts]) / max(1, len(self.parts) - 1)
        return float(np.sqrt(max(0.0, ((a - b) ** 2).mean() - noise2)) / b.mean()), float(np.sqrt(noise2) / b.mean())

    def row(self, name, image, cpu, keep=True):
        if keep:  # for `again`, with a longer reference
            (self.folder / "rows").mkdir(exist_ok=True)
            number = len(list((self.folder / "rows").glob("*.npz")))
            np.savez_compressed(self.folder / "rows" / f"{number:03}.npz", image=image.astype(np.float32), name=name, cpu=cpu)
        pixel, block = self.error(image)[0], self.error(image, 8)[0]
        print(f"| {name} | {cpu:.1f} | {100 * pixel:.1f} % | {100 * block:.1f} % | "
              f"{100 * (image.mean() / self.image.mean() - 1):+.1f} % |", flush=True)
        return pixel


def cycles(samples, seed=1, clamp=0.0, bounces=32):
    h.set_cycles(samples, bounces)
    bpy.context.scene.cycles.seed = seed
    bpy.context.scene.cycles.sample_clamp_indirect = clamp


def render_parts(folder, parts, samples):
    """Parts of the reference that are not there yet, each with a seed of its own."""
    for part in range(parts):
        path = folder / f"{samples}_{part}.npy"
        if path.exists():
            continue
        image, cpu, wall = measured(lambda: cycles(samples, 100 + part))
        stream = io.BytesIO()
        np.save(stream, image)
        whole_file.write(path, stream.getvalue())
        print(f"part {part}: {cpu:.0f} CPU s, {wall:.0f} s", flush=True)
