"""A closed room that no lamp lights directly: bowls throw all light at the ceiling. Glossy floor, rounded furniture.

About 480,000 triangles once modifiers are at work; --detail 0 has some 30,000 of them.
"""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import numpy as np  # noqa: E402

import blender_scene as s  # noqa: E402

WIDTH, DEPTH, HEIGHT = 7.0, 9.0, 3.2


def main():
    options = s.arguments(__doc__, seed=1, detail=3, width=320, height=240)
    scene = s.begin(options.width, options.height)
    rng = np.random.default_rng(options.seed)
    wall, ceiling = s.matte("wall", (0.72, 0.68, 0.6)), s.matte("ceiling", (0.82, 0.82, 0.8))
    blue, wood = s.matte("blue", (0.22, 0.34, 0.52)), s.matte("wood", (0.42, 0.26, 0.14))
    metal, cloth = s.matte("metal", (0.5, 0.48, 0.45)), s.matte("cloth", (0.6, 0.2, 0.14))
    china = s.matte("china", (0.75, 0.75, 0.72))
    floor = s.glossy_mix("floor", (0.35, 0.24, 0.16), 0.15, 0.35)
    w, d, h = WIDTH, DEPTH, HEIGHT
    s.mesh("floor", [(0, 0, 0), (w, 0, 0), (w, d, 0), (0, d, 0)], [(0, 1, 2, 3)], floor)
    s.mesh("ceiling", [(0, 0, h), (0, d, h), (w, d, h), (w, 0, h)], [(0, 1, 2, 3)], ceiling)
    s.mesh("front", [(0, 0, 0), (0, 0, h), (w, 0, h), (w, 0, 0)], [(0, 1, 2, 3)], wall)
    s.mesh("back", [(0, d, 0), (w, d, 0), (w, d, h), (0, d, h)], [(0, 1, 2, 3)], wall)
    s.mesh("left", [(0, 0, 0), (0, d, 0), (0, d, h), (0, 0, h)], [(0, 1, 2, 3)], blue)
    s.mesh("right", [(w, 0, 0), (w, 0, h), (w, d, h), (w, d, 0)], [(0, 1, 2, 3)], wall)

    segments = 18 * (options.detail + 1)

    def subdivided(ob):
        modifier = ob.modifiers.new("fine", "SUBSURF")
        modifier.levels, modifier.render_levels = 0, max(0, options.detail - 1)
        return ob

    # Bowls: thin bodies of revolution, the lamp inside, below the rim, so that only the ceiling sees it.
    profile = [(0.04, -0.06), (0.12, -0.05), (0.19, 0.0), (0.22, 0.1), (0.215, 0.1), (0.185, 0.005), (0.12, -0.04), (0.0, -0.045)]
    bowl = subdivided(s.turned("bowl", profile, metal, segments, (0.3, 1.5, 2.2)))
    stand = s.turned("stand", [(0.16, 0), (0.16, 0.02), (0.02, 0.04), (0.02, 1.85)], metal, segments, (0, -50, 0))
    places = [(x, y, 2.2) for y in (1.5, 4.5, 7.5) for x in (0.3, w - 0.3)] + [(2.2, d - 0.5, 1.9), (4.8, d - 0.5, 1.9)]
    for i, (x, y, z) in enumerate(places):
        if i > 0:
            s.copy_of(bowl, (x, y, z))
        if z < 2:
            s.copy_of(stand, (x, y, 0))
        colour = (1.0, 0.8, 0.55) if z > 2 else (0.8, 0.9, 1.0)
        s.lamp(f"up {i}", "AREA", (x, y, z + 0.02), 60, (np.pi, 0, 0), colour, shape="DISK", size=0.26)
    stand.location = (2.2, d - 0.5, -0.02)

    # A table with chairs and dishes, shelves with books, a sofa.
    s.box("table top", (2.4, 3.4, 0.72), (4.6, 5.0, 0.77), wood, bevel=0.015)
    leg = subdivided(s.turned("leg", [(0.05, 0), (0.03, 0.2), (0.045, 0.5), (0.035, 0.72)], wood, segments, (2.55, 3.55, 0)))
    for x, y in ((4.45, 3.55), (2.55, 4.85), (4.45, 4.85)):
        s.copy_of(leg, (x, y, 0))
    plate = subdivided(s.turned("plate", [(0.0, 0.0), (0.09, 0.0), (0.15, 0.025), (0.148, 0.03), (0.09, 0.008), (0.0, 0.007)],
                                china, segments, (3.0, 3.75, 0.77)))
    cup = subdivided(s.turned("cup", [(0.0, 0.0), (0.03, 0.0), (0.045, 0.05), (0.05, 0.1), (0.046, 0.1), (0.04, 0.05), (0.0, 0.01)],
                              china, segments, (3.3, 3.9, 0.77)))
    for i in range(4):
        x, y = 2.8 + 1.2 * (i % 2), 3.75 + 0.9 * (i // 2)
        if i > 0:
            s.copy_of(plate, (x, y, 0.77))
            s.copy_of(cup, (x + 0.3, y + 0.1, 0.77))
        for part, low, high in (("seat", (-0.22, -0.22, 0.44), (0.22, 0.22, 0.48)), ("back", (-0.22, -0.22, 0.48), (0.22, -0.18, 0.95)),
                                ("foot", (-0.2, -0.2, 0), (-0.16, -0.16, 0.44)), ("foot", (0.16, 0.16, 0), (0.2, 0.2, 0.44)),
                                ("foot", (-0.2, 0.16, 0), (-0.16, 0.2, 0.44)), ("foot", (0.16, -0.2, 0), (0.2, -0.16, 0.44))):
            side = -1 if i // 2 == 0 else 1
            oy = y + side * 0.75
            s.box(f"chair {i} {part}", (x + low[0], oy + min(-side * low[1], -side * high[1]), low[2]),
                  (x + high[0], oy + max(-side * low[1], -side * high[1]), high[2]), wood, bevel=0.01)
    for shelf in range(5):
        z = 0.3 + 0.42 * shelf
        s.box(f"shelf {shelf}", (0.02, 2.3, z - 0.02), (0.32, 6.6, z), wood, bevel=0.005)
        y = 2.35
        while y < 6.4:
            thick, tall = rng.uniform(0.02, 0.06), rng.uniform(0.2, 0.34)
            colour = ("cloth", "blue", "wood", "china")[rng.integers(4)]
            material = {"cloth": cloth, "blue": blue, "wood": wood, "china": china}[colour]
            s.box("book", (0.05, y, z), (0.05 + rng.uniform(0.16, 0.24), y + thick, z + tall), material, bevel=0.003)
            y += thick + 0.004 + (rng.random() < 0.08) * 0.15
    for part, low, high in (("base", (5.6, 2.0, 0.1), (6.5, 4.4, 0.42)), ("back", (6.3, 2.0, 0.42), (6.6, 4.4, 0.9)),
                            ("arm", (5.6, 1.8, 0.1), (6.6, 2.05, 0.62)), ("arm", (5.6, 4.35, 0.1), (6.6, 4.6, 0.62))):
        ob = s.box(f"sofa {part}", low, high, cloth, bevel=0.06)
        fine = ob.modifiers.new("fine", "SUBSURF")
        fine.levels, fine.render_levels = 0, max(0, options.detail - 1)
    vase = subdivided(s.turned("vase", [(0.0, 0.0), (0.12, 0.0), (0.2, 0.2), (0.17, 0.5), (0.07, 0.7), (0.1, 0.8), (0.09, 0.8), (0.06, 0.7)],
                               china, 2 * segments, (1.2, 7.6, 0)))
    for x, y, k in ((5.9, 7.4, 1.2), (6.4, 6.9, 0.8), (1.7, 7.9, 0.7)):
        s.copy_of(vase, (x, y, 0), scale=k)
    s.camera((5.6, 0.7, 1.75), (2.6, 6.2, 0.85), 20)
    scene.cycles.max_bounces = 32 if hasattr(scene, "cycles") else 0
    s.finish(options)


main()
