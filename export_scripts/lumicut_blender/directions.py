# SPDX-License-Identifier: Apache-2.0
"""Vector inputs that are directions: those of IES textures and of the world's images."""
import numpy as np
from mathutils import Euler

from .nodes import Evaluator


class Directions(Evaluator):
    """Follows a vector input that is a direction, turned by Mapping nodes."""

    plain = ()  # (type, output) of nodes that give the direction as it is

    def direction(self, socket, stack):
        """The rotation that an input applies to the direction; None: not followed."""
        node, output, stack = self.source(socket, stack)
        if node is None or (node.type, output.name) in self.plain:
            return np.eye(3)
        if node.type == "MAPPING":
            inner = self.direction(node.inputs["Vector"], stack)
            own_values = {n: node.inputs[n] for n in ("Location", "Rotation", "Scale") if n in node.inputs}
            if inner is None or any(s.is_linked for s in own_values.values()):
                return None
            if "Location" in own_values and any(abs(c) > 1e-6 for c in own_values["Location"].default_value):
                self.note("location", "Moves and scales of directions left out")
            if any(abs(c - 1) > 1e-6 for c in own_values["Scale"].default_value):
                self.note("scale", "Moves and scales of directions left out")
            turn = np.array(Euler(own_values["Rotation"].default_value, "XYZ").to_matrix())
            return (turn.T if node.vector_type == "TEXTURE" else turn) @ inner
        return None
