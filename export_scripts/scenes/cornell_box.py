"""A box after Cornell's: red and green walls, two blocks, one lamp in the ceiling. After the idea of Goral et al. 1984."""
from scene_writer import ROOT, Obj, write_scene

FOLDER = ROOT / "reference_images/cornell_box"


def main():
    box = Obj()
    s = 2.0  # the room is s wide, high and deep, open towards the camera at +z
    box.quad("white", (0, 0, 0), (0, 0, s), (s, 0, 0))      # floor, faces +y
    box.quad("white", (0, s, 0), (s, 0, 0), (0, 0, s))      # ceiling, faces -y
    box.quad("white", (0, 0, 0), (s, 0, 0), (0, s, 0))      # back, faces +z
    box.quad("red", (0, 0, 0), (0, s, 0), (0, 0, s))        # left, faces +x
    box.quad("green", (s, 0, 0), (0, 0, s), (0, s, 0))      # right, faces -x
    box.box("white", (1.1, 0, 0.95), (1.68, 0.6, 1.53), turn=-17)
    box.box("shiny", (0.35, 0, 0.4), (0.95, 1.2, 1.0), turn=20)
    box.write(FOLDER / "cornell_box.obj", {
        "white": ((0.73, 0.73, 0.73), (0, 0, 0), 1),
        "red": ((0.63, 0.06, 0.05), (0, 0, 0), 1),
        "green": ((0.14, 0.45, 0.09), (0, 0, 0), 1),
        "shiny": ((0.4, 0.4, 0.42), (0.3, 0.3, 0.3), 60),
    })
    write_scene(FOLDER / "cornell_box.json", {
        "description": "Two blocks in a box with a red and a green wall, lit by one lamp. Made by export_scripts/scenes/cornell_box.py",
        "image": {"size": [256, 256]},
        "camera": {"eye": [1, 1, 6.6], "at": [1, 1, 0], "fov_y": 24},
        "meshes": [{"obj": "cornell_box.obj"}],
        "lights": [{"type": "rectangle", "position": [1, 1.995, 1], "u": [0.6, 0, 0], "v": [0, 0, 0.5], "value": 16,
                    "color": [1, 0.85, 0.6], "visible": True}],
    })


if __name__ == "__main__":
    main()
