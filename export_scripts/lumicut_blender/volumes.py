# SPDX-License-Identifier: Apache-2.0
"""What volume shaders absorb inside of glass. What they scatter or emit is left out, by name."""
import numpy as np

from .nodes import input_of

SCATTERED = "Volumes that scatter, of which absorption inside glass is rendered alone"


def absorption(reader, socket, stack=()):
    """Absorption, 1/length of the world, of the shader that feeds a Volume socket: three numbers."""
    node, _, stack = reader.source(socket, stack)
    if node is None:
        return np.zeros(3)
    kind = node.type
    if kind == "VOLUME_ABSORPTION":
        return density_of(reader, node, stack) * np.maximum(0, 1 - colour_of(reader, node.inputs["Color"], stack))
    if kind == "PRINCIPLED_VOLUME":
        # The attributes are grids of volume objects; those of the default names multiply by 1 where there are none.
        if any(reader.number(node.inputs[name], stack, "volume") > 0 for name in ("Emission Strength", "Blackbody Intensity")):
            reader.note("Principled Volume", "Volumes that emit, whose light is left out")
        # Cycles: the colour is scattered, and the root of the absorption colour counts.
        scattered = colour_of(reader, node.inputs["Color"], stack)
        kept = np.sqrt(np.maximum(0, colour_of(reader, node.inputs["Absorption Color"], stack)))
        if scattered.any():
            reader.note("Principled Volume", SCATTERED)
        return density_of(reader, node, stack) * np.maximum(0, 1 - scattered) * np.maximum(0, 1 - kept)
    if kind == "ADD_SHADER":
        return sum(absorption(reader, node.inputs[i], stack) for i in (0, 1))
    if kind == "MIX_SHADER":
        share = min(1.0, max(0.0, reader.number(node.inputs[0], stack, "volume")))
        return (1 - share) * absorption(reader, node.inputs[1], stack) + share * absorption(reader, node.inputs[2], stack)
    reader.note(node.bl_label or kind, SCATTERED if kind in ("VOLUME_SCATTER", "SUBSURFACE_SCATTERING") else "Volumes left out")
    return np.zeros(3)


def colour_of(reader, socket, stack):
    value = reader.value(socket, stack)
    if value.picture is not None:
        reader.note("volume", "Textures taken as their mean")
    return np.broadcast_to(np.asarray(value.mean(), float), 3)


def density_of(reader, node, stack):
    return max(0.0, reader.number(input_of(node, "Density"), stack, "volume"))
