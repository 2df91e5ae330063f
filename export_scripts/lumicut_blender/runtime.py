# SPDX-License-Identifier: Apache-2.0
"""What lives as long as the add-on is on: the library, one device, and what the last render said of itself."""
import pathlib

import bpy

from .lumicut import library

FOLDER = pathlib.Path(__file__).parent / "lib"  # of the zip
_state = {"library": None, "failure": "", "device": None, "threads": None, "accels": {}}
last = {"stats": {}, "notes": [], "entries": [], "collect_seconds": 0.0, "seconds": 0.0, "integrator": "", "scene": {}}


def preferences():
    addon = bpy.context.preferences.addons.get(__package__)
    return addon.preferences if addon else None


def preference_path():
    p = preferences()
    return bpy.path.abspath(p.library_path) if p is not None and p.library_path else ""


def load(path=None):
    """Looks for the library again. Keeps the reason where there is none."""
    release()
    try:
        _state["library"], _state["failure"] = library.Library(preference_path() if path is None else path, FOLDER), ""
    except library.LibraryMissing as reason:
        _state["library"], _state["failure"] = None, str(reason)
    return _state["library"]


def loaded():
    """The library, or None; failure() then says why."""
    return _state["library"]


def failure():
    return _state["failure"]


def require():
    if _state["library"] is None:
        raise library.LibraryMissing(_state["failure"] or "the Lumicut library is not loaded")
    return _state["library"]


def _log(level, text):
    print(f"lumicut: {('error', 'warning', 'info', 'debug')[min(level, 3)]}: {text}", flush=True)


def device(threads=0):
    """The one device, made anew where another number of threads is asked for. Objects keep the old one alive."""
    if _state["device"] is None or _state["threads"] != threads:
        _state["device"] = library.Device(require(), threads, log=_log, verbosity=1)
        _state["threads"] = threads
    return _state["device"]


def has_accel(name):
    """Whether the library has what traces rays by that name: Embree is left out of some."""
    if name == "bvh" or _state["library"] is None:
        return True
    if name not in _state["accels"]:
        try:
            library.Scene(library.Device(_state["library"], 1), name).close()
            _state["accels"][name] = True
        except library.Error:
            _state["accels"][name] = False
    return _state["accels"][name]


def remember(report):
    """What the panel Approximated shows."""
    last.update(notes=report.lines(), entries=report.entries())


def release():
    _state["device"] = None
    _state["accels"] = {}
    _state["library"] = None
