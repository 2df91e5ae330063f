"""How long Blender's interface waits: collecting a million triangles and 500 instances, writing a full-HD pass.

    blender -b --factory-startup --addons lumicut_blender -P bench/blender_collect.py
"""
import os
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests/blender"))
os.environ.setdefault("LUMICUT_SOURCE_DIR", str(pathlib.Path(__file__).resolve().parents[1]))
import bpy  # noqa: E402
import numpy as np  # noqa: E402

import helpers as h  # noqa: E402
from lumicut_blender import collect, passes  # noqa: E402


def best(fn, count=5):
    """(wall, CPU) seconds of the fastest of several."""
    times = []
    for _ in range(count):
        wall, cpu = time.perf_counter(), time.process_time()
        fn()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return min(times)


def million(objects=128, side=64, kind="smooth"):
    """Grids of side x side quads: objects · side² · 2 triangles, each mesh its own."""
    h.new_scene()
    u = np.arange(side + 1) / side
    x, y = np.meshgrid(u, u)
    index = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    faces = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1).reshape(-1, 4).tolist()
    image = bpy.data.images.new("picture", 64, 64)
    plain, textured = h.diffuse(name="plain"), h.material("textured")
    node = h.shader(textured, "ShaderNodeBsdfDiffuse")
    texture = textured.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    textured.node_tree.links.new(texture.outputs[0], node.inputs["Color"])
    for i in range(objects):
        z = 0.05 * np.sin(9 * x + i) * np.cos(7 * y)
        v = np.stack([x, y, z], -1).reshape(-1, 3).tolist()
        with_uv = kind == "textured, several materials, half smooth"
        ob = h.add_mesh(f"grid {i}", v, faces, textured if with_uv else plain, smooth=kind != "flat")
        ob.location = (i % 12, i // 12, 0)
        if with_uv:
            ob.data.uv_layers.new(name="Map")
            ob.data.materials.append(plain)
            half = np.arange(len(faces)) % 2
            ob.data.polygons.foreach_set("material_index", half.astype(np.int32))
            ob.data.polygons.foreach_set("use_smooth", half.astype(bool))
    ball = h.add_sphere(0.1, segments=16, name="ball")
    for i in range(499):
        copy = h.link(bpy.data.objects.new("copy", ball.data))
        copy.location = (i % 25, i // 25, 1)
    return bpy.context.evaluated_depsgraph_get()


def main():
    for kind in ("flat", "smooth", "textured, several materials, half smooth"):
        graph = million(kind=kind)
        data = collect.Collector(graph).collect()
        wall, cpu = best(lambda: collect.Collector(graph).collect())
        unique = sum(len(m.indices) for m in data.meshes)
        print(f"collecting, {kind}: {unique:,} triangles in {len(data.meshes)} meshes, "
              f"{sum(len(m.transforms) for m in data.meshes)} instances: {wall:.3f} s, {cpu:.3f} CPU s", flush=True)
    scene = h.new_scene(1920, 1080)
    pixels = np.random.default_rng(1).random((1080, 1920, 4), np.float32)
    found = {}

    class Probe(bpy.types.RenderEngine):
        bl_idname, bl_label = "LUMICUT_PROBE", "Probe"

        def render(self, depsgraph):
            result = self.begin_result(0, 0, 1920, 1080)
            target = result.layers[0].passes["Combined"]
            found["times"] = best(lambda: passes.write_pass(target, pixels))
            self.end_result(result)

    bpy.utils.register_class(Probe)
    scene.render.engine = "LUMICUT_PROBE"
    with h.quiet():
        bpy.ops.render.render()
    bpy.utils.unregister_class(Probe)
    print(f"writing a full-HD pass of four channels: {found['times'][0]:.4f} s, {found['times'][1]:.4f} CPU s")


main()
