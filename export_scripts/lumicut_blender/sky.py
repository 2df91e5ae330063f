# SPDX-License-Identifier: Apache-2.0
"""Worlds that cannot be read node by node (Sky Texture, gradients, noise, mixes), rendered once by Cycles into an image.

Blender evaluates no node for Python, and a render cannot begin within another. So the world alone goes to a second Blender
without a window (sky_bake.py); the user's scene is not touched. What came of it is kept by the settings of the world's nodes.
"""
import dataclasses
import pathlib
import subprocess
import tempfile
import threading
import time

import bpy
import numpy as np

WIDTH = 1024  # of the image, which is half as high
KEPT = 8      # images
PATIENCE = 300.0  # seconds for the other Blender; it takes a few
POLL = 0.04
NOT_LOOKS = {"rna_type", "name", "label", "outputs", "location", "location_absolute", "width", "width_hidden", "height", "dimensions",
             "color", "use_custom_color", "select", "show_options", "show_preview", "hide", "show_texture", "parent",
             "internal_links", "is_active_output", "interface", "warning_propagation"}


class BakeError(RuntimeError):
    pass


@dataclasses.dataclass
class Baked:
    pixels: np.ndarray  # (h, w, 3) float32, radiance, top row first
    suns: list          # (direction towards it, irradiance, angular diameter)


def facts(item, depth=0):
    """What a node tree, or a part of one, looks like: nested tuples of plain values."""
    if item is None or depth > 12:
        return None
    if isinstance(item, bpy.types.NodeTree):
        links = tuple((l.from_node.name, l.from_socket.identifier, l.to_node.name, l.to_socket.identifier,
                       getattr(l, "is_muted", False)) for l in item.links)
        return tuple((node.name, facts(node, depth + 1)) for node in item.nodes), links
    if isinstance(item, bpy.types.Image):
        return item.name_full, item.filepath, tuple(item.size), item.source, item.colorspace_settings.name
    if isinstance(item, bpy.types.ID):
        return item.name_full
    out = [item.bl_rna.identifier]
    for prop in item.bl_rna.properties:
        key = prop.identifier
        if key == "rna_type" or (isinstance(item, bpy.types.Node) and key in NOT_LOOKS):
            continue
        value = getattr(item, key, None)
        if isinstance(item, bpy.types.NodeSocket):
            if key != "default_value":
                continue
            value = tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value
        elif prop.type == "POINTER":
            value = facts(value, depth + 1)
        elif prop.type == "COLLECTION":
            value = tuple(facts(v, depth + 1) for v in value)
        elif getattr(prop, "is_array", False):
            value = tuple(np.ravel(value).tolist())
        out.append((key, value))
    if isinstance(item, bpy.types.Node) and item.bl_idname in {"ShaderNodeRGB", "ShaderNodeValue"}:
        out.append(facts(item.outputs[0], depth + 1))
    return tuple(out)


class Process:
    """The other Blender at work on one world."""

    def __init__(self, world, frame):
        self.folder = tempfile.TemporaryDirectory(prefix="lumicut_sky_")
        folder = pathlib.Path(self.folder.name)
        self.result = folder / "sky.npz"
        bpy.data.libraries.write(str(folder / "world.blend"), {world}, path_remap="ABSOLUTE", fake_user=True)
        self.output = open(folder / "output.txt", "w+b")
        self.process = subprocess.Popen(
            [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "1",
             "-P", str(pathlib.Path(__file__).with_name("sky_bake.py")), "--", str(folder / "world.blend"), world.name,
             str(frame), str(WIDTH), str(self.result)],
            stdin=subprocess.DEVNULL, stdout=self.output, stderr=subprocess.STDOUT)
        self.started = time.monotonic()

    def running(self):
        if self.process.poll() is not None:
            return False
        if time.monotonic() > self.started + PATIENCE:
            self.process.kill()
        return True

    def take(self):
        """Baked, once it no longer runs, or the text of what failed."""
        try:
            if self.process.returncode == 0 and self.result.exists():
                with np.load(self.result) as data:
                    return Baked(data["pixels"], [(s[:3], s[3:6], float(s[6])) for s in data["suns"]])
            self.output.seek(0)
            lines = [l for l in self.output.read().decode(errors="replace").splitlines() if "Error" in l]
            return lines[-1].strip() if lines else f"Blender ended with {self.process.returncode}"
        finally:
            self.close()

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.output.close()
        self.folder.cleanup()


_kept, _running = {}, {}  # by facts, the oldest first; _running: what bake_later began


def _keep(key, process):
    _kept[key] = process.take()
    while len(_kept) > KEPT:
        del _kept[next(iter(_kept))]


def _result(key):
    found = _kept[key] = _kept.pop(key)
    if isinstance(found, str):
        raise BakeError(found)
    return found


def _in_main_thread(fn, check):
    """fn() where Blender's own data may be walked. From a render's thread: at the interface's next turn."""
    if threading.current_thread() is threading.main_thread():
        return fn()
    done = []

    def turn():
        try:
            done.append((fn(), None))
        except Exception as error:  # handed over to the caller
            done.append((None, error))

    bpy.app.timers.register(turn, first_interval=0)
    end = time.monotonic() + PATIENCE
    while not done:
        check()
        if time.monotonic() > end:
            raise BakeError("the interface did not answer")
        time.sleep(POLL)
    if done[0][1] is not None:
        raise done[0][1]
    return done[0][0]


def bake(world, frame, check=lambda: None):
    """The Baked of an evaluated world. Waits for it; `check` is called meanwhile, and raises to stop."""
    key = facts(world.node_tree)
    if key not in _kept:
        try:
            process = _in_main_thread(lambda: Process(world.original, frame), check)
        except (OSError, RuntimeError) as error:
            raise BakeError(str(error)) from error
        try:
            while process.running():
                check()
                time.sleep(POLL)
        except BaseException:
            process.close()
            raise
        _keep(key, process)
    return _result(key)


def bake_later(world, frame, check=lambda: None):
    """The same at once, from the interface's thread: None while the other Blender is at work. poll() tells when it ended."""
    key = facts(world.node_tree)
    if key in _kept:
        return _result(key)
    if key not in _running:
        stop_all()  # of an earlier look
        try:
            _running[key] = Process(world.original, frame)
        except (OSError, RuntimeError) as error:
            raise BakeError(str(error)) from error
    return None


def poll():
    """Whether something that bake_later began has ended since."""
    ended = [key for key, process in _running.items() if not process.running()]
    for key in ended:
        _keep(key, _running.pop(key))
    return bool(ended)


def stop_all():
    while _running:
        _running.popitem()[1].close()
