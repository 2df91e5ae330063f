"""The indirectly lit room in Blender: Lumicut beside Cycles after the same CPU seconds, against long Cycles.

    blender -b room.blend --addons lumicut_blender -P bench/blender_room.py -- reference --folder room_reference --parts 4 --samples 1024
    blender -b room.blend --addons lumicut_blender -P bench/blender_room.py -- table --folder room_reference

`reference` renders Cycles without clamping, a part a seed, and keeps what was rendered before. `table` takes the mean of
the parts; `curve` measures both over time and draws them; `one` tries settings; `again` measures the images of both once more, against more parts; `bias` asks where the
missing energy went (means over the image: few samples do). room.blend comes from
export_scripts/scenes/blender_indirect_room.py. CPU seconds are the process' own.
"""
import argparse
import contextlib
import json
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
    5: [("lightcuts", 1, {"passes": 4, **PASS})],
    20: [("lightcuts", 1, {"passes": 18, **PASS})],
    60: [("lightcuts", 1, {"passes": 56, **PASS})],
}
CURVE = {"passes": (1, 2, 4, 8, 16, 32, 64), "samples": (2, 8, 32, 128, 512, 1600)}  # `curve`
CLAMPS = (0.03, 0.003)  # `bias`: what is lost as the clamp shrinks


def small(width):
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = width, width * 3 // 4


class Floor:
    """The floor's nodes: a share of gloss, which may be hidden from what lies one bounce from the camera."""

    def __init__(self):
        self.tree = bpy.data.materials["floor"].node_tree
        self.mix, self.coat = (next(n for n in self.tree.nodes if n.type == kind) for kind in ("MIX_SHADER", "BSDF_GLOSSY"))
        self.share = self.mix.inputs[0].default_value

    def set_gloss(self, on):
        self.mix.inputs[0].default_value = self.share if on else 0.0

    @contextlib.contextmanager
    def dark_at_the_first_bounce(self):
        """For Cycles: what the floor's gloss throws straight at a point that the camera sees is lost, all else is kept.

        This is what a virtual light without a lobe loses.
        """
        path, equal, less = (self.tree.nodes.new(kind) for kind in ("ShaderNodeLightPath", "ShaderNodeMath", "ShaderNodeMath"))
        equal.operation, less.operation = "COMPARE", "SUBTRACT"
        equal.inputs[1].default_value, equal.inputs[2].default_value, less.inputs[0].default_value = 1.0, 0.5, 1.0
        for a, b in ((path.outputs["Ray Depth"], equal.inputs[0]), (equal.outputs[0], less.inputs[1]),
                     (less.outputs[0], self.coat.inputs["Color"])):
            self.tree.links.new(a, b)
        yield
        for node in (path, equal, less):
            self.tree.nodes.remove(node)


def bias(options):
    """Means over the image, each with its standard error from independent parts (and kept in a file)."""
    store = options.folder / "bias.json"
    means = json.loads(store.read_text()) if store.exists() else {}
    floor = Floor()

    def mean(name, configure):
        found = means.setdefault(name, [])
        for part in range(len(found), options.parts):
            image, cpu, _ = measured(lambda: configure(part))
            found.append(float(image.mean()))
            store.write_text(json.dumps(means))
            print(f"{name}, part {part}: {found[-1]:.6f}, {cpu:.0f} CPU s", flush=True)
        found = np.array(found[:options.parts])
        return found.mean(), found.std(ddof=1) / np.sqrt(len(found))

    rows = {}
    for gloss in (True, False):
        floor.set_gloss(gloss)
        name = "gloss" if gloss else "no gloss"
        rows[name, "cycles"] = mean(f"{name}: Cycles", lambda part: cycles(options.samples, 500 + part))
        if gloss:
            with floor.dark_at_the_first_bounce():
                rows[name, "dark"] = mean(f"{name}: Cycles, dark at the first bounce", lambda part: cycles(options.samples, 900 + part))
        for clamp in CLAMPS:
            rows[name, clamp] = mean(f"{name}: Lumicut, clamp {clamp:g}", lambda part: h.set_lumicut(
                "stochastic_lightcuts", 2, vpls=100000, lights=48, clamp_relative=clamp, seed=1 + part))
    floor.set_gloss(True)
    print("| | floor with gloss | floor without |\n|---|---|---|")
    for key in ("dark", *CLAMPS):
        cells = []
        for name in ("gloss", "no gloss"):
            if (name, key) in rows:
                (a, da), (b, db) = rows[name, key], rows[name, "cycles"]
                cells.append(f"{100 * (a / b - 1):+.2f} ± {100 * np.hypot(da / b, a * db / b ** 2):.2f} %")
            else:
                cells.append("")
        label = "Cycles, the floor's gloss dark one bounce from the camera" if key == "dark" else f"Lumicut, clamp_relative={key:g}"
        print(f"| {label} | {' | '.join(cells)} |")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mode", choices=["reference", "table", "curve", "one", "again", "bias"])
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--parts", type=int, default=4)
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--lumicut", nargs="*", default=[], metavar="INTEGRATOR,SAMPLES,NAME=VALUE,...", help="one: settings to try")
    parser.add_argument("--budgets", type=int, nargs="*", default=list(SETTINGS), help="table: CPU seconds")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    small(options.width)
    options.folder.mkdir(exist_ok=True)
    if options.mode == "bias":
        bias(options)
        return
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
        settings = bpy.context.scene.lumicut
        for group in (settings.common, getattr(settings, integrator)):  # nothing stays from the row before
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
                                                                for n in CURVE["passes"]]),
                              ("Cycles", [path_traced(n, 0.0) for n in CURVE["samples"]])])
        return
    _, low, _ = measured(lambda: cycles(1))
    _, high, _ = measured(lambda: cycles(17))
    rate, fixed = (high - low) / 16, low - (high - low) / 16
    print(f"Cycles: {fixed:.2f} CPU s and {rate:.3f} a sample")
    for budget in options.budgets:
        spent = max(lumicut(*row)[0] for row in SETTINGS[budget])
        for clamp in (0.0, 10.0):
            path_traced(max(1, round((spent - fixed) / rate)), clamp)


main()
