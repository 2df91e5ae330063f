# SPDX-License-Identifier: Apache-2.0
"""Lumicut from Python: scenes from arrays, images to arrays. docs/python.md has examples.

library.py has lumicut.h whole; here are the names for every day, and what is common to scripts."""
import math

from . import library
from .library import (  # noqa: F401
    BLEND_STORED, BY_VIEW, CLAMP, DENOISE, DISK, EMIT_BOTH_SIDES, FOREVER, GGX, GROUPS, ILLUMINANCE, NEAREST, NO_ID, PHONG, POINT, POINT_TO_SHADE, RADIOMETRIC, RAYHIT,
    RECTANGLE, SPOT, SRGB, SUN, UNSUPPORTED, VPL, VPL_DIRECTIONAL, VPL_OMNI, VPL_ORIENTED, VPL_ORIGIN, VPL_SPHERE, VPL_SPOT, WATT, Accel,
    Camera, Cancelled, Environment, Error, Integrator, LibraryMissing, Light, Material, Render, Scene)

_loaded = {}


def load(path=""):
    """The library: of `path` (a file or a folder), of the environment variable LUMICUT_LIBRARY, or the system's."""
    if path not in _loaded:
        _loaded[path] = library.Library(path)
    return _loaded[path]


def Device(threads=0, path="", log=None):
    """Where scenes, methods and accels live; `threads` 0: all. log(level, text) hears what the library has to say."""
    return library.Device(load(path), threads, log)


def integrators(path=""):
    """[IntegratorRow]: id, label, parameters, suggested values."""
    return load(path).integrators()


def presets(path=""):
    """{id: PresetRow}, from the quickest on: named qualities for whole frames, for render()'s `preset`."""
    return {row.id: row for row in load(path).presets()[0]}


def look_at(eye, target, up=(0, 0, 1), fov_y=math.radians(50), **fields):
    """A camera at `eye` that looks at `target`. `fov_y` in radians; other fields as in lumicut_camera."""
    def unit(v):
        length = math.sqrt(sum(x * x for x in v))
        if not length > 0:
            raise ValueError(f"look_at: eye {tuple(eye)}, target {tuple(target)} and up {tuple(up)} give no direction")
        return [x / length for x in v]

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    back = unit([e - t for e, t in zip(eye, target)])
    right = unit(cross(up, back))
    above = cross(back, right)
    rows = [x for i in range(3) for x in (right[i], above[i], back[i], eye[i])]
    return Camera(to_world=tuple(rows), fov_y=fov_y, **fields)


def render(scene, integrator="lightcuts", width=320, height=240, samples=1, channels="radiance", progress=None, passes=1, max_seconds=0.0,
           target_error=0.0, flags=0, preset=None, **parameters):
    """An image of a committed scene, (height, width, components) float32, top row first; with a list of channels a dictionary
    of them. `integrator`: a name, or an Integrator that is kept between calls. `parameters` are the method's (`vpls`, `error`,
    `seed`, ...). `preset`: a name of presets(), in place of integrator, samples, passes and target_error; parameters change it.
    progress(share, phase) is called about ten times a second; where it returns False the render is cancelled,
    which raises Cancelled, as an interrupt does."""
    if preset is not None:
        rows = {row.id: row for row in scene.device.library.presets()[0]}
        if preset not in rows:
            raise ValueError(f"preset {preset!r}: there are {', '.join(rows)}")
        row = rows[preset]
        integrator, samples, passes, target_error, flags = row.integrator, row.samples, row.passes, row.target_error, flags | row.flags
        parameters = row.parameters | parameters
    method = Integrator(scene.device, integrator) if isinstance(integrator, str) else integrator
    for name, value in parameters.items():
        method.set(name, str(value).lower() if isinstance(value, bool) else value)
    with Render(method, scene, width, height, samples, passes=passes, max_seconds=max_seconds, target_error=target_error,
                flags=flags) as job:
        try:
            while True:
                status = job.wait(100)
                if status.state != library.RUNNING:
                    break
                if progress is not None and progress(status.fraction, (status.phase or b"").decode()) is False:
                    job.cancel()
        except KeyboardInterrupt:
            job.cancel()
            raise
        if isinstance(channels, str):
            return job.read(channels)
        return {channel: job.read(channel) for channel in channels}
