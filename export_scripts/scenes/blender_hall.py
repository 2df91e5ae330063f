"""A hall lit by ten thousand small lamps: spheres of light along ribs, and as many point lamps without a body on demand."""
import math
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import numpy as np  # noqa: E402

import blender_scene as s  # noqa: E402


def main():
    options = s.arguments(__doc__, seed=1, lamps=10000, bays=9, width=480, height=320)
    s.begin(options.width, options.height)
    rng = np.random.default_rng(options.seed)
    stone, floor = s.matte("stone", (0.66, 0.6, 0.5)), s.glossy_mix("floor", (0.3, 0.28, 0.26), 0.12, 0.4)
    wood = s.matte("wood", (0.36, 0.22, 0.12))
    half, bay = 6.0, 4.0
    length = bay * options.bays
    s.mesh("floor", [(-half, 0, 0), (half, 0, 0), (half, length, 0), (-half, length, 0)], [(0, 1, 2, 3)], floor)
    # A barrel vault on walls, closed at both ends.
    arc = [(half * math.cos(a), 4 + half * math.sin(a)) for a in np.linspace(0, math.pi, 33)]
    outline = [(half, 0.0)] + arc + [(-half, 0.0)]
    v = [(x, y, z) for y in (0, length) for x, z in outline]
    n = len(outline)
    vault = [(i, i + 1, n + i + 1, n + i) for i in range(n - 1)] + [tuple(range(n)), tuple(range(2 * n - 1, n - 1, -1))]
    s.mesh("vault", v, vault, stone)
    column = s.turned("column", [(0.45, 0), (0.45, 0.2), (0.3, 0.35), (0.27, 3.7), (0.45, 4.0), (0.5, 4.2)], stone, 32, (-4.2, bay / 2, 0))
    for i in range(options.bays):
        for x in (-4.2, 4.2):
            if (x, i) != (-4.2, 0):
                s.copy_of(column, (x, bay * (i + 0.5), 0))
        for x in (-2.0, 2.0):
            s.box("bench", (x - 1.3, bay * (i + 0.3), 0.42), (x + 1.3, bay * (i + 0.42), 0.48), wood, bevel=0.01)
            s.box("bench back", (x - 1.3, bay * (i + 0.3), 0.48), (x + 1.3, bay * (i + 0.31), 0.95), wood, bevel=0.01)
    # Lamps hang along the ribs in colours between candle and daylight; lamps of one colour share their data.
    kinds = [("candle", (1.0, 0.62, 0.28)), ("warm", (1.0, 0.8, 0.55)), ("white", (1.0, 0.95, 0.9)), ("day", (0.75, 0.87, 1.0))]
    power = 2500.0 / options.lamps
    for i in range(options.lamps):
        name, colour = kinds[rng.choice(4, p=(0.4, 0.35, 0.15, 0.1))]
        rib = rng.integers(options.bays + 1)
        a = rng.uniform(0.05, math.pi - 0.05)
        r = half - rng.uniform(0.15, 0.5)
        y = np.clip(bay * rib + rng.normal(0, 0.12), 0.1, length - 0.1)
        s.lamp(name, "POINT", (r * math.cos(a), y, 4 + r * math.sin(a)), power, colour=colour, shadow_soft_size=0.0)
    s.camera((1.2, 1.0, 1.9), (-0.3, length * 0.6, 3.0), 22)
    s.finish(options)


main()
