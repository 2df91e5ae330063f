# SPDX-License-Identifier: Apache-2.0
"""Passes of a view layer: which it asks for, what the library's channels give of them, what is left out or refused."""
import dataclasses

import numpy as np

from . import compat, hit_passes, motion, properties, shadow_catcher
from .lumicut import library

NO_DEPTH = 1e10  # as Cycles has it where nothing is hit

# Properties of view layers, and of what Cycles adds to them, for passes that are not there: shown by their names.
LEFT_OUT = {"pass_debug_sample_count": "Debug Sample Count"}


# Passes that no channel of the frame has, by the property of a view layer: made of its hits, or of frames beside it.
BESIDE = {
    "use_pass_object_index": (compat.pass_name("IndexOB"), "X", "VALUE", "hits"),
    "use_pass_material_index": (compat.pass_name("IndexMA"), "X", "VALUE", "hits"),
    "use_pass_uv": ("UV", "UVA", "VECTOR", "hits"),
    "use_pass_emit": (compat.pass_name("Emit"), "RGB", "COLOR", "frame"),
    "use_pass_environment": (compat.pass_name("Env"), "RGB", "COLOR", "frame"),
    "use_pass_ambient_occlusion": (compat.pass_name("AO"), "RGB", "COLOR", "frame"),
    "use_pass_vector": (motion.PASS, "XYZW", "VECTOR", "hits"),
    "use_pass_shadow": ("Shadow", "RGB", "COLOR", "frame"),
}
# What kinds of lobes show, apart: their light over their colour, and that colour.
LOBES = {"diffuse": ("Diff", library.DIFFUSE_RAYS), "glossy": ("Gloss", library.GLOSSY_RAYS),
         "transmission": ("Trans", library.TRANSMISSION_RAYS)}
BESIDE |= {f"use_pass_{lobe}_{what}": (compat.pass_name(short + what[:3].capitalize()), "RGB", "COLOR", "frame")
           for lobe, (short, _) in LOBES.items() for what in ("direct", "indirect", "color")}
# No volume is rendered, and where there are some they are listed: a compositor that adds these up has the rest.
VOLUMES = {f"use_pass_volume_{what}": (compat.pass_name("Volume" + what[:3].capitalize()), "RGB", "COLOR", "black")
           for what in ("direct", "indirect")}


def write_pass(render_pass, pixels):
    """pixels (h, w, channels), top row first, into a pass that counts rows from the bottom."""
    pixels = np.ascontiguousarray(pixels[::-1], np.float32)
    render_pass.rect.foreach_set(pixels.reshape(-1) if compat.FLAT_RECTS else pixels.reshape(-1, pixels.shape[2]))


def of_cycles(owner, name, otherwise):
    """A property that Cycles keeps at scenes and view layers; files have it where they were made for Cycles."""
    return getattr(getattr(owner, "cycles", None), name, otherwise)


def exposure(scene):
    """Factor of all that is light in an image (Film > Exposure)."""
    return of_cycles(scene, "film_exposure", 1.0)


def wants_denoising(layer):
    return layer.lumicut.use_pass_denoising or of_cycles(layer, "denoising_store_passes", False)


def wants_shadows_apart(layer):
    return of_cycles(layer, "use_pass_shadow_catcher", False)


def wanted(layer):
    """[(pass name, letters of its channels, kind, what fills it)] of a view layer, beside Combined and light groups.
    What fills it is a channel of the library or a method of Filler."""
    chosen = [("Depth", "Z", "VALUE", "depth")] if layer.use_pass_z else []
    if layer.use_pass_mist:
        chosen.append(("Mist", "Z", "VALUE", "mist"))
    if layer.use_pass_normal:
        chosen.append(("Normal", "XYZ", "VECTOR", "normal"))
    if getattr(layer, "use_pass_position", False):
        chosen.append(("Position", "XYZ", "VECTOR", "position"))
    for prop, row in BESIDE.items():
        if getattr(layer, prop, False):
            chosen.append(row)
    chosen += [row for prop, row in VOLUMES.items() if getattr(layer, prop, False) or of_cycles(layer, prop, False)]
    chosen += [(f"{hit_passes.CRYPTOMATTES[kind]}{i:02d}", "rgba", "COLOR", "hits") for kind in cryptomattes(layer)
               for i in range((layer.pass_cryptomatte_depth + 1) // 2)]
    chosen += [(aov.name, "RGBA" if aov.type == "COLOR" else "X", aov.type, "frame") for aov in aovs(layer)]
    if wants_shadows_apart(layer):
        chosen.append((shadow_catcher.PASS, "RGB", "COLOR", "shadow_catcher"))
    for channel, (name, prop, _, _, letters, kind) in properties.PASSES.items():
        if getattr(layer.lumicut, prop):
            chosen.append((name, letters, kind, channel))
    if wants_denoising(layer):
        chosen += [("Noisy Image", "RGBA", "COLOR", "noisy"), ("Denoising Normal", "XYZ", "VECTOR", "camera_normal"),
                   ("Denoising Albedo", "RGB", "COLOR", "denoising_albedo"), ("Denoising Depth", "Z", "VALUE", "ray_length")]
    return chosen


def holdouts(data):
    """Of each material whether it is one, where Combined shows that by alpha alone; else None."""
    held = [bool(values.flags & library.HOLDOUT) for _, values in data.materials]
    return held if any(held) and not data.transparent else None


def hit_passes_of(data, layer, motions=None, held=None):
    names = {row[0] for row in wanted(layer)}
    rows = [BESIDE[f"use_pass_{what}_index"][0] for what in ("object", "material")]
    return hit_passes.HitPasses(data, cryptomattes(layer), layer.pass_cryptomatte_depth,
                                rows if names & set(rows) else None, layer.use_pass_uv, motions, held)


def scenes_beside(data, layer, collect_aov):
    """{pass: scene} of frames whose radiance is that pass: all that shines and is seen, alone; the world behind all; what
    `collect_aov` gives for an AOV, whose values materials emit."""
    out = {aov.name: dataclasses.replace(collect_aov((aov.name, aov.type)), lights=[], environment=None,
                                         camera=data.camera) for aov in aovs(layer)}
    if layer.use_pass_emit:
        out[BESIDE["use_pass_emit"][0]] = dataclasses.replace(data, lights=[], environment=None, materials=[
            (name, _only_emission(values)) for name, values in data.materials])
    if layer.use_pass_environment:
        holes = [(name, _as_hole(values)) for name, values in data.materials]
        out[BESIDE["use_pass_environment"][0]] = dataclasses.replace(data, lights=[], materials=holes)
    if layer.use_pass_shadow:
        out |= shadow_scenes(data)
    return out


def shadow_scenes(data):
    """{name: scene}: white surfaces under the objects' lamps, each in a light group of its own, with and without shadows."""
    lamps = [(name, library.Light.from_buffer_copy(light)) for name, light in data.lights[:len(data.lights) - data.world_suns]
             if light.value > 0 and any(light.color)]
    numbers = {}
    for name, light in lamps:  # a lamp may be several lights
        light.group = 1 + numbers.setdefault(name, len(numbers)) % 255
        light.color[:] = [1.0] * 3
    alike = dataclasses.replace(data, environment=None, materials=[(name, _as_white(values)) for name, values in data.materials])
    free = [(name, library.Light.from_buffer_copy(light)) for name, light in lamps]
    for _, light in free:
        light.flags |= library.NO_SHADOWS
    return {SHADOWED: dataclasses.replace(alike, lights=lamps), UNSHADOWED: dataclasses.replace(alike, lights=free)}


SHADOWED, UNSHADOWED = "lamps with shadows", "lamps without shadows"


def of_shadows(frames):
    """The pass Shadow, as Cycles has it: of each lamp the share that nothing stands before, in the mean of the lamps; 0 for
    those that a surface does not face. `frames`: of shadow_scenes, {channel: pixels}."""
    with_shadows, without = frames[SHADOWED], frames[UNSHADOWED]
    groups = [channel for channel in without if channel.startswith("radiance.")]
    total = np.zeros_like(without["radiance"])
    for group in groups:
        lit = without[group]
        known = lit > 0
        total += np.where(known, with_shadows.get(group, np.zeros_like(lit)) / np.where(known, lit, 1), 0)
    return np.clip(total / max(1, len(groups)), 0, 1) * np.clip(without["albedo"], 0, 1)  # which is how much of a pixel is white


def of_lobes(layer, scene, frame, factor):
    """{pass: pixels}: light of kinds of lobes, ambient occlusion. `frame(name, **options)` gives the channels of a frame of
    this scene; `factor`: of all light."""
    out = {}
    world = scene.world
    if layer.use_pass_ambient_occlusion:
        out[BESIDE["use_pass_ambient_occlusion"][0]] = frame(
            "ambient occlusion", occlusion=max(1e-6, world.light_settings.distance if world is not None else 10.0))["radiance"]
    for lobe, (_, bit) in LOBES.items():
        direct, indirect, colour = (f"use_pass_{lobe}_{what}" for what in ("direct", "indirect", "color"))
        of = {}
        if getattr(layer, indirect):
            of["all"] = frame(f"{lobe} light", lobes=bit)
        if getattr(layer, direct) or getattr(layer, indirect):
            of["direct"] = frame(f"{lobe} direct", lobes=bit, flags=library.DIRECT)
        if getattr(layer, colour) and not of:
            of["colour"] = frame(f"{lobe} color", lobes=bit, occlusion=1e-6)
        if not of:
            continue
        albedo = next(iter(of.values()))["albedo"]
        known = albedo > 1e-5
        factors = np.where(known, np.float32(factor) / np.where(known, albedo, 1), 0)
        if getattr(layer, colour):
            out[BESIDE[colour][0]] = albedo
        if getattr(layer, direct):
            out[BESIDE[direct][0]] = of["direct"]["radiance"] * factors
        if getattr(layer, indirect):
            out[BESIDE[indirect][0]] = np.maximum(0, of["all"]["radiance"] - of["direct"]["radiance"]) * factors
    return out


def _only_emission(values):
    out = library.Material.from_buffer_copy(values)
    for slot in ("diffuse", "specular", "translucency"):
        getattr(out, slot)[:] = [0.0] * 3
    out.metallic = out.transmission = out.coat = 0.0
    for slot in ("diffuse", "specular", "translucency", "metallic", "roughness", "normal", "height"):
        setattr(out, slot + "_texture", 0)
    return out


def _as_white(values):
    """Of what reflects light by itself; glass lets it pass as it does."""
    out = library.Material.from_buffer_copy(values)
    reflects = any((*values.diffuse, *values.specular, *values.translucency)) or values.metallic > 0
    for slot in ("diffuse", "specular", "translucency", "emission"):
        getattr(out, slot)[:] = [float(reflects and slot == "diffuse")] * 3
    out.metallic = out.coat = 0.0
    for slot in ("diffuse", "specular", "translucency", "metallic", "roughness", "emission"):
        setattr(out, slot + "_texture", 0)
    return out


def _as_hole(values):
    out = library.Material.from_buffer_copy(values)
    out.flags |= library.HOLDOUT
    return out


def of_frame(name, layer, frame, exposure):
    """Pixels of that pass from its frame's channels."""
    aov = next((aov for aov in aovs(layer) if aov.name == name), None)
    if aov is None:
        return frame["radiance"] * np.float32(exposure)
    return frame["radiance"][..., :1] if aov.type == "VALUE" else np.concatenate([frame["radiance"], frame["alpha"]], -1)


def cryptomattes(layer):
    return [kind for kind in hit_passes.CRYPTOMATTES if getattr(layer, "use_pass_cryptomatte_" + kind, False)]


def aovs(layer):
    return [aov for aov in getattr(layer, "aovs", ()) if aov.is_valid]


def wants_hits(layer):
    return any(row[3] == "hits" for row in wanted(layer))


def added(chosen):
    """Of wanted() those that Blender does not add by itself."""
    return [row for row in chosen if row[0] not in {"Depth", "Mist", "Normal", "Position", *(row[0] for row in BESIDE.values())}]


def note_left_out(layer, report):
    own = getattr(layer, "cycles", None)
    for prop, name in LEFT_OUT.items():
        if getattr(layer, prop, False) or getattr(own, prop, False):
            report.note(name, "Passes left out")


def of_compositor(scene, layer_name):
    """Names of the layer's passes that the scene's compositor makes its image or files from."""
    tree = compat.compositor_tree(scene)
    if tree is None or not scene.render.use_compositing:
        return set()
    found, seen = set(), set()
    todo = [n for n in tree.nodes if n.type in {"COMPOSITE", "OUTPUT_FILE", "GROUP_OUTPUT"} and not n.mute]
    while todo:
        node = todo.pop()
        if node in seen:
            continue
        seen.add(node)
        for link in (link for socket in node.inputs for link in socket.links if not getattr(link, "is_muted", False)):
            source = link.from_node
            if source.type == "R_LAYERS":
                if source.scene in {None, scene} and source.layer == layer_name:
                    found.add(link.from_socket.name)
            else:
                todo.append(source)
    return found


def check_compositor(scene, layer):
    """An error where the compositor needs a pass that is not there: it would take it for white or black."""
    there = {"Image", "Combined", "Alpha"} | {row[0] for row in wanted(layer)}
    there |= {properties.GROUP_PASS + group.name for group in getattr(layer, "lightgroups", ())}
    missing = sorted(of_compositor(scene, layer.name) - there)
    if missing:
        text = f"the compositor uses passes of {layer.name} that are not rendered: {', '.join(missing)}"
        raise library.Error(library.UNSUPPORTED, text)


class Filler:
    """Pixels of one rectangle of a render. `camera`: a library.Camera. `backdrop(camera, tile)`: what it alone sees of the
    world, which is in the light group of number `group`. `denoised`: Combined and Error are. `caught`: channels of the frames
    that shadow catchers need, of this very rectangle; {}: there are none. `shadows_apart`: they have a pass of their own, as Cycles has it, not Combined. `beside`:
    passes of this very rectangle that are made of its hits, or of frames of their own."""

    def __init__(self, render, scene, camera, tile, backdrop=None, group=0, denoised=False, caught=None, shadows_apart=False, beside=None):
        self.render, self.scene, self.camera, self.tile = render, scene, camera, tile
        self._read, self._exposure, self._backdrop = {}, exposure(scene), backdrop
        self._with_backdrop = {"radiance", "denoised", "denoising_color", f"radiance.{group}"} if backdrop is not None else set()
        self._denoised, self._caught, self._shadows_apart = denoised, caught, shadows_apart
        self._beside = beside or {}
        self.hit = self.channel("alpha") > 0

    def channel(self, name):
        if name not in self._read:
            self._read[name] = self.render.read(name, self.tile)
        return self._read[name]

    def fill(self, name, source):
        """Pixels of a pass; None: not yet there."""
        if source in {"hits", "frame"}:
            return self._beside.get(name)
        own = getattr(self, source, None)
        return own() if own is not None else self.lit(source) if source.startswith("radiance") \
            else self.channel(source)

    def lit(self, channel):
        pixels = self.channel(channel)
        if channel in self._with_backdrop:
            pixels = pixels + (1 - self.channel("alpha")) * self._backdrop(self.camera, self.tile).astype(np.float32)
        return pixels if self._exposure == 1 else pixels * np.float32(self._exposure)

    def black(self):
        return np.zeros((*self.hit.shape[:2], 3), np.float32)

    def combined(self):
        return self._image("denoised" if self._denoised else "radiance") if not self._caught else self._with_caught_shadows()

    def shadow_catcher(self):
        """What is left of the catchers' light; 1 elsewhere."""
        if not self._caught:
            return np.ones((*self.hit.shape[:2], 3), np.float32)
        whole, objects, clean = self.channel("radiance"), self._caught["objects"]["radiance"], self._caught["clean"]["radiance"]
        return shadow_catcher.shade(whole, objects, clean, 1 if "world" in self._caught else self.channel("alpha"))

    def _with_caught_shadows(self):
        objects, opaque = self._caught["objects"], not self.scene.render.film_transparent
        channel = "denoised" if self._denoised else "radiance"
        behind = self._backdrop(self.camera, self.tile) if opaque and self._backdrop is not None else 0
        if self._shadows_apart:  # the catchers are holes, to be laid over the pass of their shadows
            missed = (1 - self.channel("alpha")) if opaque else 0
            behind = self._caught["world"]["radiance"] if "world" in self._caught else behind
            colour, alpha = objects[channel] + behind * missed, objects["alpha"] + missed
        else:
            colour, alpha = shadow_catcher.over(self.channel("radiance"), self.channel("alpha"), self._caught, behind, opaque, channel)
        return np.concatenate([colour * np.float32(self._exposure), alpha], -1, dtype=np.float32)

    def noisy(self):
        return self._image("denoising_color")

    def error(self):
        return self.lit("denoised_error" if self._denoised else "error")

    def _image(self, channel):
        radiance = self.lit(channel)
        out = np.ones(radiance.shape[:2] + (4,), np.float32)
        out[..., :3] = radiance
        if self.scene.render.film_transparent:
            out[..., 3:] = self.channel("alpha")
        elif hit_passes.HELD_OUT in self._beside:
            out[..., 3:] -= self._beside[hit_passes.HELD_OUT]
        return out

    def depth(self):
        return np.where(self.hit, self.channel("depth"), np.float32(NO_DEPTH))

    def distance(self):
        """From the camera's place; orthographic: from its plane. 0 where nothing is hit."""
        if self.camera.orthographic or self.camera.panorama:  # of panoramas the depth is the distance
            return self.channel("depth")
        place = np.array(self.camera.to_world[3::4], np.float32)
        return np.where(self.hit, np.linalg.norm(self.channel("position") - place, axis=-1, keepdims=True), 0)

    def mist(self):
        """As Cycles has it: from 0 at the start to 1 at start + depth, and behind everything."""
        world = self.scene.world
        start, depth, falloff = (world.mist_settings.start, world.mist_settings.depth, world.mist_settings.falloff) \
            if world is not None else (0.0, 100.0, "LINEAR")
        share = np.clip((self.distance() - start) / max(depth, 1e-6), 0, 1)
        share = share ** {"QUADRATIC": 2.0, "LINEAR": 1.0, "INVERSE_QUADRATIC": 0.5}[falloff]
        alpha = self.channel("alpha")  # what is seen through holes lies behind everything
        return np.where(self.hit, share * alpha + 1 - alpha, 1)

    def ray_length(self):
        """Of Cycles' denoiser: the distance beyond the near clipping plane."""
        depth = self.channel("depth")
        return self.distance() * (1 - self.camera.near_clip / np.maximum(depth, max(self.camera.near_clip, 1e-30)))

    def camera_normal(self):
        """Of Cycles' denoiser: right, up, and away from the viewer."""
        axes = np.array(self.camera.to_world, np.float32).reshape(3, 4)[:, :3]
        return self.channel("denoising_normal") @ (axes * np.array((1, 1, -1), np.float32))
