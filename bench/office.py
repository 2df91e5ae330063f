#!/usr/bin/env python3
"""An office building as a scene file: rooms along corridors, ten lamps in each, the camera in one of them.

    bench/office.py -o office.json                        40 rooms, 400 lamps
    bench/office.py --lamps point -o points.json          its ceiling lamps are points
    bench/office.py --rows 1 --columns 1 -o room.json     one room of it, with what the camera sees of its corridor

Rooms are 4 m wide, 5 m deep and 2.8 m high. Two rows of rooms share a corridor, to which each has an open door. Eight
flat lamps hang below each ceiling, two lamps above desks are emissive meshes; the camera sees none of them, whose edges would be
most of the error. Metres, z up.
"""
import argparse
import json
import random

WIDTH, DEPTH, HEIGHT, WALL, CORRIDOR = 4.0, 5.0, 2.8, 0.15, 2.0
DOOR_LEFT, DOOR_WIDTH, DOOR_HEIGHT = 0.6, 1.0, 2.1


class Building:
    def __init__(self, lamps):
        self.lamps = lamps  # the kind of those on the ceiling
        self.parts = {}  # material → (positions, quads)
        self.lights = []

    def box(self, material, low, high):
        positions, quads = self.parts.setdefault(material, ([], []))
        n = len(positions)
        positions += [[x, y, z] for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])]
        quads += [[n + i for i in face] for face in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))]

    def lamp(self, low, high, z):  # shines down
        positions, quads = self.parts.setdefault("desk lamp", ([], []))
        n = len(positions)
        positions += [[low[0], low[1], z], [low[0], high[1], z], [high[0], high[1], z], [high[0], low[1], z]]
        quads.append([n, n + 1, n + 2, n + 3])

    def room(self, x, corridor, away, rng):
        """A room from x on, whose door is at y = corridor; `away`: +1 or -1, the side it lies on."""
        def box(material, low, high):  # y counts from the corridor
            y = sorted((corridor + away * low[1], corridor + away * high[1]))
            self.box(material, (x + low[0], y[0], low[2]), (x + high[0], y[1], high[2]))

        paint = rng.choice(("plaster", "sand", "sky", "rose"))
        box(paint, (0, DEPTH, 0), (WIDTH, DEPTH + WALL, HEIGHT))
        box("plaster", (0, 0, 0), (DOOR_LEFT, WALL, HEIGHT))
        box("plaster", (DOOR_LEFT + DOOR_WIDTH, 0, 0), (WIDTH, WALL, HEIGHT))
        box("plaster", (DOOR_LEFT, 0, DOOR_HEIGHT), (DOOR_LEFT + DOOR_WIDTH, WALL, HEIGHT))
        box(paint, (WIDTH, 0, 0), (WIDTH + WALL, DEPTH + WALL, HEIGHT))
        for desk, left in ((0, 0.4), (1, 2.3)):
            near, far = DEPTH - 1.3 - 0.2 * rng.random(), DEPTH - 0.3
            box("wood", (left, near, 0.7), (left + 1.3, far, 0.74))
            for side in (left, left + 1.25):
                box("steel", (side, near, 0), (side + 0.05, far, 0.7))
            box("black", (left + 0.35, far - 0.3, 0.9), (left + 0.95, far - 0.26, 1.25))
            box("black", (left + 0.62, far - 0.28, 0.74), (left + 0.68, far - 0.24, 0.9))
            box("chair", (left + 0.4, near - 0.5, 0.42), (left + 0.85, near - 0.05, 0.48))
            box("chair", (left + 0.4, near - 0.5, 0.48), (left + 0.85, near - 0.45, 0.95))
            box("steel", (left + 0.6, near - 0.3, 0), (left + 0.65, near - 0.25, 0.42))
            lamp = left + 0.3 + 0.2 * rng.random()  # on the wall
            box("steel", (lamp, far - 0.1, 1.3), (lamp + 0.5, DEPTH, 1.34))
            self.lamp((x + lamp, corridor + away * (far + 0.03) - 0.1), (x + lamp + 0.5, corridor + away * (far + 0.03) + 0.1), 1.295)
        box("wood", (WIDTH - 0.45, 0.6, 0), (WIDTH - 0.02, 2.2, 1.1 + rng.random()))
        for i in range(2):
            for j in range(4):
                lamp = {"type": self.lamps, "position": [x + 1.2 + 1.6 * i, corridor + away * (0.8 + 1.15 * j), HEIGHT - 0.06]}
                if self.lamps == "rectangle":
                    lamp |= {"u": [0.0, 0.15, 0.0], "v": [1.0, 0.0, 0.0], "value": 14.0}
                else:
                    lamp |= {"value": 1.0}
                self.lights.append(lamp)

    def corridor(self, length, y):
        self.box("lino", (-WALL, y - DEPTH - WALL - CORRIDOR / 2, -0.1), (length + WALL, y + DEPTH + WALL + CORRIDOR / 2, 0))
        self.box("plaster", (-WALL, y - DEPTH - WALL - CORRIDOR / 2, HEIGHT), (length + WALL, y + DEPTH + WALL + CORRIDOR / 2, HEIGHT + 0.1))
        for x in (-WALL, length):
            self.box("plaster", (x, y - DEPTH - WALL - CORRIDOR / 2, 0), (x + WALL, y + DEPTH + WALL + CORRIDOR / 2, HEIGHT))


MATERIALS = [
    {"name": "plaster", "diffuse": [0.75, 0.74, 0.7]},
    {"name": "sand", "diffuse": [0.7, 0.6, 0.4]},
    {"name": "sky", "diffuse": [0.4, 0.55, 0.7]},
    {"name": "rose", "diffuse": [0.7, 0.45, 0.4]},
    {"name": "lino", "model": "ggx", "diffuse": [0.3, 0.32, 0.3], "roughness": 0.45},
    {"name": "wood", "model": "ggx", "diffuse": [0.5, 0.32, 0.16], "roughness": 0.5},
    {"name": "steel", "diffuse": [0.45, 0.45, 0.47]},
    {"name": "black", "diffuse": [0.04, 0.04, 0.045]},
    {"name": "chair", "diffuse": [0.1, 0.15, 0.3]},
    {"name": "desk lamp", "diffuse": [0.5, 0.5, 0.5], "emission": [15.0, 12.0, 8.0]},
]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=4, help="rows of rooms, two to a corridor")
    parser.add_argument("--columns", type=int, default=10, help="rooms in a row")
    parser.add_argument("--lamps", choices=("rectangle", "point"), default="rectangle", help="on the ceiling")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", required=True)
    options = parser.parse_args()
    rng = random.Random(options.seed)
    building = Building(options.lamps)
    pitch = 2 * (DEPTH + WALL) + CORRIDOR
    for pair in range((options.rows + 1) // 2):
        y = pair * pitch
        building.corridor(options.columns * (WIDTH + WALL), y)
        for row in range(min(2, options.rows - 2 * pair)):
            away = 1 - 2 * row
            for column in range(options.columns):
                building.room(column * (WIDTH + WALL), y + away * CORRIDOR / 2, away, rng)
        if options.rows - 2 * pair == 1:
            building.box("plaster", (0, y - CORRIDOR / 2 - WALL, 0), (options.columns * (WIDTH + WALL), y - CORRIDOR / 2, HEIGHT))
    x, y = (options.columns // 2) * (WIDTH + WALL), CORRIDOR / 2
    scene = {
        "description": f"{options.rows * options.columns} rooms, {10 * options.rows * options.columns} lamps (bench/office.py)",
        "up": "z",
        "image": {"size": [160, 120], "samples": 1},
        "camera": {"eye": [x + WIDTH - 0.5, y + 2.0, 1.6], "at": [x + 1.2, y + DEPTH - 0.5, 0.9], "fov_y": 62},
        "materials": MATERIALS,
        "meshes": [{"name": m, "positions": p, "quads": q, "material": m} for m, (p, q) in building.parts.items()],
        "lights": building.lights,
    }
    with open(options.output, "w") as f:
        json.dump(scene, f)
        f.write("\n")


if __name__ == "__main__":
    main()
