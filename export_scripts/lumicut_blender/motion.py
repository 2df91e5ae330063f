# SPDX-License-Identifier: Apache-2.0
"""The pass Vector: how what pixels show moves, from the hits of the frame's own samples.

As Cycles has it: in pixels to the right and up, from where it is to where it was a frame before, and from where it will be a
frame later to where it is; of a pixel the mean over what its samples meet, and 0 where they meet nothing."""
import numpy as np

from . import cameras
from . import collect as collecting
from .lumicut import library
from .report import Report
from .scene_data import is_mirrored

PASS = "Vector"


def collect(engine, depsgraph, data, views, images, report, check):
    """A Motion of collected data, that has owners. Takes the scene to the frames before and after, and back."""
    scene = depsgraph.scene
    now, fraction = scene.frame_current, scene.frame_subframe
    if any(camera.panorama not in (0, library.EQUIRECTANGULAR) for _, camera in views):
        report.note(scene.camera.name, "Vector passes of fisheye cameras, which are 0")
    moments, then = [], None
    try:
        for step in (-1, 1):
            engine.frame_set(now + step, fraction)
            check()
            then = collecting.Collector(depsgraph, None, check, images=images, hits=True).collect()
            moments.append(Moment(data, then, cameras.views_of(engine, depsgraph.scene_eval, Report())))
    finally:
        engine.frame_set(now, fraction)
        images.frame = now
    return Motion(data, views, moments)


class Moment:
    """Of each mesh of `data` its positions and transforms in another frame, `then`; its own where it is not there."""

    def __init__(self, data, then, views):
        self.cameras = [camera for _, camera in views]
        others = {}
        for mesh in then.meshes:
            others.setdefault(mesh.name, []).append(mesh)
        self.positions, self.transforms = [], []
        for mesh in data.meshes:
            of_name = others.get(mesh.name)
            other = of_name.pop(0) if of_name else None
            same = other is not None and other.positions.shape == mesh.positions.shape and \
                np.array_equal(other.indices, mesh.indices)
            self.positions.append(other.positions if same else mesh.positions)
            self.transforms.append(self._paired(data, mesh, then, other) if other is not None else mesh.transforms)

    @staticmethod
    def _paired(data, mesh, then, other):
        """Transforms by their objects, of which each may have several in a row."""
        if len(other.transforms) == len(mesh.transforms):
            return other.transforms
        of_owner = {}
        for owner, transform in zip(other.owners, other.transforms):
            of_owner.setdefault(then.objects[owner].name, []).append(transform)
        found = []
        for owner, transform in zip(mesh.owners, mesh.transforms):
            at = of_owner.get(data.objects[owner].name)
            found.append(at.pop(0) if at else transform)
        return found


class Motion:
    def __init__(self, data, views, moments):
        """`moments`: the one before, the one after."""
        self._cameras = [camera for _, camera in views]
        # Corners as the library has them: a mirrored mesh that stands alone is turned over [scene_data.baked].
        self._indices = [mesh.indices[:, [0, 2, 1]] if len(mesh.transforms) == 1 and is_mirrored(mesh.transforms[0])
                         else mesh.indices for mesh in data.meshes]
        self._places = [(mesh.positions, np.array(mesh.transforms, np.float64).reshape(-1, 3, 4)) for mesh in data.meshes]
        self._moments = [(moment, [np.array(t, np.float64).reshape(-1, 3, 4) for t in moment.transforms]) for moment in moments]

    def of_hits(self, hits, view, width, height):
        """(pixels, 4) of hits (pixels, samples) by the camera of that view."""
        seen = hits["mesh"] != library.NO_ID
        vectors = np.zeros((*hits.shape, 4))
        for number in np.unique(hits["mesh"][seen]):
            at = hits["mesh"] == number
            found = hits[at]
            corners = self._indices[number][found["triangle"]]
            weights = np.stack([1 - found["u"] - found["v"], found["u"], found["v"]], -1).astype(np.float64)

            def on_film(positions, transforms, camera, found=found, corners=corners, weights=weights):
                local = (positions[corners] * weights[..., None]).sum(1)
                m = transforms[found["instance"]]
                return cameras.on_film(camera, width, height, (m[:, :, :3] @ local[..., None])[..., 0] + m[:, :, 3])

            here = on_film(*self._places[number], self._cameras[view])
            if here is None:
                continue
            before, after = (on_film(moment.positions[number], transforms[number], moment.cameras[view])
                             for moment, transforms in self._moments)
            vectors[at] = np.concatenate([before - here, here - after], -1)
        return (vectors.sum(1) / np.maximum(1, seen.sum(1, keepdims=True))).astype(np.float32)
