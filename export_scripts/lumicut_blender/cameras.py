# SPDX-License-Identifier: Apache-2.0
"""Cameras: of frames, of both eyes, of 3D views; and the border that is rendered."""
import math

import numpy as np
from mathutils import Matrix

from .lumicut import library


def rows(matrix):
    """The upper 3x4 of a matrix, row-major."""
    return [c for row in matrix[:3] for c in row]


def crop_of(render, width, height):
    """(x0, y0, x1, y1), rows from the top, of the border; the whole where there is none.

    In single precision, as Blender cuts its images: 0.9 of 60 rows is 54, and not 53.999999."""
    if not render.use_border:
        return 0, 0, width, height

    def cut(share, size):
        return int(np.float32(share) * np.float32(size))

    x0, x1 = cut(render.border_min_x, width), cut(render.border_max_x, width)
    y0, y1 = cut(render.border_min_y, height), cut(render.border_max_y, height)
    x0, y0 = min(max(x0, 0), width - 1), min(max(y0, 0), height - 1)
    x1, y1 = max(min(x1, width), x0 + 1), max(min(y1, height), y0 + 1)
    return x0, height - y1, x1, height - y0


def views_of(engine, scene, report):
    """[(name of the view, library.Camera)]: one without a name, or what stereoscopy asks for. The views share all else."""
    def camera_now():
        camera = engine.camera_override or scene.camera
        if camera is None:
            raise library.Error(library.INVALID_STATE, "the scene has no camera")
        return camera

    if engine.is_preview or not scene.render.use_multiview:
        return [("", convert_camera(camera_now(), scene, report))]
    result = engine.begin_result(0, 0, 1, 1)
    names = [view.name for view in result.views]
    engine.end_result(result, cancel=True)
    views = []
    for name in names:
        engine.active_view_set(name)
        camera = camera_now()
        if camera.data.type == "PANO" and camera.data.stereo.use_spherical_stereo:
            report.note(camera.name, "Spherical stereo taken as plain")
        views.append((name, convert_camera(camera, scene, report, Matrix(engine.camera_model_matrix(camera)),
                                           engine.camera_shift_x(camera))))
    return views


def fit(render, camera_data):
    """(horizontal, sensor width along the fitted side, aspect-corrected width and height)."""
    width = render.resolution_x * render.pixel_aspect_x
    height = render.resolution_y * render.pixel_aspect_y
    mode = camera_data.sensor_fit
    horizontal = mode == "HORIZONTAL" or (mode == "AUTO" and width >= height)
    return horizontal, camera_data.sensor_height if mode == "VERTICAL" else camera_data.sensor_width, width, height


def pixel_width(camera, render):
    """Of a pixel of the frame as a share of the distance from a camera object; 0: no camera, or an orthographic one."""
    if camera is None or camera.type != "CAMERA" or camera.data.type == "ORTHO":
        return 0.0
    rows = max(1.0, render.resolution_y * render.resolution_percentage / 100)
    if camera.data.type == "PANO":
        return math.pi / rows
    horizontal, sensor, width, height = fit(render, camera.data)
    return sensor / camera.data.lens / (width / height if horizontal else 1.0) / rows


LIKE_EQUISOLID = 0.002  # radians from which a lens shows to be another: a pixel where 800 span a right angle


def equisolid_like(coefficients, half_fov, radius):
    """(focal length of the equisolid lens nearest to a polynomial one, by what how many radians they differ at most), out to
    `radius` on the sensor; None where the polynomial does not open."""
    r = np.linspace(0, radius, 257)[1:]
    angle = -np.polynomial.polynomial.polyval(r, coefficients)
    r, angle = r[(angle > 0) & (angle < half_fov)], angle[(angle > 0) & (angle < half_fov)]
    if not len(r):
        return None
    lenses = r[-1] / (2 * np.sin(np.linspace(0.5, 1.5, 2001) * 0.5 * min(angle[-1], 2.0)))
    worst = [np.abs(2 * np.arcsin(np.minimum(1, r / (2 * lens))) - angle).max() for lens in lenses]
    return float(lenses[np.argmin(worst)]), min(worst)


def set_panorama(out, camera, aspect, shift_x, report):
    """Makes `out` the panorama of a camera; False where there is none of its kind. `aspect`: of the image."""
    data = camera.data
    own = data if hasattr(data, "panorama_type") else data.cycles  # Blender 4.3 and later: its own
    kind = own.panorama_type
    if kind == "EQUIRECTANGULAR":
        out.panorama = library.EQUIRECTANGULAR
        out.longitude[:] = [own.longitude_min, own.longitude_max]
        out.latitude[:] = [own.latitude_min, own.latitude_max]
    elif kind in {"FISHEYE_EQUIDISTANT", "FISHEYE_EQUISOLID", "FISHEYE_LENS_POLYNOMIAL"}:
        out.panorama = getattr(library, kind, library.FISHEYE_EQUISOLID)
        out.fisheye_fov = min(own.fisheye_fov, 2 * math.pi)
        out.fisheye_lens = own.fisheye_lens
        # In millimetres; the side that the sensor fits has its size, the other follows from the image.
        horizontal = data.sensor_fit == "HORIZONTAL" or (data.sensor_fit == "AUTO" and aspect >= 1)
        if horizontal:
            out.sensor[:] = [data.sensor_width, data.sensor_width / aspect]
        else:
            side = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
            out.sensor[:] = [side * aspect, side]
        if kind == "FISHEYE_LENS_POLYNOMIAL":
            like = equisolid_like([getattr(own, f"fisheye_polynomial_k{k}") for k in range(5)], out.fisheye_fov / 2, math.hypot(*out.sensor) / 2)
            if like is None:
                report.note(f"{camera.name} (Fisheye Lens Polynomial)", "Panoramas taken as perspective ones")
                out.panorama = 0
                return False
            out.fisheye_lens = like[0]
            if like[1] > LIKE_EQUISOLID:
                report.note(f"{camera.name} ({math.degrees(like[1]):.1f} degrees off at most)", "Polynomial fisheyes, taken as the nearest equisolid lens")
    elif kind in {"MIRRORBALL", "EQUIANGULAR_CUBEMAP_FACE"}:
        out.panorama = library.MIRROR_BALL if kind == "MIRRORBALL" else library.EQUIANGULAR_CUBE
    else:
        report.note(f"{camera.name} ({kind.replace('_', ' ').title()})", "Panoramas taken as perspective ones")
        return False
    if data.dof.use_dof:
        report.note(camera.name, "Depth of field of panoramas left out")
    out.shift[:] = [shift_x, data.shift_y]
    return True


def filter_of(scene):
    """(kind, width) of the pixel filter: Cycles' own setting, and its default."""
    own = getattr(scene, "cycles", None)
    kind = getattr(library, getattr(own, "pixel_filter_type", "BLACKMAN_HARRIS"))
    return kind, 0.0 if kind == library.BOX else max(0.01, getattr(own, "filter_width", 1.5))


def convert_camera(camera, scene, report, matrix=None, shift_x=None):
    """A library.Camera of a camera object, as the scene's resolution and pixel aspect frame it.

    `matrix`, `shift_x`: of one eye, in place of the camera's own."""
    data = camera.data
    horizontal, sensor, width, height = fit(scene.render, data)
    out = library.Camera()
    m = (camera.matrix_world if matrix is None else matrix).normalized()
    shift_x = data.shift_x if shift_x is None else shift_x
    out.to_world[:] = rows(m)
    # What is given along the fitted side, in image heights.
    heights = width / height if horizontal else 1.0
    out.pixel_aspect = scene.render.pixel_aspect_x / scene.render.pixel_aspect_y
    out.shift[:] = [shift_x * heights, data.shift_y * heights]
    out.near_clip, out.far_clip = data.clip_start, data.clip_end
    if data.type == "PANO" and set_panorama(out, camera, width / height, shift_x, report):
        return out
    if data.type == "ORTHO":
        out.orthographic = 1
        out.height = data.ortho_scale / heights
    else:
        out.fov_y = 2 * math.atan(sensor / (2 * data.lens) / heights)
    if data.dof.use_dof:
        distance = data.dof.focus_distance
        if data.dof.focus_object is not None:
            offset = data.dof.focus_object.matrix_world.translation - m.translation
            distance = abs(offset @ m.col[2].to_3d())
        stop = max(data.dof.aperture_fstop, 1e-5)
        if distance > 0:
            out.lens_radius = (1.0 if data.type == "ORTHO" else data.lens * 1e-3) / (2 * stop)
            out.focus_distance = distance
        if data.dof.aperture_blades > 2 or abs(data.dof.aperture_ratio - 1) > 1e-3:
            report.note(camera.name, "Shapes of the aperture taken as a disk")
    return out


def on_film(camera, width, height, places):
    """Where a library.Camera of an image of width x height pixels sees places (n, 3): pixels to the right and up from a place
    of its own. None for other panoramas than equirectangular ones."""
    axes = np.array(camera.to_world[:], np.float64).reshape(3, 4)
    x, y, z = ((places - axes[:, 3]) @ axes[:, :3]).T
    if camera.panorama == library.EQUIRECTANGULAR:
        span = [ends[1] - ends[0] for ends in (camera.longitude, camera.latitude)]
        return np.stack([np.arctan2(x, -z) / span[0] * width,
                         np.arctan2(y, np.hypot(x, z)) / span[1] * height], -1)
    if camera.panorama:
        return None
    heights = np.full_like(z, camera.height) if camera.orthographic else -2 * z * math.tan(camera.fov_y / 2)
    heights = np.where(np.abs(heights) > 1e-9, heights, 1e-9)
    shift = np.array(camera.shift[:])
    return (np.stack([x, y], -1) / heights[:, None] - shift) * height / (camera.pixel_aspect or 1, 1)


def viewport_camera(context, width, height):
    """A library.Camera of a 3D view of width x height pixels."""
    region, space = context.region_data, context.space_data
    out = library.Camera(pixel_aspect=1.0)
    out.to_world[:] = rows(region.view_matrix.inverted_safe().normalized())
    projection = region.window_matrix  # the view's own: lens, zoom, offset of camera views, all in one
    out.orthographic = 0 if region.is_perspective else 1
    half_width, half_height = 1 / projection[0][0], 1 / projection[1][1]
    if region.is_perspective:
        out.fov_y = 2 * math.atan(half_height)
        out.shift[:] = [projection[0][2] * half_width / (2 * half_height), projection[1][2] / 2]
        out.near_clip, out.far_clip = space.clip_start, space.clip_end
    else:
        out.height = 2 * half_height
        out.shift[:] = [-projection[0][3] * half_width / (2 * half_height), -projection[1][3] / 2]
        # Orthographic views look from within: begin far behind.
        back = np.array(region.view_matrix.inverted_safe())[:3, 2]
        for k in range(3):
            out.to_world[4 * k + 3] += float(back[k]) * space.clip_end * 0.5
    return out
