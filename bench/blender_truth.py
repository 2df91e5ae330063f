"""Does the path tracer agree with Cycles? Mean radiance in each sixteenth of a Blender scene's image.

    blender -b kitchen.blend --addons cycles,lumicut_blender -P bench/blender_truth.py -- --folder kitchen --parts 4 --samples 512

Cycles' parts are kept in the folder, as is Lumicut's image. Differences are shares of the image's mean; `noise` is their
standard error, from how parts differ.
"""
import argparse
import pathlib
import sys

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent)]
import bpy  # noqa: E402
import numpy as np  # noqa: E402

from blender_reference import Reference, h, measured, render_parts  # noqa: E402

CELLS = 4


def cells(image):
    height, width = image.shape[:2]
    return np.array([[image[i * height // CELLS:(i + 1) * height // CELLS, j * width // CELLS:(j + 1) * width // CELLS].mean()
                      for j in range(CELLS)] for i in range(CELLS)])


def standard_error(parts):
    return np.std([cells(p) for p in parts], axis=0, ddof=1) / np.sqrt(len(parts))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--parts", type=int, default=4)
    parser.add_argument("--samples", type=int, default=512, help="of Cycles, a part")
    parser.add_argument("--paths", type=int, default=16, help="of Lumicut, a camera sample")
    parser.add_argument("--camera-samples", type=int, default=32, help="of Lumicut, a part")
    parser.add_argument("--size", type=int, nargs=2, default=(160, 120))
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    options.folder.mkdir(exist_ok=True)
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = options.size
    render_parts(options.folder, options.parts, options.samples)

    def path_traced(part):
        h.set_lumicut("path_tracer", options.camera_samples, compensate=0, seed=1 + part)
        bpy.context.scene.lumicut.path_tracer.samples = options.paths

    ours = []
    for part in range(options.parts):
        image, cpu, _ = measured(lambda: path_traced(part))
        ours.append(image)
        print(f"Lumicut, part {part}: {cpu:.0f} CPU s", flush=True)
    np.savez_compressed(options.folder / "lumicut.npz", image=np.mean(ours, 0))  # the .npy files are Cycles' parts
    reference = Reference(options.folder)
    mean = reference.image.mean()
    off = (cells(np.mean(ours, 0)) - cells(reference.image)) / mean
    noise = np.hypot(standard_error(ours), standard_error(reference.parts)) / mean
    print("Lumicut less Cycles, and the noise of that, in % of the mean:")
    for row, of_row in zip(off, noise):
        print("  " + "  ".join(f"{100 * x:+6.2f} ± {100 * n:.2f}" for x, n in zip(row, of_row)))
    print(f"mean {100 * (np.mean(ours) / mean - 1):+.2f} %, largest {100 * np.abs(off).max():.2f} %, noise at most {100 * noise.max():.2f} %")


if __name__ == "__main__":
    main()
