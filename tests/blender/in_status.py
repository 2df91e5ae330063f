"""The tables docs/blender_nodes.md and docs/blender_nodes_4.3.md: what becomes of each of Blender's shader nodes and features, made from renders.

Nodes: each output is shown as emission on a square of its own, by Cycles and by us, at the centres of pixels. Shaders: each
on a ball. Features: the same small scene with and without; a picture that does not change, and no note that says so, would
be silence. Run with LUMICUT_UPDATE_DOCS=1 to write the page.
"""
import math
import os
import unittest

import bpy
import numpy as np

import helpers as h
from lumicut_blender import report, runtime

PAGES = {(3, 4): "blender_nodes.md", (4, 3): "blender_nodes_4.3.md"}  # one for each Blender that this is tested with
SIDE = 10  # pixels of a square
APART, MOST = 2e-3, 0.15  # of max(1, value); share of places, next to borders of patterns
NOT_IN_CYCLES = {"EEVEE_SPECULAR": "EEVEE alone", "SHADERTORGB": "EEVEE alone", "OUTPUT_LINESTYLE": "Freestyle alone", "UVALONGSTROKE": "Freestyle alone"}
# Outputs that differ without a note, and why.
KNOWN = {
    "Wavelength": "a published fit, a few percent apart",
    "Particle Info: Random": "of particles; elsewhere the object's",
}


def shader_nodes():
    """Classes of shader nodes, by their labels. (Blender 4 makes classes as they are asked for.)"""
    found = [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("ShaderNode")]
    return sorted((cls for cls in found if issubclass(cls, bpy.types.ShaderNode) and cls is not bpy.types.ShaderNode), key=lambda cls: cls.bl_rna.name)


def of_notes(owner):
    """(severity, text) of the notes that name this owner, worst first."""
    return [(severity, text) for severity, text, names in runtime.last["entries"]
            if any(name == owner or name.startswith((owner + " (", owner + ":")) for name in names)]


def status(notes, differs=False, known=None, exact="exact"):
    """A cell of the table, or None where something is wrong and nothing says so."""
    if notes:
        severity, first = notes[0]
        kind = "constant" if "constant" in first else "left out" if "left out" in first else \
            "approximated" if severity != report.WRONG else "warned of"
        texts = "; ".join(text for _, text in notes)
        return f"{kind}, by name: {texts}" if severity != report.NUANCE else f"nuance: {texts}"
    if differs:
        return f"approximated: {known}" if known else None
    return exact


class Page(unittest.TestCase):
    """Tests run in the order of their names: the last writes the page or compares it."""
    rows = {}

    def setUp(self):
        self.scene = h.new_scene()
        self.silent = []

    def tearDown(self):
        self.assertEqual(self.silent, [])

    def keep(self, table, rows):
        self.silent += [row[0] for row in rows if row[-1] is None]
        Page.rows[table] = rows

    # ---- Nodes that give values ---------------------------------------------------------------------------------------

    def fill(self, node, m):
        """Something that varies into the inputs that matter."""
        nodes, links = m.node_tree.nodes, m.node_tree.links
        coordinates = nodes.new("ShaderNodeTexCoord")
        snap = nodes.new("ShaderNodeVectorMath")  # steps, as the engines' samples lie a hair's breadth apart
        snap.operation = "SNAP"
        snap.inputs[1].default_value = (0.131, 0.137, 0.113)
        links.new(coordinates.outputs["UV"], snap.inputs[0])
        lifted = nodes.new("ShaderNodeVectorMath")
        lifted.inputs[1].default_value = (0.013, 0.027, 0.231)
        links.new(snap.outputs[0], lifted.inputs[0])
        parts = nodes.new("ShaderNodeSeparateXYZ")
        links.new(lifted.outputs[0], parts.inputs[0])
        number = {"ShaderNodeBlackbody": (3000, 2000), "ShaderNodeWavelength": (450, 200)}.get(node.bl_idname)
        scaled = parts.outputs["X"]
        if number:
            math_node = nodes.new("ShaderNodeMath")
            math_node.operation = "MULTIPLY_ADD"
            math_node.inputs[1].default_value, math_node.inputs[2].default_value = number[1], number[0]
            links.new(scaled, math_node.inputs[0])
            scaled = math_node.outputs[0]
        if node.type in {"BUMP", "NORMAL_MAP", "DISPLACEMENT", "VECTOR_DISPLACEMENT", "FRESNEL", "LAYER_WEIGHT"}:
            return
        filled = False
        for socket in node.inputs:
            if not socket.enabled or socket.name in {"Normal", "Tangent", "Location", "Rotation", "Scale", "Center", "Axis"}:
                continue
            if socket.type == "VECTOR":
                links.new(lifted.outputs[0], socket)
                filled = True
            elif socket.type == "RGBA" and "TEX" not in node.type:
                links.new(lifted.outputs[0], socket)
                filled = True
            elif socket.type == "VALUE" and not filled and "TEX" not in node.type:
                links.new(scaled, socket)
                filled = True

    def test_1_every_node_that_gives_a_value(self):
        image = bpy.data.images.new("picture", 8, 8, float_buffer=True)
        image.pixels.foreach_set(np.random.default_rng(1).random(256).astype(np.float32))
        image.pack()
        cases = []
        for cls in shader_nodes():
            m = h.material("probe")
            try:
                probe = m.node_tree.nodes.new(cls.__name__)
            except RuntimeError:
                continue  # groups, which need a tree
            outputs = [(i, s.name) for i, s in enumerate(probe.outputs) if s.enabled and s.type in {"VALUE", "RGBA", "VECTOR"}]
            if probe.type not in NOT_IN_CYCLES:
                cases += [(cls.__name__, probe.bl_label, probe.type, i, name) for i, name in outputs]
            bpy.data.materials.remove(m)
        columns = math.ceil(math.sqrt(len(cases)))
        camera = self.scene.camera
        camera.data.type, camera.data.ortho_scale = "ORTHO", columns
        camera.location = (columns / 2, columns / 2, 5)
        self.scene.render.resolution_x = self.scene.render.resolution_y = columns * SIDE
        for k, (kind, _, node_type, i, _) in enumerate(cases):
            m = h.material(f"case {k:03}")
            nodes, links = m.node_tree.nodes, m.node_tree.links
            node = nodes.new(kind)
            if node_type in {"TEX_IMAGE", "TEX_ENVIRONMENT"}:
                node.image = image
            if node_type == "VERTEX_COLOR":
                node.layer_name = "Col"
            if node_type == "ATTRIBUTE":
                node.attribute_name = "Col"
            if node_type == "UVMAP":
                node.uv_map = "UVMap"
            self.fill(node, m)
            visible = nodes.new("ShaderNodeVectorMath")  # negative values show too
            visible.operation = "MULTIPLY_ADD"
            visible.inputs[1].default_value, visible.inputs[2].default_value = (0.125,) * 3, (2,) * 3
            links.new(node.outputs[i], visible.inputs[0])
            emission = h.shader(m, "ShaderNodeEmission")
            links.new(visible.outputs[0], emission.inputs["Color"])
            ob = h.add_plane(1.0, material=m, name=f"square {k:03}")
            ob.location = (k % columns + 0.5, k // columns + 0.5, 0)
            ob.rotation_euler = (0.2, -0.15, 0.1)
            ob.pass_index, ob.color = k % 5, (0.2, 0.5, 0.7, 1)
            mesh = ob.data
            mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
            colours = mesh.color_attributes.new("Col", "FLOAT_COLOR", "POINT")
            colours.data.foreach_set("color", [0.1, 0.2, 0.3, 1, 0.9, 0.3, 0.3, 1, 0.8, 0.9, 0.1, 0.5, 0.2, 0.8, 0.4, 1])
        with h.quiet():
            h.set_lumicut("exhaustive", samples=1, vpls=10)
            ours = h.radiance(h.render())
            entries = runtime.last["entries"]
            h.set_cycles(1, 0)
            self.scene.cycles.pixel_filter_type, self.scene.cycles.filter_width = "BOX", 0.01
            theirs = h.radiance(h.render())
        runtime.last["entries"] = entries
        rows = {}
        for k, (kind, label, _, _, name) in enumerate(cases):
            x, y = k % columns * SIDE + 2, (columns - 1 - k // columns) * SIDE + 2
            a, b = ((image[y:y + SIDE - 4, x:x + SIDE - 4] - 2) * 8 for image in (ours, theirs))
            apart = (np.abs(a - b) / np.maximum(1, np.abs(b))).max(-1) > APART
            cell = status(of_notes(f"case {k:03}"), apart.mean() > MOST, KNOWN.get(label) or KNOWN.get(f"{label}: {name}"))
            if cell is None:
                print(f"status: {label}: {name} differs in {apart.mean():.2f} of places, means {a.mean((0, 1))} {b.mean((0, 1))}", flush=True)
            rows.setdefault((label, cell), []).append(name)
        self.keep("values", [(f"{label}: {', '.join(names)}", "followed", cell) for (label, cell), names in rows.items()])

    # ---- Shaders ------------------------------------------------------------------------------------------------------

    def test_2_every_shader(self):
        kinds = shader_nodes()
        cases = []
        for cls in kinds:
            m = h.material("case")
            try:
                node = m.node_tree.nodes.new(cls.__name__)
            except RuntimeError:
                continue
            if any(s.type == "SHADER" for s in node.outputs) and node.type not in NOT_IN_CYCLES and node.type != "BACKGROUND":
                cases.append((m, node))
        columns = math.ceil(math.sqrt(len(cases)))
        camera = self.scene.camera
        camera.data.type, camera.data.ortho_scale = "ORTHO", columns
        camera.location = (columns / 2, columns / 2, 5)
        self.scene.render.resolution_x = self.scene.render.resolution_y = columns * 20
        h.set_world((0.4, 0.45, 0.5))
        h.add_light("SUN", energy=2.0, rotation=(0.5, 0.4, 0), angle=0.2)
        for k, (m, node) in enumerate(cases):
            m.name = f"case {k:03}"
            output = next(n for n in m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
            volume = "VOLUME" in node.type
            m.node_tree.links.new(node.outputs[0], output.inputs["Volume" if volume else "Surface"])
            if volume:
                glass = m.node_tree.nodes.new("ShaderNodeBsdfGlass")
                m.node_tree.links.new(glass.outputs[0], output.inputs["Surface"])
            for socket in (s for s in node.inputs if s.type == "SHADER"):
                below = m.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
                m.node_tree.links.new(below.outputs[0], socket)
            if "Color" in node.inputs:
                node.inputs["Color"].default_value = (0.7, 0.5, 0.3, 1)
            h.add_sphere(0.4, (k % columns + 0.5, k // columns + 0.5, 0), m, 32)
        with h.quiet():
            h.set_lumicut("lightcuts", 1, 32, vpls=2000, compensate=True)
            ours = h.radiance(h.render())
            entries = runtime.last["entries"]
            h.set_cycles(128, 8)
            self.scene.cycles.sample_clamp_indirect = 0
            theirs = h.radiance(h.render())
        runtime.last["entries"] = entries
        rows = []
        for k, (m, node) in enumerate(cases):
            x, y = k % columns * 20 + 5, (columns - 1 - k // columns) * 20 + 5
            a, b = (image[y:y + 10, x:x + 10].mean() for image in (ours, theirs))
            cell = status(of_notes(m.name), not abs(a / max(b, 1e-3) - 1) < 0.06 and max(a, b) > 0.01, KNOWN.get(node.bl_label), "followed")
            if cell is None:
                print(f"status: {node.bl_label} gives {a:.3f}, in Cycles {b:.3f}", flush=True)
            rows.append((node.bl_label, "followed", cell))
        self.keep("shaders", rows)

    # ---- Features -----------------------------------------------------------------------------------------------------

    def base(self):
        """A ground, a ball, a cube of two materials, a lamp and a world."""
        self.scene = scene = h.new_scene(24, 18)
        scene.camera.location, scene.camera.rotation_euler = (0, -6, 3), (1.15, 0, 0)
        h.set_world((0.3, 0.35, 0.4))
        ground = h.add_plane(8, -0.8, h.diffuse((0.6, 0.5, 0.4), "Earth"), "Ground")
        ball = h.add_sphere(0.8, (-0.9, 0, 0), h.diffuse((0.7, 0.2, 0.2), "Red"), 16, name="Ball")
        lamp = h.add_light("POINT", (2, -2, 3), 300, shadow_soft_size=0.3)
        lamp.name = lamp.data.name = "Lamp"
        return scene, ground, ball, lamp

    def picture(self):
        with h.quiet():
            passes = h.render()
        return {name: pixels.astype(np.float32) for name, pixels in passes.items()}

    def test_3_every_feature(self):
        rows, plain = [], None
        for area, name, cycles, before, change in FEATURES:
            self.base()
            with h.quiet():
                h.set_lumicut("exhaustive", 4, vpls=100)
            if before is not None:
                before(self)
                without = self.picture()
            else:
                without = plain = plain or self.picture()
            owner = change(self)
            bpy.context.view_layer.update()
            try:
                found = self.picture()
            except RuntimeError as error:
                rows.append((f"{area}: {name}", cycles, f"an error that says so: {str(error).strip().split('Lumicut: ')[-1]}"))
                continue
            same = found.keys() == without.keys() and all(np.array_equal(found[key], without[key]) for key in without)
            notes = [(severity, text) for severity, text, names in runtime.last["entries"]]
            cell = status(notes, same, KNOWN.get(f"{area}: {name.split(',')[0]}"), "followed")
            if cell is None:
                print(f"status: {area}: {name} ({owner}) changes nothing, and nothing says so", flush=True)
            rows.append((f"{area}: {name}", cycles, cell))
        self.keep("features", rows)

    def test_4_the_page_is_that_of_today(self):
        if len(Page.rows) < 3:
            self.skipTest("made from all tests of this file together")

        def table(head, rows):
            return "\n".join([f"| {head} | Cycles | Lumicut |", "|---|---|---|", *(f"| {a} | {b} | {c} |" for a, b, c in rows)])

        others = sorted((cls.bl_rna.name, NOT_IN_CYCLES[kind]) for cls in shader_nodes()
                        for kind in [getattr(self.probe(cls), "type", None)] if kind in NOT_IN_CYCLES)
        page = PAGES.get(bpy.app.version[:2])
        if page is None:
            self.skipTest(f"no page is kept of Blender {bpy.app.version_string}")
        rest = ", ".join(f"[Blender {'.'.join(map(str, version))}]({name})" for version, name in PAGES.items() if name != page)
        text = HEAD.format(version=bpy.app.version_string, others=rest) + "\n\n".join([
            "## Nodes that give values", table("node: outputs", Page.rows["values"]),
            "## Shaders", table("shader", Page.rows["shaders"] + [(name, f"not there ({what})", "not there") for name, what in others]),
            "## Features", table("feature", Page.rows["features"])]) + "\n"
        if os.environ.get("LUMICUT_UPDATE_DOCS"):
            (h.ROOT / "docs" / page).write_text(text)
        self.maxDiff = None
        self.assertEqual((h.ROOT / "docs" / page).read_text(), text, "run this with LUMICUT_UPDATE_DOCS=1")

    @staticmethod
    def probe(cls):
        try:
            return h.material("probe").node_tree.nodes.new(cls.__name__)
        except RuntimeError:
            return None


HEAD = """# Blender's nodes and features

Written by `tests/blender/in_status.py` from renders with Blender {version} and its Cycles, and compared with today's at each run of the tests; do not edit. Others: {others}.
What *Lumicut* says:

- **exact**: the output shown as emission agrees with Cycles' to 0.002 at the centres of pixels (but for borders of patterns). Random parameters of each node: `tests/blender/in_programs.py`.
- **followed**: shaders agree within 6 % in the mean on a ball in sun and sky. Features change the picture; how well they agree with Cycles is for [Blender](blender.md) and the tests named there to say.
- **approximated**, **constant**, **left out**, **by name**: the panel *Approximated* and the log list the material, object or lamp with this text.
- **nuance**: listed below *Approximated*; only a measurement tells.

"""


def feature(area, name, cycles="followed", before=None):
    """`before`: what the picture without the feature has already."""
    def keep(change):
        FEATURES.append((area, name, cycles, before, change))
        return change
    return keep


FEATURES = []


def ob(name):
    return bpy.data.objects[name]


def replaced(kind, data):
    """An object of another kind in the ball's place."""
    ob("Ball").hide_render = True
    other = h.link(bpy.data.objects.new(kind, data))
    other.location = (-0.9, 0, 0)
    return other


@feature("Objects", "curves with a bevel")
def _(test):
    data = bpy.data.curves.new("Curve", "CURVE")
    data.dimensions, data.bevel_depth = "3D", 0.2
    spline = data.splines.new("POLY")
    spline.points.add(1)
    spline.points[0].co, spline.points[1].co = (-1, 0, 0, 1), (1, 0, 0.5, 1)
    return replaced("Curve", data)


@feature("Objects", "text")
def _(test):
    data = bpy.data.curves.new("Text", "FONT")
    data.body, data.extrude = "Abc", 0.1
    return replaced("Text", data)


@feature("Objects", "metaballs")
def _(test):
    data = bpy.data.metaballs.new("Meta")
    data.elements.new()
    return replaced("Meta", data)


@feature("Objects", "volume objects")
def _(test):
    return replaced("Volume", bpy.data.volumes.new("Volume"))


if bpy.app.version < (4, 3, 0):  # since then Blender ends where it has no GPU to draw them with
    @feature("Objects", "grease pencil", "drawn by Blender")
    def _(test):
        return replaced("Strokes", bpy.data.grease_pencils.new("Strokes"))


@feature("Objects", "hair particles")
def _(test):
    ball = ob("Ball")
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = ball.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 50, 0.5
    settings.root_radius = 5
    return ball


@feature("Objects", "particles without an object", "points as halos are not rendered")
def _(test):
    ball = ob("Ball")
    ball.modifiers.new("Dust", "PARTICLE_SYSTEM")
    ball.particle_systems[0].settings.render_type = "HALO"
    bpy.context.scene.frame_set(50)
    return ball


@feature("Objects", "instances of a collection")
def _(test):
    collection = bpy.data.collections.new("Set")
    collection.objects.link(ob("Ball"))
    empty = h.link(bpy.data.objects.new("Instance", None))
    empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (2, 0, 0)
    return empty


@feature("Objects", "holdout")
def _(test):
    ob("Ball").is_holdout = True


@feature("Objects", "shadow catcher")
def _(test):
    ob("Ground").is_shadow_catcher = True


for ray in ("camera", "diffuse", "glossy", "transmission", "shadow"):
    @feature("Objects", f"ray visibility: {ray}")
    def _(test, ray=ray):
        m = h.material("Mirror")
        h.shader(m, "ShaderNodeBsdfGlass" if ray == "transmission" else "ShaderNodeBsdfGlossy", Roughness=0.0)
        ob("Ground").data.materials[0] = m if ray in {"glossy", "transmission"} else ob("Ground").data.materials[0]
        if ray in {"glossy", "transmission"}:
            h.add_plane(3, -1.2, h.emission(2), "Below")
            ob("Below").visible_transmission = ray != "transmission"
        setattr(ob("Ball"), "visible_" + ray, False)


@feature("Objects", "motion blur")
def _(test):
    bpy.context.scene.render.use_motion_blur = True


@feature("Lamps", "spot")
def _(test):
    ob("Lamp").data.type = "SPOT"
    ob("Lamp").rotation_euler = (0.6, 0, 0.7)


@feature("Lamps", "sun")
def _(test):
    ob("Lamp").data.type = "SUN"
    ob("Lamp").data.energy = 2


for shape in ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"):
    @feature("Lamps", f"area, {shape.lower()}")
    def _(test, shape=shape):
        ob("Lamp").data.type = "AREA"
        ob("Lamp").data.shape = shape
        ob("Lamp").rotation_euler = (0.6, 0, 0.7)


@feature("Lamps", "area with spread")
def _(test):
    ob("Lamp").data.type = "AREA"
    ob("Lamp").data.spread = 1.0


@feature("Lamps", "negative power")
def _(test):
    ob("Lamp").data.energy = -100


@feature("Lamps", "without shadow")
def _(test):
    ob("Lamp").data.use_shadow = False
    if hasattr(ob("Lamp").data, "cycles"):
        ob("Lamp").data.cycles.cast_shadow = False


@feature("Lamps", "Max Bounces")
def _(test):
    ob("Lamp").data.cycles.max_bounces = 0


@feature("Lamps", "portals", "guide samples, and give no light")
def _(test):
    ob("Lamp").data.type = "AREA"
    ob("Lamp").data.cycles.is_portal = True


for ray in ("diffuse", "glossy"):
    @feature("Lamps", f"ray visibility: {ray}")
    def _(test, ray=ray):
        h.shader(ob("Ground").data.materials[0], "ShaderNodeBsdfGlossy", Roughness=0.5)
        setattr(ob("Lamp"), "visible_" + ray, False)


@feature("Lamps", "ray visibility: camera, of area lamps")
def _(test):
    ob("Lamp").data.type = "AREA"
    ob("Lamp").visible_camera = True


@feature("Lamps", "nodes: strength and colour")
def _(test):
    data = ob("Lamp").data
    data.use_nodes = True
    next(n for n in data.node_tree.nodes if n.type == "EMISSION").inputs["Strength"].default_value = 2


@feature("Lamps", "nodes: Light Falloff")
def _(test):
    data = ob("Lamp").data
    data.use_nodes = True
    emission = next(n for n in data.node_tree.nodes if n.type == "EMISSION")
    data.node_tree.links.new(data.node_tree.nodes.new("ShaderNodeLightFalloff").outputs["Linear"], emission.inputs["Strength"])


@feature("Lamps", "nodes: a texture")
def _(test):
    data = ob("Lamp").data
    data.type, data.use_nodes = "AREA", True
    emission = next(n for n in data.node_tree.nodes if n.type == "EMISSION")
    data.node_tree.links.new(data.node_tree.nodes.new("ShaderNodeTexChecker").outputs["Color"], emission.inputs["Color"])


def world_nodes():
    tree = bpy.context.scene.world.node_tree
    return tree, next(n for n in tree.nodes if n.type == "BACKGROUND"), next(n for n in tree.nodes if n.type == "OUTPUT_WORLD")


@feature("Worlds", "colour and strength")
def _(test):
    h.set_world((0.5, 0.2, 0.1), 0.5)


@feature("Worlds", "Environment Texture")
def _(test):
    tree, background, _ = world_nodes()
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = bpy.data.images.new("sky", 8, 4, float_buffer=True)
    node.image.pixels.foreach_set(np.random.default_rng(1).random(128).astype(np.float32))
    node.image.pack()
    tree.links.new(node.outputs[0], background.inputs["Color"])


@feature("Worlds", "volume")
def _(test):
    tree, _, output = world_nodes()
    tree.links.new(tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])


for ray in ("camera", "diffuse", "glossy"):
    @feature("Worlds", f"ray visibility: {ray}")
    def _(test, ray=ray):
        setattr(bpy.context.scene.world.cycles_visibility, ray, False)


@feature("Cameras", "orthographic")
def _(test):
    bpy.context.scene.camera.data.type = "ORTHO"


def of_lens(camera):
    return camera if hasattr(camera, "panorama_type") else camera.cycles


@feature("Cameras", "panoramic, equirectangular")
def _(test):
    bpy.context.scene.camera.data.type = "PANO"
    of_lens(bpy.context.scene.camera.data).panorama_type = "EQUIRECTANGULAR"


@feature("Cameras", "panoramic, fisheye")
def _(test):
    bpy.context.scene.camera.data.type = "PANO"
    of_lens(bpy.context.scene.camera.data).panorama_type = "FISHEYE_EQUIDISTANT"


@feature("Cameras", "shift")
def _(test):
    bpy.context.scene.camera.data.shift_x = 0.1


@feature("Cameras", "depth of field")
def _(test):
    dof = bpy.context.scene.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 2, 0.1


@feature("Cameras", "blades of the aperture")
def _(test):
    dof = bpy.context.scene.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop, dof.aperture_blades = True, 2, 0.1, 3


@feature("Cameras", "stereoscopy")
def _(test):
    bpy.context.scene.render.use_multiview = True


@feature("Film", "exposure")
def _(test):
    bpy.context.scene.cycles.film_exposure = 2


@feature("Film", "transparent")
def _(test):
    bpy.context.scene.render.film_transparent = True


@feature("Film", "pixel filter, Blackman-Harris of 4 pixels")
def _(test):
    bpy.context.scene.cycles.pixel_filter_type, bpy.context.scene.cycles.filter_width = "BLACKMAN_HARRIS", 4


@feature("Film", "border with crop")
def _(test):
    render = bpy.context.scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_max_x = 0.5


@feature("Film", "pixel aspect")
def _(test):
    bpy.context.scene.render.pixel_aspect_x = 2


@feature("View layers", "material override")
def _(test):
    bpy.context.view_layer.material_override = h.diffuse((0.1, 0.1, 0.9), "Over")


for prop, label in (("use_sky", "Environment"), ("use_solid", "Surfaces")):
    @feature("View layers", f"filter: {label}")
    def _(test, prop=prop):
        setattr(bpy.context.view_layer, prop, False)


@feature("View layers", "samples")
def _(test):
    bpy.context.view_layer.samples = 1


@feature("View layers", "light groups")
def _(test):
    layer = bpy.context.view_layer
    layer.lightgroups.add().name = "Key"
    ob("Lamp").lightgroup = "Key"


for prop, label in (("use_pass_z", "Depth"), ("use_pass_mist", "Mist"), ("use_pass_normal", "Normal"), ("use_pass_position", "Position"),
                    ("use_pass_vector", "Vector"), ("use_pass_uv", "UV"), ("use_pass_object_index", "Object Index"),
                    ("use_pass_material_index", "Material Index"), ("use_pass_diffuse_direct", "Diffuse Direct"),
                    ("use_pass_diffuse_indirect", "Diffuse Indirect"), ("use_pass_diffuse_color", "Diffuse Color"),
                    ("use_pass_glossy_direct", "Glossy Direct"), ("use_pass_glossy_indirect", "Glossy Indirect"),
                    ("use_pass_glossy_color", "Glossy Color"), ("use_pass_transmission_direct", "Transmission Direct"),
                    ("use_pass_emit", "Emission"), ("use_pass_environment", "Environment"), ("use_pass_shadow", "Shadow"),
                    ("use_pass_ambient_occlusion", "Ambient Occlusion"), ("use_pass_cryptomatte_object", "Cryptomatte Object"),
                    ("use_pass_cryptomatte_material", "Cryptomatte Material"), ("use_pass_cryptomatte_asset", "Cryptomatte Asset")):
    @feature("Passes", label)
    def _(test, prop=prop):
        setattr(bpy.context.view_layer, prop, True)


for prop, label in (("use_pass_volume_direct", "Volume Direct"), ("use_pass_volume_indirect", "Volume Indirect")):
    @feature("Passes", label)
    def _(test, prop=prop):
        setattr(bpy.context.view_layer.cycles, prop, True)


@feature("Passes", "AOV")
def _(test):
    bpy.context.view_layer.aovs.add().name = "Mine"


@feature("Passes", "Denoising Data")
def _(test):
    bpy.context.view_layer.cycles.denoising_store_passes = True


@feature("Passes", "Shadow Catcher")
def _(test):
    bpy.context.view_layer.cycles.use_pass_shadow_catcher = True
    ob("Ground").is_shadow_catcher = True


def material_output(m):
    return next(n for n in m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")


@feature("Materials", "displacement as bump")
def _(test):
    _displace(bpy.data.materials["Red"], "ShaderNodeTexChecker")


@feature("Materials", "true displacement")
def _(test):
    m = bpy.data.materials["Red"]
    _displace(m, "ShaderNodeTexNoise")
    m.cycles.displacement_method = "DISPLACEMENT"


def _displace(m, height):
    node = m.node_tree.nodes.new("ShaderNodeDisplacement")
    m.node_tree.links.new(m.node_tree.nodes.new(height).outputs["Fac"], node.inputs["Height"])
    m.node_tree.links.new(node.outputs[0], material_output(m).inputs["Displacement"])


@feature("Materials", "volume without a surface")
def _(test):
    m = bpy.data.materials["Red"]
    output = material_output(m)
    m.node_tree.links.remove(output.inputs["Surface"].links[0])
    m.node_tree.links.new(m.node_tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])


@feature("Materials", "Use Nodes off")
def _(test):
    bpy.data.materials["Red"].use_nodes = False


@feature("Materials", "groups, reroutes and muted nodes")
def _(test):
    m = bpy.data.materials["Red"]
    group = bpy.data.node_groups.new("Tint", "ShaderNodeTree")
    inside = group.nodes.new("NodeGroupOutput")
    if hasattr(group, "interface"):
        group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    else:
        group.outputs.new("NodeSocketColor", "Color")
    group.links.new(group.nodes.new("ShaderNodeTexChecker").outputs[0], inside.inputs[0])
    node = m.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    shader = next(n for n in m.node_tree.nodes if n.type == "BSDF_DIFFUSE")
    reroute = m.node_tree.nodes.new("NodeReroute")
    m.node_tree.links.new(node.outputs[0], reroute.inputs[0])
    m.node_tree.links.new(reroute.outputs[0], shader.inputs["Color"])


def subdivided(test):
    ob("Ball").modifiers.new("Smooth", "SUBSURF").render_levels = 2


@feature("Scene", "simplify: subdivisions", before=subdivided)
def _(test):
    bpy.context.scene.render.use_simplify = True
    bpy.context.scene.render.simplify_subdivision_render = 1


@feature("Scene", "adaptive subdivision", before=subdivided)
def _(test):
    bpy.context.scene.cycles.feature_set = "EXPERIMENTAL"
    ob("Ball").cycles.use_adaptive_subdivision = True
