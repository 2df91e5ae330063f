"""A kitchen of a country house: glossy tiles, worktops and pots, daylight through a window, lamps under the cupboards."""
import math
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import numpy as np  # noqa: E402

import blender_scene as s  # noqa: E402


def main():
    options = s.arguments(__doc__, seed=1, sun=4.0, width=480, height=320)
    scene = s.begin(options.width, options.height)
    rng = np.random.default_rng(options.seed)
    next(n for n in scene.world.node_tree.nodes if n.type == "BACKGROUND").inputs["Color"].default_value = (0.5, 0.7, 1.0, 1)
    wall, ceiling = s.matte("wall", (0.75, 0.7, 0.58)), s.matte("ceiling", (0.8, 0.8, 0.78))
    terracotta = s.glossy_mix("terracotta", (0.45, 0.2, 0.11), 0.1, 0.35)
    tile, worktop = s.glossy_mix("tile", (0.7, 0.72, 0.68), 0.12, 0.3), s.glossy_mix("worktop", (0.12, 0.12, 0.13), 0.2, 0.3)
    front, wood = s.glossy_mix("front", (0.25, 0.38, 0.3), 0.06, 0.4), s.matte("wood", (0.4, 0.24, 0.12))
    copper, steel = s.principled("copper", (0.8, 0.42, 0.25), 0.35, 0, 1), s.principled("steel", (0.6, 0.6, 0.62), 0.4, 0, 1)
    china = s.glossy_mix("china", (0.7, 0.7, 0.66), 0.08, 0.3)
    w, d, h = 5.0, 4.2, 2.6
    s.mesh("floor", [(0, 0, 0), (w, 0, 0), (w, d, 0), (0, d, 0)], [(0, 1, 2, 3)], terracotta)
    s.mesh("ceiling", [(0, 0, h), (0, d, h), (w, d, h), (w, 0, h)], [(0, 1, 2, 3)], ceiling)
    s.mesh("front wall", [(0, 0, 0), (0, 0, h), (w, 0, h), (w, 0, 0)], [(0, 1, 2, 3)], wall)
    s.mesh("back wall", [(0, d, 0), (w, d, 0), (w, d, h), (0, d, h)], [(0, 1, 2, 3)], wall)
    s.mesh("right wall", [(w, 0, 0), (w, 0, h), (w, d, h), (w, d, 0)], [(0, 1, 2, 3)], wall)
    # The left wall has a window from y 1.4 to 2.9, z 1.0 to 2.1.
    a, b, lo, hi = 1.4, 2.9, 1.0, 2.1
    s.mesh("left wall", [(0, 0, 0), (0, d, 0), (0, d, h), (0, 0, h), (0, a, lo), (0, b, lo), (0, b, hi), (0, a, hi)],
           [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)], wall)
    for name, low, high in (("sill", (-0.2, a, lo - 0.04), (0.12, b, lo)), ("lintel", (-0.2, a, hi), (0, b, hi + 0.04)),
                            ("jamb", (-0.2, a - 0.04, lo), (0, a, hi)), ("jamb", (-0.2, b, lo), (0, b + 0.04, hi)),
                            ("bar", (-0.1, (a + b) / 2 - 0.02, lo), (-0.06, (a + b) / 2 + 0.02, hi)),
                            ("bar", (-0.1, a, 1.53), (-0.06, b, 1.57))):
        s.box(name, low, high, wood)
    # Units along the back and right walls, with tiles above the worktop.
    for i in range(5):
        x = 0.1 + 0.8 * i
        s.box("unit", (x, d - 0.6, 0.1), (x + 0.78, d - 0.02, 0.86), front, bevel=0.008)
        s.box("door", (x + 0.03, d - 0.62, 0.14), (x + 0.75, d - 0.6, 0.82), front, bevel=0.006)
        s.turned("knob", [(0.0, 0.0), (0.02, 0.0), (0.02, 0.02), (0.0, 0.03)], steel, 16, (x + 0.65, d - 0.65, 0.6))
        if i != 2:
            s.box("cupboard", (x, d - 0.36, 1.5), (x + 0.78, d - 0.02, 2.2), front, bevel=0.008)
            s.lamp("under", "AREA", (x + 0.39, d - 0.2, 1.49), 6, (0, 0, 0), (1, 0.82, 0.6), shape="RECTANGLE", size=0.6, size_y=0.04)
    s.box("worktop", (0.05, d - 0.66, 0.86), (4.15, d - 0.01, 0.9), worktop, bevel=0.008)
    one = s.box("tile", (0, 0, 0), (0.148, 0.01, 0.148), tile, bevel=0.003)
    for i in range(27):
        for k in range(4):
            if i + k > 0:
                s.copy_of(one, (0.1 + 0.15 * i + 0.074, d - 0.015, 0.905 + 0.15 * k))
    one.location = (0.1 + 0.074, d - 0.015, 0.905)
    hob = s.box("stove", (4.2, d - 0.7, 0), (4.95, d - 0.02, 0.9), steel, bevel=0.01)
    s.box("hood", (4.2, d - 0.55, 1.7), (4.95, d - 0.02, 1.9), copper, bevel=0.02)
    pot = [(0.0, 0.0), (0.13, 0.0), (0.14, 0.02), (0.14, 0.16), (0.15, 0.17), (0.13, 0.165), (0.128, 0.03), (0.0, 0.02)]
    kettle = s.turned("pot", pot, copper, 48, (4.4, d - 0.4, 0.9))
    s.copy_of(kettle, (4.75, d - 0.35, 0.9), scale=0.8)
    for i in range(6):  # pans on the rail
        s.copy_of(kettle, (0.5 + 0.3 * i, d - 0.25, 2.25), scale=rng.uniform(0.6, 0.9))
    # A table with a cloth of plates, jugs and a bowl; a pendant lamp above.
    s.box("table", (1.3, 1.2, 0.72), (3.3, 2.2, 0.77), wood, bevel=0.012)
    for x in (1.36, 3.16):
        for y in (1.26, 2.06):
            s.box("leg", (x, y, 0), (x + 0.08, y + 0.08, 0.72), wood, bevel=0.006)
    plate = s.turned("plate", [(0.0, 0.0), (0.08, 0.0), (0.13, 0.02), (0.128, 0.026), (0.08, 0.008), (0.0, 0.007)], china, 48, (1.7, 1.45, 0.77))
    for i in range(1, 6):
        s.copy_of(plate, (1.7 + 0.6 * (i % 3), 1.45 + 0.5 * (i // 3), 0.77))
    for x, y, k in ((2.0, 1.7, 1.0), (2.6, 1.75, 0.8), (1.0, d - 0.3, 1.1), (1.5, d - 0.35, 0.7)):
        z = 0.77 if y < 3 else 0.9
        s.turned("jug", [(r * k, t * k) for r, t in ((0, 0), (0.06, 0), (0.1, 0.1), (0.08, 0.2), (0.05, 0.25), (0.06, 0.3), (0.05, 0.3), (0.04, 0.25))],
                 china, 48, (x, y, z))
    s.turned("shade", [(0.03, 0.2), (0.05, 0.18), (0.22, 0.0), (0.215, 0.0), (0.04, 0.175)], copper, 48, (2.3, 1.7, 1.55))
    s.lamp("pendant", "POINT", (2.3, 1.7, 1.62), 35, colour=(1, 0.8, 0.55), shadow_soft_size=0.03)
    s.lamp("sun", "SUN", (-3, 2, 3), options.sun, (0, math.radians(-52), math.radians(8)), (1, 0.93, 0.8), angle=0.02)
    assert hob is not None
    s.camera((4.3, 0.35, 1.6), (1.6, 3.3, 0.95), 20)
    s.finish(options)


main()
