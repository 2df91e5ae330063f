# SPDX-License-Identifier: Apache-2.0
"""Light and shadow linking (Blender 4.0 and later): which objects an emitter lights, and which stand before it.

The library has sets by number: an emitter names one of receivers and one of blockers, a mesh those that it is not in."""
from typing import NamedTuple

MOST_RECEIVERS, MOST_BLOCKERS = 32, 27
BEYOND = f"Light linking beyond {MOST_RECEIVERS} sets of receivers or {MOST_BLOCKERS} of blockers left out"


class Links(NamedTuple):
    """As lumicut_mesh has them."""
    not_lit_by: int = 0
    not_blocking: int = 0
    receivers: int = 0
    blockers: int = 0


NONE = Links()


def members(collection):
    """(included, excluded): names of a linking collection's objects. A child collection counts with all below it."""
    sides = set(), set()

    def add(objects, state):
        sides[state == "EXCLUDE"].update(ob.name_full for ob in objects)

    for ob, link in zip(collection.objects, collection.collection_objects):
        add([ob], link.light_linking.link_state)
    for child, link in zip(collection.children, collection.collection_children):
        add(child.all_objects, link.light_linking.link_state)
    return frozenset(sides[0]), frozenset(sides[1])


def has(sides, name):
    """Where some are included, those alone; else all but the excluded ones."""
    included, excluded = sides
    return (name in included or not included) and name not in excluded


class Linking:
    """All sets of a scene, read before its objects are."""

    def __init__(self, depsgraph, report):
        self.of_emitters, self.receivers, self.blockers = {}, [], []
        for ob in depsgraph.objects:
            linking = getattr(ob, "light_linking", None)
            if linking is None:
                return
            if linking.receiver_collection or linking.blocker_collection:
                self.of_emitters[ob.name_full] = tuple(
                    self._number(sets, collection, most, ob, report)
                    for sets, collection, most in ((self.receivers, linking.receiver_collection, MOST_RECEIVERS),
                                                   (self.blockers, linking.blocker_collection, MOST_BLOCKERS)))
        self.cache = {}

    @staticmethod
    def _number(sets, collection, most, ob, report):
        if collection is None:
            return 0
        sides = members(collection)
        if not any(sides):  # Blender takes an empty one for none
            return 0
        if sides not in sets:
            if len(sets) == most:
                report.note(ob.name, BEYOND)
                return 0
            sets.append(sides)
        return 1 + sets.index(sides)

    def of(self, ob):
        if not self.of_emitters:
            return NONE
        name = ob.name_full
        if name not in self.cache:
            bits = (sum(1 << i for i, sides in enumerate(sets) if not has(sides, name)) for sets in (self.receivers, self.blockers))
            self.cache[name] = Links(*bits, *self.of_emitters.get(name, (0, 0)))
        return self.cache[name]
