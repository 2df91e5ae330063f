"""Panoramas and pixel filters beside Cycles."""
import math
import unittest

import bpy
import numpy as np

import helpers as h

CUBE = ([(x, y, z) for z in (-0.6, 0.6) for x, y in ((-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (-0.6, 0.6))],
        [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])


class Panoramas(unittest.TestCase):
    """Six boxes of colours of their own around the camera, on a transparent film."""

    def compare(self, size=(40, 40), own=(), **values):
        scene = h.new_scene(*size)
        scene.render.film_transparent = True
        bpy.context.view_layer.use_pass_z = True
        for axis in range(3):
            for side in (-3, 3):
                colour = np.eye(3)[axis] if side > 0 else 1 - np.eye(3)[axis]
                box = h.add_mesh("Box", *CUBE, h.emission(1, colour))
                box.location[axis] = side
        camera = scene.camera
        camera.location, camera.rotation_euler, camera.data.type = (0.2, 0.1, 0.1), (1.3, 0.1, 0.4), "PANO"
        of_cycles = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
        for name, value in values.items():
            setattr(of_cycles, name, value)
        for name, value in dict(own).items():
            setattr(camera.data, name, value)
        ours, theirs = h.both(256, 16)
        # Without alpha: what a fisheye does not show is clear here, and black in Cycles.
        a, b = (h.blocks(image["Combined"][..., :3]) for image in (ours, theirs))
        self.assertLess(np.abs(a - b).max(), 0.12)  # outlines of 16 samples
        self.assertLess(np.abs(a - b).mean(), 0.01)
        near, far = ours["Depth"], theirs["Depth"]
        inside = (near < 1e9) & (far < 1e9)
        self.assertLess(np.median(np.abs(near - far)[inside]), 0.05, "depth is the distance")
        return ours["Combined"]

    def test_equirectangular(self):
        self.compare((64, 32), panorama_type="EQUIRECTANGULAR")

    def test_a_part_of_it(self):
        self.compare((48, 32), panorama_type="EQUIRECTANGULAR", longitude_min=-1.0, longitude_max=2.0, latitude_min=-0.5, latitude_max=1.0)

    def test_fisheye_equidistant(self):
        image = self.compare(panorama_type="FISHEYE_EQUIDISTANT", fisheye_fov=math.radians(200))
        self.assertEqual(image[0, 0, 3], 0, "beyond the circle there is nothing")
        self.compare((64, 32), panorama_type="FISHEYE_EQUIDISTANT", fisheye_fov=math.radians(300))

    def test_fisheye_equisolid(self):
        of_sensor = {"panorama_type": "FISHEYE_EQUISOLID", "fisheye_fov": 3.0, "fisheye_lens": 10.5}
        self.compare((48, 32), **of_sensor)
        self.compare((32, 48), **of_sensor)
        self.compare((48, 32), (("sensor_fit", "VERTICAL"), ("sensor_height", 20)), **of_sensor)

    def test_mirror_ball(self):
        self.compare((48, 48), panorama_type="MIRRORBALL")

    def test_equiangular_cube_face(self):
        self.compare((48, 48), panorama_type="EQUIANGULAR_CUBEMAP_FACE")

    def test_lens_shift(self):
        shift = (("shift_x", 0.1), ("shift_y", -0.15))
        self.compare((64, 32), shift, panorama_type="EQUIRECTANGULAR")
        self.compare((32, 48), shift, panorama_type="FISHEYE_EQUISOLID", fisheye_fov=3.0, fisheye_lens=10.5)

    def test_polynomial_fisheyes_are_near_an_equisolid_one(self):
        for size, fov, listed in (((40, 40), 3.0, True), ((48, 32), 3.0, True), ((40, 40), 0.5, False)):
            with self.subTest(size=size, fov=fov):
                self.compare(size, panorama_type="FISHEYE_LENS_POLYNOMIAL", fisheye_fov=fov)
                self.assertEqual(any("nearest equisolid" in note for note in h.last_notes()), listed)

    def test_others_are_listed(self):
        scene = h.new_scene(8, 8)
        data = scene.camera.data
        data.type = "PANO"
        own = data if hasattr(data, "panorama_type") else data.cycles
        own.panorama_type = "FISHEYE_LENS_POLYNOMIAL"
        for k in range(5):
            setattr(own, f"fisheye_polynomial_k{k}", 0.0)
        with h.quiet():
            h.set_lumicut(vpls=10)
            h.render()
        self.assertIn("Panoramas taken as perspective ones: Camera (Fisheye Lens Polynomial)", h.last_notes())


class Filters(unittest.TestCase):
    def test_each_kind_and_width(self):
        for kind, width in (("BOX", 1.0), ("GAUSSIAN", 1.5), ("BLACKMAN_HARRIS", 1.5), ("BLACKMAN_HARRIS", 4.0)):
            with self.subTest(kind=kind, width=width):
                scene = h.new_scene(24, 24)
                half = h.add_mesh("Half", [(0.013, -5, 0), (5, -5, 0), (5, 5, 0), (0.013, 5, 0)], [(0, 1, 2, 3)], h.emission(1))
                half.rotation_euler = (0, 0, 0.0)
                with h.quiet():
                    h.set_cycles(4096)
                    scene.cycles.pixel_filter_type, scene.cycles.filter_width = kind, width
                    theirs = h.render()["Combined"][..., 0].mean(0)
                    h.set_lumicut(samples=64, passes=4, vpls=10)
                    ours = h.render()["Combined"][..., 0].mean(0)
                np.testing.assert_allclose(ours, theirs, atol=0.01)  # the edge, pixel by pixel
