"""A room that no lamp lights directly: bowls on the walls and on stands throw all light at the ceiling. Glossy floor."""
from scene_writer import ROOT, Obj, write_scene

FOLDER = ROOT / "reference_images/indirect_room"
WIDTH, HEIGHT, DEPTH = 8.0, 3.2, 10.0  # metres; the camera stands near z = DEPTH and looks towards -z


def main():
    room, lights = Obj(), []
    room.quad("floor", (0, 0, 0), (0, 0, DEPTH), (WIDTH, 0, 0))
    room.quad("ceiling", (0, HEIGHT, 0), (WIDTH, 0, 0), (0, 0, DEPTH))
    room.quad("wall", (0, 0, 0), (WIDTH, 0, 0), (0, HEIGHT, 0))
    room.quad("wall", (WIDTH, 0, DEPTH), (-WIDTH, 0, 0), (0, HEIGHT, 0))
    room.quad("blue_wall", (0, 0, 0), (0, HEIGHT, 0), (0, 0, DEPTH))
    room.quad("wall", (WIDTH, 0, 0), (0, 0, DEPTH), (0, HEIGHT, 0))

    def bowl(x, y, z, colour):
        """An open box 0.4 wide; the lamp lies inside, below the rim, so that only the ceiling sees it."""
        r, rim, t = 0.2, 0.14, 0.02
        room.box("metal", (x - r, y - t, z - r), (x + r, y, z + r))
        for x0, x1, z0, z1 in ((-r, -r + t, -r, r), (r - t, r, -r, r), (-r + t, r - t, -r, -r + t), (-r + t, r - t, r - t, r)):
            room.box("metal", (x + x0, y, z + z0), (x + x1, y + rim, z + z1))
        lights.append({"type": "rectangle", "position": [x, y + 0.02, z], "u": [0, 0, 0.3], "v": [0.3, 0, 0],
                       "color": colour, "value": 60})

    warm, cool = [1.0, 0.78, 0.5], [0.75, 0.88, 1.0]
    for z in (1.5, 4.0, 6.5):
        bowl(0.22, 2.1, z, warm)
        bowl(WIDTH - 0.22, 2.1, z, warm)
    for x, z in ((2.4, 0.6), (5.6, 0.6)):
        room.column("metal", x, z, 0.03, 0, 1.88)
        bowl(x, 1.9, z, cool)

    # A table with blocks, a bench, a screen, shelves: shadows without edges, and colours that bleed.
    room.box("wood", (2.9, 0.72, 2.6), (5.1, 0.78, 4.2))
    for x in (3.0, 4.92):
        for z in (2.7, 4.02):
            room.box("wood", (x, 0, z), (x + 0.08, 0.72, z + 0.08))
    room.box("red", (3.3, 0.78, 3.0), (3.7, 1.25, 3.4), turn=25)
    room.box("white_gloss", (4.2, 0.78, 3.2), (4.5, 1.05, 3.5), turn=-15)
    room.column("white_gloss", 3.95, 3.8, 0.12, 0.78, 1.1)
    room.polygon("white_gloss", [(3.83, 1.1, 3.8), (3.95, 1.1, 3.92), (4.07, 1.1, 3.8), (3.95, 1.1, 3.68)])
    room.box("wood", (0.6, 0.4, 4.8), (1.1, 0.46, 7.0))
    room.box("wood", (0.65, 0, 4.9), (1.05, 0.4, 5.0))
    room.box("wood", (0.65, 0, 6.8), (1.05, 0.4, 6.9))
    for i in range(4):
        room.box("green", (6.4 + 0.3 * i, 0, 3.2 + 0.25 * (i % 2)), (6.43 + 0.3 * i, 1.7, 3.5 + 0.25 * (i % 2)), turn=30)
    for y in (0.5, 1.0, 1.5):
        room.box("wood", (3.2, y, 0.0), (4.8, y + 0.04, 0.3))
    for i in range(9):
        room.box(("red", "green", "white_gloss")[i % 3], (3.28 + 0.16 * i, 1.04, 0.05), (3.38 + 0.16 * i, 1.26 + 0.03 * (i % 4), 0.25))

    room.write(FOLDER / "indirect_room.obj", {
        "floor": ((0.28, 0.24, 0.2), (0.25, 0.25, 0.25), 120),
        "ceiling": ((0.85, 0.85, 0.83), (0, 0, 0), 1),
        "wall": ((0.7, 0.66, 0.6), (0, 0, 0), 1),
        "blue_wall": ((0.25, 0.36, 0.55), (0, 0, 0), 1),
        "wood": ((0.42, 0.25, 0.13), (0.08, 0.08, 0.08), 30),
        "metal": ((0.25, 0.25, 0.26), (0.35, 0.35, 0.35), 80),
        "red": ((0.6, 0.1, 0.08), (0, 0, 0), 1),
        "green": ((0.15, 0.42, 0.16), (0, 0, 0), 1),
        "white_gloss": ((0.65, 0.65, 0.65), (0.2, 0.2, 0.2), 60),
    })
    write_scene(FOLDER / "indirect_room.json", {
        "description": "A room lit only by lamps that face the ceiling, with a glossy floor. Made by export_scripts/scenes/indirect_room.py",
        "image": {"size": [320, 240]},
        "camera": {"eye": [4.6, 1.55, 9.6], "at": [3.9, 1.15, 2.5], "fov_y": 48},
        "meshes": [{"obj": "indirect_room.obj"}],
        "lights": lights,
    })


if __name__ == "__main__":
    main()
