"""The indirectly lit room in Blender: Lumicut beside Cycles after the same CPU seconds, against long Cycles.

    blender -b room.blend --addons lumicut_blender -P bench/blender_room.py -- reference --folder room_reference --parts 4 --samples 1024
    blender -b room.blend --addons lumicut_blender -P bench/blender_room.py -- table --folder room_reference

`reference` renders Cycles without clamping, a part a seed, and keeps what was rendered before. `table` takes the mean of
the parts; `curve` measures both over time and draws them; `one` tries settings; `again` measures the images of both once more, against more parts. room.blend comes from
export_scripts/scenes/blender_indirect_room.py. CPU seconds are the process' own.
"""
import argparse
import pathlib
import sys

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent)]
import bpy  # noqa: E402
import numpy as np  # noqa: E402

from blender_reference import Reference, cycles, h, measured, render_parts  # noqa: E402
import loglog_plot  # noqa: E402

# What is tried for each budget at 320x240: passes grow with time.
PASS = {"vpls": 3000, "error": 0.05, "compensate": 1}
SETTINGS = {
    1: [("illumination_cut", 1, {"vpls": 1500, "error": 0.05, "compensate": 1})],
    5: [("lightcuts", 1, {"passes": 5, **PASS})],
    20: [("lightcuts", 1, {"passes": 23, **PASS})],
    60: [("lightcuts", 1, {"passes": 76, **PASS})],
}
CURVE = {"passes": (1, 2, 4, 8, 16, 32, 64), "samples": (2, 8, 32, 128, 512, 1600)}  # `curve`


def small(width):
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = width, width * 3 // 4


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mode", choices=["reference", "table", "curve", "one", "again"])
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--parts", type=int, default=4)
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--lumicut", nargs="*", default=[], metavar="INTEGRATOR,SAMPLES,NAME=VALUE,...", help="one: settings to try")
    parser.add_argument("--budgets", type=int, nargs="*", default=list(SETTINGS), help="table: CPU seconds")
    parser.add_argument("--smoke", action="store_true", help="the smallest of everything: to see that all of it runs")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    settings, curve = SETTINGS, CURVE
    if options.smoke:
        options.width, options.parts, options.samples, options.budgets = 16, 2, 1, [1]
        settings = {1: [("illumination_cut", 1, {"vpls": 50, "error": 0.5, "compensate": 1})]}
        curve = {"passes": (1, 2), "samples": (1, 2)}
    small(options.width)
    options.folder.mkdir(exist_ok=True)
    if options.mode == "reference":
        render_parts(options.folder, options.parts, options.samples)
        return
    reference = Reference(options.folder)
    _, noise = reference.error(reference.image)
    print(f"reference: {len(reference.parts)} parts, its own noise {100 * noise:.1f} % RMSE/mean")

    print("| | CPU s | RMSE/mean | of 8x8 blocks | mean |\n|---|---|---|---|---|")
    if options.mode == "again":
        for path in sorted((options.folder / "rows").glob("*.npz")):
            with np.load(path) as row:
                reference.row(str(row["name"]), row["image"].astype(np.float64), float(row["cpu"]), keep=False)
        return

    def lumicut(integrator, samples, values):
        of_scene = bpy.context.scene.lumicut
        for group in (of_scene.common, getattr(of_scene, integrator)):  # nothing stays from the row before
            for name in group.bl_rna.properties.keys():
                group.property_unset(name)
        image, cpu, wall = measured(lambda: h.set_lumicut(integrator, samples, **values))
        text = ", ".join(f"{k}={v:g}" for k, v in values.items())
        return cpu, reference.row(f"Lumicut `{integrator}`, {samples} spp, {text}", image, cpu)

    def path_traced(samples, clamp):
        image, cpu, _ = measured(lambda: cycles(samples, 1, clamp))
        return cpu, reference.row(f"Cycles, {samples} spp, {'clamp 10, as it comes' if clamp else 'no clamp'}", image, cpu)

    if options.mode == "one":
        for text in options.lumicut:
            integrator, samples, *pairs = text.split(",")
            values = {k: (int if k in {"vpls", "lights", "max_depth", "passes", "compensate", "seed"} else float)(v) for k, v in (p.split("=") for p in pairs)}
            lumicut(integrator, int(samples), values)
        return
    measured(lambda: cycles(1))  # loads and compiles what it needs
    if options.mode == "curve":
        loglog_plot.write(options.folder / "curve.svg", "The indirectly lit room at 320x240, against long Cycles", "CPU seconds",
                          "RMSE / mean", [
                              ("Lumicut, lightcuts in passes", [lumicut("lightcuts", 1, {"passes": n, **PASS})
                                                                for n in curve["passes"]]),
                              ("Cycles", [path_traced(n, 0.0) for n in curve["samples"]])])
        return
    _, low, _ = measured(lambda: cycles(1))
    _, high, _ = measured(lambda: cycles(17))
    rate = max((high - low) / 16, 1e-3)  # of tiny images both take no time at all
    fixed = low - rate
    print(f"Cycles: {fixed:.2f} CPU s and {rate:.3f} a sample")
    for budget in options.budgets:
        spent = max(lumicut(*row)[0] for row in settings[budget])
        for clamp in (0.0, 10.0):
            path_traced(max(1, round((spent - fixed) / rate)), clamp)


if __name__ == "__main__":
    main()
