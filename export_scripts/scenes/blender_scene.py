"""What the Blender scripts of this folder share: materials, boxes, lamps, and the command line.

    blender -b --factory-startup --addons lumicut_blender -P export_scripts/scenes/blender_hall.py -- --output hall.blend --lamps 10000
"""
import argparse
import math
import os
import sys

import bpy
import numpy as np
from mathutils import Matrix


def arguments(description, **options):
    """Options after "--": numbers with defaults, and --output, the .blend to save."""
    parser = argparse.ArgumentParser(description=description, prog="blender ... --")
    for name, default in options.items():
        parser.add_argument("--" + name.replace("_", "-"), type=type(default), default=default, help=f"default {default}")
    parser.add_argument("--output", default="")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])


def begin(width, height):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    next(n for n in scene.world.node_tree.nodes if n.type == "BACKGROUND").inputs["Color"].default_value = (0, 0, 0, 1)
    return scene


def finish(options):
    """Picks the engine where the add-on is on, and saves."""
    scene = bpy.context.scene
    if hasattr(scene, "lumicut"):
        scene.render.engine = "LUMICUT"
    if options.output:
        bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(options.output), compress=True)


def link(ob):
    bpy.context.scene.collection.objects.link(ob)
    return ob


def matte(name, colour):
    """Lambert: the same in all renderers and versions, which Principled's diffuse part is not."""
    m = bpy.data.materials.new(name)
    m.use_nodes = True
    tree = m.node_tree
    tree.nodes.clear()
    output, base = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    base.inputs["Color"].default_value = (*colour, 1)
    tree.links.new(base.outputs[0], output.inputs["Surface"])
    return m


def principled(name, colour, roughness=1.0, specular=0.0, metallic=0.0, emission=0.0):
    m = bpy.data.materials.new(name)
    m.use_nodes = True
    node = next(n for n in m.node_tree.nodes if n.type == "BSDF_PRINCIPLED")

    def put(value, *names):
        next(node.inputs[n] for n in names if n in node.inputs).default_value = value

    put((*colour, 1), "Base Color")
    put(roughness, "Roughness")
    put(specular, "Specular", "Specular IOR Level")
    put(metallic, "Metallic")
    put((*colour, 1), "Emission", "Emission Color")
    put(emission, "Emission Strength")
    return m


def glossy_mix(name, colour, gloss, roughness):
    """Diffuse with a share of a glossy coat: the same in all renderers and versions."""
    m = bpy.data.materials.new(name)
    m.use_nodes = True
    tree = m.node_tree
    tree.nodes.clear()
    output, mix, base, coat = (tree.nodes.new(k) for k in ("ShaderNodeOutputMaterial", "ShaderNodeMixShader",
                                                           "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfGlossy"))
    base.inputs["Color"].default_value = (*colour, 1)
    coat.inputs["Color"].default_value, coat.inputs["Roughness"].default_value = (1, 1, 1, 1), roughness
    mix.inputs[0].default_value = gloss
    for a, b in ((base.outputs[0], mix.inputs[1]), (coat.outputs[0], mix.inputs[2]), (mix.outputs[0], output.inputs["Surface"])):
        tree.links.new(a, b)
    return m


def mesh(name, vertices, faces, material, smooth=False):
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    if material is not None:
        data.materials.append(material)
    if smooth:
        data.polygons.foreach_set("use_smooth", [True] * len(data.polygons))
    data.update()
    return link(bpy.data.objects.new(name, data))


def box(name, low, high, material, turn=0.0, bevel=0.0):
    """An upright box, turned about its own middle by `turn` degrees; rounded where `bevel` is a width."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    v = [(x - cx, y - cy, z) for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    ob = mesh(name, v, [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)], material)
    ob.location, ob.rotation_euler = (cx, cy, 0), (0, 0, math.radians(turn))
    if bevel > 0:
        modifier = ob.modifiers.new("round", "BEVEL")
        modifier.width, modifier.segments = bevel, 3
    return ob


def turned(name, profile, material, segments=32, location=(0, 0, 0)):
    """A body of revolution about z: profile of (radius, height) from below."""
    angles = np.linspace(0, 2 * math.pi, segments, endpoint=False)
    v = [(r * math.cos(a), r * math.sin(a), z) for r, z in profile for a in angles]
    rings = len(profile)
    f = [(i * segments + k, i * segments + (k + 1) % segments, (i + 1) * segments + (k + 1) % segments, (i + 1) * segments + k)
         for i in range(rings - 1) for k in range(segments)]
    ob = mesh(name, v, f, material, smooth=True)
    ob.location = location
    return ob


def copy_of(ob, location, turn=0.0, scale=1.0):
    other = link(bpy.data.objects.new(ob.name, ob.data))
    for modifier in ob.modifiers:
        twin = other.modifiers.new(modifier.name, modifier.type)
        for p in modifier.bl_rna.properties:
            if not p.is_readonly:
                setattr(twin, p.identifier, getattr(modifier, p.identifier))
    other.location, other.rotation_euler, other.scale = location, (0, 0, math.radians(turn)), (scale,) * 3
    return other


def lamp(name, kind, location, energy, rotation=(0, 0, 0), colour=(1, 1, 1), **values):
    data = bpy.data.lights.get(name) or bpy.data.lights.new(name, kind)
    data.energy, data.color = energy, colour
    for key, value in values.items():
        setattr(data, key, value)
    ob = link(bpy.data.objects.new(name, data))
    ob.location, ob.rotation_euler = location, rotation
    return ob


def camera(eye, at, lens=24.0):
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    ob = link(bpy.data.objects.new("Camera", data))
    z = np.array(eye, float) - np.array(at, float)
    z /= np.linalg.norm(z)
    x = np.cross((0, 0, 1), z)
    x /= np.linalg.norm(x)
    ob.matrix_world = Matrix(np.vstack([np.column_stack([x, np.cross(z, x), z, eye]), [0, 0, 0, 1]]).tolist())
    bpy.context.scene.camera = ob
    return ob
