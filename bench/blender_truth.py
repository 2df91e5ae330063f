"""Do the path tracer and compensated passes agree with Cycles? Mean radiance in each sixteenth of a Blender scene's image.

    blender -b kitchen.blend --addons cycles,lumicut_blender -P bench/blender_truth.py -- --folder kitchen --parts 4 --samples 512

Cycles' parts are kept in the folder, Lumicut's in folders of it: a longer run (more --parts) goes on from them. Give each version
of Blender a folder of its own. Differences are shares of the image's mean; `noise` is their standard error, from how parts differ.
"""
import argparse
import io
import pathlib
import sys

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent)]
import bpy  # noqa: E402
import numpy as np  # noqa: E402

from blender_reference import Reference, h, measured, render_parts, whole_file  # noqa: E402

CELLS = 4


def cells(image):
    height, width = image.shape[:2]
    return np.array([[image[i * height // CELLS:(i + 1) * height // CELLS, j * width // CELLS:(j + 1) * width // CELLS].mean()
                      for j in range(CELLS)] for i in range(CELLS)])


def standard_error(values):
    return np.std(values, axis=0, ddof=1) / np.sqrt(len(values))


def kept_parts(folder, name, parts, configure):
    """Lumicut's parts, each of a seed of its own; those that are in the folder are not rendered again."""
    folder.mkdir(exist_ok=True)
    images = []
    for part in range(parts):
        path = folder / f"{name}_{part:03}.npy"
        if not path.exists():
            image, cpu, _ = measured(lambda: configure(1 + part))
            stream = io.BytesIO()
            np.save(stream, image)
            whole_file.write(path, stream.getvalue())
            print(f"{folder.name}, part {part}: {cpu:.0f} CPU s", flush=True)
        images.append(np.load(path))
    return images


def print_difference(name, ours, theirs):
    mean = np.mean(theirs)
    off = (cells(np.mean(ours, 0)) - cells(np.mean(theirs, 0))) / mean
    noise = np.hypot(standard_error([cells(p) for p in ours]), standard_error([cells(p) for p in theirs])) / mean
    of_mean = np.hypot(standard_error([p.mean() for p in ours]), standard_error([p.mean() for p in theirs])) / mean
    print(f"{name} less Cycles (Blender {bpy.app.version_string}), and the noise of that, in % of the mean:")
    for row, of_row in zip(off, noise):
        print("  " + "  ".join(f"{100 * x:+6.2f} ± {100 * n:.2f}" for x, n in zip(row, of_row)))
    worst = np.unravel_index(np.abs(off).argmax(), off.shape)
    print(f"mean {100 * (np.mean(ours) / mean - 1):+.2f} ± {100 * of_mean:.2f} %, largest {100 * off[worst]:+.2f} ± {100 * noise[worst]:.2f} %, "
          f"noise at most {100 * noise.max():.2f} %", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--parts", type=int, default=4)
    parser.add_argument("--samples", type=int, default=512, help="of Cycles, a part")
    parser.add_argument("--paths", type=int, default=16, help="of Lumicut's path tracer, a camera sample")
    parser.add_argument("--camera-samples", type=int, default=32, help="of Lumicut's path tracer, a part")
    parser.add_argument("--passes", type=int, default=0, help="of Lumicut's lightcuts, compensated, 3,000 lights each, a part (0: none)")
    parser.add_argument("--size", type=int, nargs=2, default=(160, 120))
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    options.folder.mkdir(exist_ok=True)
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = options.size
    render_parts(options.folder, options.parts, options.samples)

    def path_traced(seed):
        h.set_lumicut("path_tracer", options.camera_samples, compensate=0, seed=seed)
        bpy.context.scene.lumicut.path_tracer.samples = options.paths

    def in_passes(seed):
        h.set_lumicut("lightcuts", 1, passes=options.passes, compensate=1, vpls=3000, error=0.05, seed=1000 * seed)

    theirs = Reference(options.folder).parts
    samples = options.camera_samples * options.paths
    print_difference("path_tracer", kept_parts(options.folder / "path_tracer", samples, options.parts, path_traced), theirs)
    if options.passes:
        print_difference("lightcuts", kept_parts(options.folder / "lightcuts", options.passes, options.parts, in_passes), theirs)


if __name__ == "__main__":
    main()
