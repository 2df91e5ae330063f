"""A court with a colonnade under an evening sky. The sky is computed: a gradient, a glow around the sun, and the sun."""
import math

from scene_writer import ROOT, Obj, write_exr, write_scene

FOLDER = ROOT / "reference_images/court"
SUN_ELEVATION, SUN_AZIMUTH = math.radians(28), math.radians(215)  # azimuth counted from +x towards -z


def sky(direction):
    """Radiance from a direction, y up. Ground below the horizon."""
    x, y, z = direction
    if y < 0:
        return (0.12, 0.11, 0.1)
    sun = (math.cos(SUN_ELEVATION) * math.cos(SUN_AZIMUTH), math.sin(SUN_ELEVATION), -math.cos(SUN_ELEVATION) * math.sin(SUN_AZIMUTH))
    angle = math.acos(max(-1.0, min(1.0, sum(a * b for a, b in zip(direction, sun)))))
    haze = math.exp(-4 * y)
    colour = [zenith * (1 - haze) + horizon * haze for zenith, horizon in zip((0.28, 0.5, 1.0), (1.1, 0.95, 0.75))]
    glow = 1.6 * math.exp(-angle / 0.25)
    # The disk is a few pixels wide, softened, with as much irradiance as a low sun has over this sky.
    disk = 4000.0 * math.exp(-((angle / 0.03) ** 2))
    return tuple(c + (glow + disk) * k for c, k in zip(colour, (1.0, 0.82, 0.55)))


def sky_pixel(width, height):
    def pixel(px, py):
        # Inverse of the library's map: u = 1/2 - atan2(y,x)/2pi, v = 1/2 + atan2(z,..)/pi, with map z = world y, map y = -world z.
        azimuth = (0.5 - (px + 0.5) / width) * 2 * math.pi
        elevation = (0.5 - (py + 0.5) / height) * math.pi
        return sky((math.cos(elevation) * math.cos(azimuth), math.sin(elevation), -math.cos(elevation) * math.sin(azimuth)))

    return pixel


def main():
    court = Obj()
    half, height = 6.0, 5.0
    court.quad("paving", (-14, 0, -14), (0, 0, 28), (28, 0, 0))
    # Walls behind a gallery on three sides; the side towards the camera (+z) is open.
    court.box("plaster", (-9.4, 0, -9.4), (9.4, height, -9.0))
    court.box("plaster", (-9.4, 0, -9.0), (-9.0, height, 6.0))
    court.box("plaster", (9.0, 0, -9.0), (9.4, height, 6.0))
    # The gallery's roof.
    court.box("tiles", (-9.0, 3.4, -9.0), (9.0, 3.6, -half))
    court.box("tiles", (-9.0, 3.4, -half), (-half, 3.6, 6.0))
    court.box("tiles", (half, 3.4, -half), (9.0, 3.6, 6.0))
    for i in range(7):
        court.column("stone", -half + 0.2 + i * (2 * half - 0.4) / 6, -half + 0.2, 0.22, 0, 3.4)
    for i in range(1, 7):
        for x in (-half + 0.2, half - 0.2):
            court.column("stone", x, -half + 0.2 + i * 1.9, 0.22, 0, 3.4)
    # A basin, steps and a few blocks of colour.
    for y, r in ((0.25, 2.0), (0.5, 1.6)):
        court.box("stone", (-r, 0, -r - 0.5), (r, y, r - 0.5))
    court.box("water", (-1.4, 0.5, -1.9), (1.4, 0.52, 0.9))
    court.column("stone", 0, -0.5, 0.25, 0.5, 1.8)
    court.box("stone", (-0.6, 1.8, -1.1), (0.6, 1.95, 0.1), turn=45)
    court.box("red", (-8.6, 0, -4.0), (-7.6, 1.4, -3.0), turn=15)
    court.box("blue", (7.4, 0, -1.0), (8.6, 1.0, 0.4), turn=-10)
    court.box("green", (-4.2, 0, -8.6), (-2.8, 1.2, -7.8))
    court.write(FOLDER / "court.obj", {
        "paving": ((0.42, 0.38, 0.33), (0.05, 0.05, 0.05), 20),
        "plaster": ((0.72, 0.62, 0.48), (0, 0, 0), 1),
        "tiles": ((0.5, 0.24, 0.15), (0, 0, 0), 1),
        "stone": ((0.6, 0.58, 0.54), (0, 0, 0), 1),
        "water": ((0.05, 0.1, 0.12), (0.4, 0.4, 0.4), 200),
        "red": ((0.6, 0.12, 0.1), (0, 0, 0), 1),
        "blue": ((0.12, 0.2, 0.5), (0, 0, 0), 1),
        "green": ((0.15, 0.38, 0.14), (0, 0, 0), 1),
    })
    width, rows = 256, 128
    write_exr(FOLDER / "sky.exr", width, rows, sky_pixel(width, rows))
    write_scene(FOLDER / "court.json", {
        "description": "A court under an evening sky, given as an environment map. Made by export_scripts/scenes/court.py",
        "image": {"size": [320, 240]},
        "camera": {"eye": [3.6, 2.3, 10.5], "at": [-0.6, 1.5, -2], "fov_y": 50},
        "meshes": [{"obj": "court.obj"}],
        "environment": {"image": "sky.exr"},
    })


if __name__ == "__main__":
    main()
