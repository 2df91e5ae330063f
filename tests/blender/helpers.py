"""What the tests inside Blender share: scenes, renders as arrays, a reader of uncompressed EXR."""
import contextlib
import os
import pathlib
import struct
import tempfile

import bpy
import numpy as np

ROOT = pathlib.Path(os.environ["LUMICUT_SOURCE_DIR"])
VERSION = bpy.app.version


def read_exr(path, layer=None):
    """{pass name ("Combined", "Depth" ...): (h, w, channels) float32, top row first} of an uncompressed 32-bit EXR.
    `layer`: of that view layer alone."""
    raw = pathlib.Path(path).read_bytes()
    assert raw[:4] == b"\x76\x2f\x31\x01", f"{path} is no EXR"
    at, attributes = 8, {}

    def text():
        nonlocal at
        end = raw.index(b"\0", at)
        word = raw[at:end].decode()
        at = end + 1
        return word

    while raw[at]:
        name, _ = text(), text()
        size, = struct.unpack_from("<i", raw, at)
        attributes[name] = raw[at + 4:at + 4 + size]
        at += 4 + size
    at += 1
    assert attributes["compression"] == b"\0", "write it with exr_codec NONE"
    channels, list_at, data = [], 0, attributes["channels"]
    while data[list_at]:
        end = data.index(b"\0", list_at)
        channels.append((data[list_at:end].decode(), struct.unpack_from("<i", data, end + 1)[0]))
        list_at = end + 17
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    at += 8 * height
    planes = {name: np.empty((height, width), np.float32) for name, _ in channels}
    for _ in range(height):
        row, size = struct.unpack_from("<ii", raw, at)
        at += 8
        offset = at
        for name, kind in channels:
            dtype = {1: "<f2", 2: "<f4", 0: "<u4"}[kind]
            planes[name][row - y0] = np.frombuffer(raw, dtype, width, offset)
            offset += width * np.dtype(dtype).itemsize
        at += size
    layers = {}
    for name, plane in planes.items():
        parts = name.split(".")
        if layer is not None and parts[0] != layer:
            continue
        layers.setdefault(parts[-2] if len(parts) > 1 else "Combined", {})[parts[-1]] = plane
    order = "RGBAXYZV"
    return {name: np.stack([found[c] for c in sorted(found, key=order.find)], -1) for name, found in layers.items()}


def new_scene(width=32, height=32):
    """An empty scene: black world, a camera that looks down at the origin from z = 5."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    import addon_utils
    addon_utils.enable("lumicut_blender")
    addon_utils.enable("cycles")
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    set_world((0, 0, 0))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.location = (0, 0, 5)
    scene.camera = camera
    settings = scene.lumicut
    from lumicut_blender import migration
    migration.migrate(settings)  # the library's own parameters: one plain pass
    settings.integrator = "exhaustive"
    settings.samples = 1
    return scene


def set_world(color, strength=1.0):
    background = next(n for n in bpy.context.scene.world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs["Color"].default_value = (*color, 1)
    background.inputs["Strength"].default_value = strength


def link(ob):
    bpy.context.scene.collection.objects.link(ob)
    return ob


def add_mesh(name, vertices, faces, material=None, smooth=False):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    if material is not None:
        mesh.materials.append(material)
    if smooth:
        mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.update()
    return link(bpy.data.objects.new(name, mesh))


def add_plane(size=6.0, z=0.0, material=None, name="Plane"):
    s = size / 2
    return add_mesh(name, [(-s, -s, z), (s, -s, z), (s, s, z), (-s, s, z)], [(0, 1, 2, 3)], material)


def add_sphere(radius=1.0, location=(0, 0, 0), material=None, segments=24, smooth=True, name="Sphere"):
    import bmesh
    mesh = bpy.data.meshes.new(name)
    b = bmesh.new()
    bmesh.ops.create_uvsphere(b, u_segments=segments, v_segments=segments // 2, radius=radius)
    # In an order of their own: the operator's differs each time, and so would the lights on them.
    n = len(b.verts)
    b.faces.sort(key=lambda face: sum(v * n ** (2 - k) for k, v in enumerate(sorted(v.index for v in face.verts)[:3])))
    b.to_mesh(mesh)
    b.free()
    if material is not None:
        mesh.materials.append(material)
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    mesh.update()
    ob = link(bpy.data.objects.new(name, mesh))
    ob.location = location
    return ob


def material(name="Material"):
    m = bpy.data.materials.new(name)
    m.use_nodes = True
    m.node_tree.nodes.clear()
    m.node_tree.nodes.new("ShaderNodeOutputMaterial")
    return m


def shader(m, kind, **inputs):
    """A shader node of that type on the material's output."""
    node = m.node_tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    output = next(n for n in m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
    m.node_tree.links.new(node.outputs[0], output.inputs["Surface"])
    return node


def diffuse(colour=(0.5, 0.5, 0.5), name="Diffuse"):
    m = material(name)
    shader(m, "ShaderNodeBsdfDiffuse", Color=(*colour, 1), Roughness=0.0)
    return m


def emission(strength=1.0, colour=(1, 1, 1), name="Emission"):
    m = material(name)
    shader(m, "ShaderNodeEmission", Color=(*colour, 1), Strength=strength)
    return m


def add_light(kind, location=(0, 0, 2), energy=100.0, rotation=(0, 0, 0), scale=(1, 1, 1), **values):
    light = bpy.data.lights.new(kind, kind)
    light.energy = energy
    for name, value in values.items():
        setattr(light, name, value)
    ob = link(bpy.data.objects.new(kind, light))
    ob.location, ob.rotation_euler, ob.scale = location, rotation, scale
    return ob


def set_lumicut(integrator="exhaustive", samples=1, passes=1, denoise=False, **parameters):
    scene = bpy.context.scene
    scene.render.engine = "LUMICUT"
    settings = scene.lumicut
    settings.integrator, settings.samples, settings.passes, settings.denoise = integrator, samples, passes, denoise
    for name, value in parameters.items():
        group = settings.common if hasattr(settings.common, name) else getattr(settings, integrator)
        setattr(group, name, value)


def set_cycles(samples=64, bounces=0):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    c = scene.cycles
    c.device, c.samples, c.use_adaptive_sampling, c.use_denoising = "CPU", samples, False, False
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transparent_max_bounces = bounces
    c.transparent_max_bounces = max(8, bounces)
    c.sample_clamp_direct = c.sample_clamp_indirect = 0
    c.blur_glossy = 0
    c.pixel_filter_type = "BOX"
    c.seed = 1


def render(layer=None):
    """All passes of the scene's render, or of one of its layers, through a multi-layer EXR."""
    scene = bpy.context.scene
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
    image.views_format = "MULTIVIEW"  # both eyes in one file
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = folder + "/image.exr"
        bpy.ops.render.render(write_still=True)
        return read_exr(folder + "/image.exr", layer)


def both(cycles=64, samples=16, bounces=0, layer=None, **parameters):
    """Passes of the scene, ours and Cycles'. Without bounces by default: direct light alone is nearly exact in both."""
    with quiet():
        set_cycles(cycles, bounces)
        theirs = render(layer)
        set_lumicut("exhaustive", samples, **{"vpls": 400, "max_depth": bounces} | parameters)
        return render(layer), theirs


def radiance(layers):
    return layers["Combined"][..., :3].astype(np.float64)


def last_notes():
    from lumicut_blender import runtime
    return runtime.last["notes"]


def last_stats():
    from lumicut_blender import runtime
    return runtime.last


@contextlib.contextmanager
def quiet():
    """Render progress off the terminal."""
    import sys
    sys.stdout.flush()
    saved, null = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(saved, 1)
        os.close(saved)
        os.close(null)


def blocks(image, side=4):
    """Means of side x side pixels, which has less noise than pixels."""
    h, w = image.shape[0] // side * side, image.shape[1] // side * side
    return image[:h, :w].reshape(h // side, side, w // side, side, -1).mean((1, 3))
