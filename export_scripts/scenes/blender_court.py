"""A court with a colonnade under a sky that is painted as an environment image: gradient, glow, sun. Generated textures."""
import math
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import bpy  # noqa: E402
import numpy as np  # noqa: E402

import blender_scene as s  # noqa: E402


def sky(width, elevation, azimuth):
    """Radiance (height, width, 3), bottom row first, of a clear evening; z is up, u = 1/2 - azimuth/2pi."""
    height = width // 2
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    phi, theta = (0.5 - u) * 2 * math.pi, (v - 0.5) * math.pi
    d = np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)], -1)
    sun = np.array([math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)])
    haze = np.exp(-4 * np.maximum(d[..., 2], 0))[..., None]
    colour = np.array((0.25, 0.45, 0.95)) * (1 - haze) + np.array((1.1, 0.95, 0.75)) * haze
    angle = np.arccos(np.clip(d @ sun, -1, 1))[..., None]
    colour = colour + (1.5 * np.exp(-angle / 0.25) + 3000 * np.exp(-(angle / 0.035) ** 2)) * np.array((1.0, 0.82, 0.55))
    return np.where(d[..., 2:] < 0, np.array((0.12, 0.11, 0.1)), colour).astype(np.float32)


def tiles(name, size, seed):
    """A generated image of paving, sRGB bytes, packed into the file."""
    rng = np.random.default_rng(seed)
    cells = 8
    shade = rng.uniform(0.55, 0.75, (cells, cells, 1)) * np.array((1.0, 0.93, 0.82))
    pixels = np.ones((size, size, 4), np.float32)
    pixels[..., :3] = np.kron(shade, np.ones((size // cells, size // cells, 1)))
    joint = np.arange(size) % (size // cells) < 2
    pixels[joint, :, :3] *= 0.6
    pixels[:, joint, :3] *= 0.6
    image = bpy.data.images.new(name, size, size)
    image.pixels.foreach_set(pixels.reshape(-1))
    image.pack()
    return image


def main():
    options = s.arguments(__doc__, seed=1, elevation=28.0, azimuth=215.0, columns=7, width=480, height=320)
    scene = s.begin(options.width, options.height)
    image = bpy.data.images.new("sky", 512, 256, float_buffer=True)
    pixels = np.ones((256, 512, 4), np.float32)
    pixels[..., :3] = sky(512, math.radians(options.elevation), math.radians(options.azimuth))
    image.pixels.foreach_set(pixels.reshape(-1))
    image.pack()
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs[0], next(n for n in tree.nodes if n.type == "BACKGROUND").inputs["Color"])
    stone, plaster = s.matte("stone", (0.6, 0.57, 0.52)), s.matte("plaster", (0.72, 0.6, 0.45))
    roof, water = s.matte("roof", (0.5, 0.24, 0.15)), s.glossy_mix("water", (0.04, 0.08, 0.1), 0.5, 0.2)
    paving = s.matte("paving", (0.5, 0.5, 0.5))
    node = paving.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = tiles("paving", 256, options.seed)
    shader = next(n for n in paving.node_tree.nodes if n.type == "BSDF_DIFFUSE")
    paving.node_tree.links.new(node.outputs["Color"], shader.inputs["Color"])
    ground = s.mesh("ground", [(-14, -14, 0), (14, -14, 0), (14, 14, 0), (-14, 14, 0)], [(0, 1, 2, 3)], paving)
    ground.data.uv_layers.new(name="UVMap").data.foreach_set("uv", [0, 0, 6, 0, 6, 6, 0, 6])
    for name, low, high in (("back wall", (-9.4, 9.0, 0), (9.4, 9.4, 5)), ("left wall", (-9.4, -6.0, 0), (-9.0, 9.0, 5)),
                            ("right wall", (9.0, -6.0, 0), (9.4, 9.0, 5))):
        s.box(name, low, high, plaster)
    for name, low, high in (("back roof", (-9.0, 6.0, 3.4), (9.0, 9.0, 3.6)), ("left roof", (-9.0, -6.0, 3.4), (-6.0, 6.0, 3.6)),
                            ("right roof", (6.0, -6.0, 3.4), (9.0, 6.0, 3.6))):
        s.box(name, low, high, roof)
    profile = [(0.34, 0), (0.34, 0.15), (0.24, 0.25), (0.2, 3.1), (0.3, 3.25), (0.34, 3.4)]
    column = s.turned("column", profile, stone, 32, (-5.8, 5.8, 0))
    for i in range(1, options.columns):
        s.copy_of(column, (-5.8 + 11.6 * i / (options.columns - 1), 5.8, 0))
    for i in range(1, 7):
        for x in (-5.8, 5.8):
            s.copy_of(column, (x, 5.8 - 1.9 * i, 0))
    s.turned("basin", [(2.2, 0), (2.2, 0.5), (1.9, 0.55), (1.9, 0.3)], stone, 64, (0, 0.5, 0))
    s.turned("water", [(1.9, 0.42), (0.0, 0.42)], water, 64, (0, 0.5, 0))
    s.turned("spout", [(0.3, 0.4), (0.12, 0.6), (0.1, 1.6), (0.7, 1.8), (0.72, 1.86), (0.0, 1.8)], stone, 48, (0, 0.5, 0))
    rng = np.random.default_rng(options.seed)
    for i in range(8):
        x, y = (-8.2 if i % 2 else 8.2), -4.5 + 3.2 * (i // 2)
        s.turned("pot", [(0.0, 0.0), (0.25, 0.0), (0.4, 0.35), (0.3, 0.6), (0.36, 0.68)],
                 s.matte(f"pot {i}", tuple(rng.uniform(0.15, 0.6, 3))), 32, (x, y, 0))
    s.camera((3.6, -10.5, 2.3), (-0.6, 2.0, 1.5), 24)
    s.finish(options)


main()
