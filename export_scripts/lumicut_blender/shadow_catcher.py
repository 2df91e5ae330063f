# SPDX-License-Identifier: Apache-2.0
"""Shadow catchers: what the camera sees of them is how much darker all other objects make them, as in Cycles.

Three frames of the same camera samples: the whole scene; the same with the catchers as holes to the camera, which leaves
the other objects; the catchers as the camera sees them, but lit as if they were alone, by the world and by lamps that are
marked as catchers too. A fourth, empty one has the world behind them, where the film is not transparent."""
import dataclasses

import numpy as np

from .lumicut import library

PASS = "Shadow Catcher"


def is_needed(data):
    return any(mesh.catcher for mesh in data.meshes)


def scenes(data):
    """{name: scene} of those beside the whole one."""
    hidden = data.environment
    if hidden is not None:
        hidden = library.Environment.from_buffer_copy(hidden)
        hidden.flags |= library.HIDDEN
    objects = [_as_hole(mesh, data.held_out) if mesh.catcher else mesh for mesh in data.meshes]
    catchers = [mesh if mesh.catcher else dataclasses.replace(_as_hole(mesh, data.held_out), mask=library.CAMERA_RAYS)
                for mesh in data.meshes if mesh.catcher or (mesh.mask or library.ALL_RAYS) & library.CAMERA_RAYS]
    lamps = [light for light in data.lights if light[0] not in data.added_lamps]
    out = {"objects": dataclasses.replace(data, meshes=objects, environment=hidden),
           "clean": dataclasses.replace(data, meshes=catchers, lights=lamps)}
    if shows_world(data):
        out["world"] = dataclasses.replace(data, meshes=[], lights=[])
    return out


def shows_world(data):
    """Whether camera rays that miss all see the environment."""
    return not data.transparent and data.environment is not None and not data.environment.flags & library.HIDDEN


def _as_hole(mesh, held_out):
    """A mesh of which the camera sees nothing; other rays see it as it is."""
    hole = dataclasses.replace(mesh, material=held_out[mesh.material] if mesh.materials is None else 0)
    if mesh.materials is not None:
        table = np.zeros(max(held_out) + 1, np.uint32)
        table[list(held_out)] = list(held_out.values())
        hole.materials = table[mesh.materials]
    return hole


def shade(whole, objects, clean, cover):
    """What is left of the catchers' light, (h, w, 3): 1 where there is none of them. `cover`: of all objects, (h, w, 1)."""
    rest = whole - objects
    known = clean > 0
    left = np.where(known, rest / np.where(known, clean, 1), 0)
    # A colour that does not light the catcher goes by the others.
    left = np.where(known, left, left.sum(-1, keepdims=True) / np.maximum(1, known.sum(-1, keepdims=True)))
    left = np.where(known.any(-1, keepdims=True), left, 1)
    return 1 - cover + cover * left


def alpha(objects_cover, left):
    """Of the image: objects, and shadows beside them."""
    return objects_cover + (1 - objects_cover) * (1 - np.clip(left.mean(-1, keepdims=True), 0, 1))


def over(whole, cover, caught, behind, opaque, channel="radiance"):
    """(colour, alpha) of the image with the catchers' shadows. `whole`, `cover`: radiance and alpha of the whole scene;
    `caught`: {name: {channel: pixels}} of the scenes beside it; `behind`: what the camera sees behind all, where the film is
    `opaque` and no scene "world" shows it; `channel`: which of a frame's images is wanted."""
    left = shade(whole, caught["objects"]["radiance"], caught["clean"]["radiance"], 1 if "world" in caught else cover)
    colour, covered = caught["objects"][channel], alpha(caught["objects"]["alpha"], left)
    if not opaque:
        return colour, covered
    return colour + (caught["world"]["radiance"] if "world" in caught else behind) * (1 - covered), np.ones_like(covered)
