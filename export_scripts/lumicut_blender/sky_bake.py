# SPDX-License-Identifier: Apache-2.0
"""Runs in a Blender of its own (sky.py starts it): Cycles renders a world into a latitude-longitude image, suns apart.

    blender -b --factory-startup -P sky_bake.py -- WORLD.blend NAME FRAME WIDTH RESULT.npz
"""
import math
import os
import sys

import bpy
import numpy as np
from mathutils import Vector

SAMPLES = 16  # a pixel: it has the mean over its area, whatever is small
SUN_PIXELS = 96


def trees(tree):
    yield tree
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            yield from trees(node.node_tree)


def as_for_lighting(tree):
    """Cuts what differs by ray: neither the camera's nor any other kind, as the add-on reads worlds."""
    for part in trees(tree):
        for link in [l for l in part.links if l.from_node.type == "LIGHT_PATH"]:
            socket = link.to_socket
            part.links.remove(link)
            value = getattr(socket, "default_value", None)
            if isinstance(value, (int, float)):
                socket.default_value = type(value)(0)
            elif value is not None:
                socket.default_value = [0.0] * (len(value) - 1) + [1.0]


def render(scene, width, height, folder):
    """(height, width, 3) float32, top row first."""
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.render.filepath = os.path.join(folder, "sky.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, -1)[::-1, :, :3].copy()


def panorama(camera):
    camera.type = "PANO"
    for owner in (camera, getattr(camera, "cycles", None)):
        if hasattr(owner, "panorama_type"):
            owner.panorama_type = "EQUIRECTANGULAR"


def sun_of(scene, node, folder):
    """(direction towards it, irradiance on a surface that faces it) of a sky's disc, as it comes through the whole tree."""
    elevation, turn = node.sun_elevation, node.sun_rotation
    towards = Vector((math.cos(elevation) * math.sin(turn), math.cos(elevation) * math.cos(turn), math.sin(elevation)))
    camera = scene.camera
    camera.data.type, camera.data.angle = "PERSP", min(2.5, 1.3 * node.sun_size)
    camera.rotation_euler = towards.to_track_quat("-Z", "Y").to_euler()
    images = []
    for disc in (True, False):
        node.sun_disc = disc
        images.append(render(scene, SUN_PIXELS, SUN_PIXELS, folder))
    half = math.tan(camera.data.angle / 2)
    x = ((np.arange(SUN_PIXELS) + 0.5) / SUN_PIXELS * 2 - 1) * half
    distance2 = 1 + x[:, None] ** 2 + x[None] ** 2
    # Solid angle of a pixel times the cosine to the axis.
    weight = (2 * half / SUN_PIXELS) ** 2 / distance2 ** 2
    return towards, ((images[0] - images[1]) * weight[..., None]).sum((0, 1))


def main():
    path, name, frame, width, result = sys.argv[sys.argv.index("--") + 1:]
    if not hasattr(bpy.types.Scene, "cycles"):  # on from the start, where there is one
        raise RuntimeError("this Blender has no Cycles")
    scene = bpy.context.scene
    for ob in list(scene.objects):
        bpy.data.objects.remove(ob)
    with bpy.data.libraries.load(path) as (_, wanted):
        wanted.worlds = [name]
    world = scene.world = wanted.worlds[0]
    scene.frame_set(int(frame))
    if hasattr(world, "cycles_visibility"):
        world.cycles_visibility.camera = True
    if hasattr(world, "cycles"):
        world.cycles.sampling_method = "NONE"
    as_for_lighting(world.node_tree)
    scene.render.engine = "CYCLES"
    c = scene.cycles
    c.device, c.samples, c.use_adaptive_sampling, c.use_denoising = "CPU", SAMPLES, False, False
    c.sample_clamp_direct = c.sample_clamp_indirect = 0
    c.pixel_filter_type = "BOX"
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGB"
    scene.render.film_transparent = False
    camera = scene.camera = bpy.data.objects.new("sky", bpy.data.cameras.new("sky"))
    scene.collection.objects.link(camera)
    folder = os.path.dirname(result)
    suns = []
    for tree in trees(world.node_tree):
        for node in tree.nodes:
            # Discs on coordinates of their own stay in the image.
            if node.type == "TEX_SKY" and getattr(node, "sun_disc", False) and "HOSEK" not in node.sky_type \
                    and "PREETHAM" not in node.sky_type and not node.inputs[0].is_linked:
                towards, irradiance = sun_of(scene, node, folder)  # and switches the disc off
                if (irradiance > 0).any():
                    suns.append([*towards, *np.maximum(irradiance, 0), node.sun_size])
    panorama(camera.data)
    camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
    pixels = render(scene, int(width), int(width) // 2, folder)
    np.savez(result, pixels=np.maximum(np.nan_to_num(pixels), 0), suns=np.array(suns, np.float64).reshape(-1, 7))


if __name__ == "__main__":
    main()
