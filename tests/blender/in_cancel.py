"""Cancelling in each phase: how often the button is looked at, and how much is still done once it was pressed.

In CPU seconds of the process: unlike seconds of the clock, a busy machine does not stretch them.
"""
import os
import time
import unittest

import bpy
import numpy as np

import helpers as h
from lumicut_blender import engine, images, properties

# The goal is half a second. All threads may be at work in it, on a processor half as fast.
MOST_CPU = 0.5 * 2 * len(os.sched_getaffinity(0))


class Watch:
    """Looks over the engine's shoulder and answers "stop" at the n-th poll of a phase."""

    def __init__(self, phase, poll=1):
        self.phase, self.poll = phase, poll
        self.now, self.polls, self.stopped = "", {}, None
        self.last, self.longest = None, {}  # process CPU at the last poll; the most between two, by phase
        self.written_after = 0

    def is_stopped(self, engine):
        cpu = time.process_time()
        if self.last is not None and self.stopped is None:
            self.longest[self.now] = max(self.longest.get(self.now, 0.0), cpu - self.last)
        self.last = cpu
        self.polls[self.now] = self.polls.get(self.now, 0) + 1
        if self.stopped is None and self.now.startswith(self.phase) and self.polls[self.now] >= self.poll:
            self.stopped = cpu
        return self.stopped is not None

    def say(self, engine, phase, fraction=None):
        self.now = phase

    def run(self):
        cls = engine.LumicutEngine
        saved = {name: getattr(cls, name) for name in ("_render", "_write", "is_stopped", "say")}
        ended = []

        def render(this, depsgraph):
            self.last = time.process_time()
            try:
                saved["_render"](this, depsgraph)
            finally:
                ended.append(time.process_time())

        def write(*arguments):
            self.written_after += self.stopped is not None
            saved["_write"](*arguments)

        try:
            cls._render, cls._write = render, write
            cls.is_stopped, cls.say = (lambda this: self.is_stopped(this)), (lambda *arguments: self.say(*arguments))
            bpy.ops.render.render()
        except RuntimeError as error:
            assert "cancelled" in str(error), error
        finally:
            for name, call in saved.items():
                setattr(cls, name, call)
        self.spent = ended[0] - self.stopped if self.stopped is not None else None


def grid(name, side):
    """A wavy sheet of 2 side² triangles in a few numpy lines."""
    x, y = np.meshgrid(np.linspace(-3, 3, side + 1), np.linspace(-3, 3, side + 1))
    co = np.stack([x, y, 0.2 * np.sin(5 * x) * np.cos(7 * y)], -1).reshape(-1, 3).astype(np.float32)
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    quads = np.stack([a, a + 1, a + side + 2, a + side + 1], 1).astype(np.int32)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(co))
    mesh.vertices.foreach_set("co", co.reshape(-1))
    mesh.loops.add(quads.size)
    mesh.loops.foreach_set("vertex_index", quads.reshape(-1))
    mesh.polygons.add(len(quads))
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    mesh.polygons.foreach_set("loop_total", np.full(len(quads), 4, np.int32))
    mesh.update(calc_edges=True)
    mesh.polygons.foreach_set("use_smooth", np.ones(len(quads), bool))
    return h.link(bpy.data.objects.new(name, mesh))


class Cancel(unittest.TestCase):
    """One scene of 180,000 triangles in one mesh, stopped in each phase in turn."""

    def setUp(self):
        self.begin(300)

    def begin(self, side):
        h.new_scene(256, 256)
        grid("sheet", side).data.materials.append(h.diffuse())
        for k in range(8):
            h.add_light("AREA", (np.cos(k), np.sin(k), 2), 50, size=0.3)

    def stop(self, phase, poll):
        watch = Watch(phase, poll)
        with h.quiet():
            watch.run()
        with self.subTest(phase=phase, poll=poll):
            self.assertIsNotNone(watch.stopped, f"never polled in this phase: {watch.polls}")
            self.assertLess(watch.spent, MOST_CPU, "from the stop to the end")
            self.assertEqual(watch.written_after, 0, "tiles written after the stop")
            for name, seconds in watch.longest.items():
                self.assertLess(seconds, MOST_CPU, f"between two looks at the button, in: {name}")
        return watch

    def test_each_phase_is_polled_and_ends_soon(self):
        # Collecting: before the mesh, in the midst of it, while it is handed over. As many lights as make the phase long.
        for phase, lights, polls in (("collecting the scene", 1000, (1, 5, 12)), ("acceleration structure", 1000, (1,)),
                                     ("light paths", 3000000, (1, 3)), ("light tree", 200000, (1, 2)), ("render", 20000, (1, 5))):
            h.set_lumicut("lightcuts", 64, vpls=lights, error=0.0)
            for poll in polls:
                self.stop(phase, poll)

    def test_each_integrator_ends_soon_while_it_renders(self):
        self.begin(100)  # the phases before are not its subject
        for name in (row.id for row in properties.tables.integrators):
            with self.subTest(integrator=name):
                h.set_lumicut(name, 1024, vpls=20000)
                self.stop("render", 2)

    def test_a_big_image_is_read_in_pieces(self):
        side = 2048
        image = bpy.data.images.new("big", side, side)
        m = h.material("big")
        node = m.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        m.node_tree.links.new(node.outputs[0], h.shader(m, "ShaderNodeBsdfDiffuse").inputs["Color"])
        h.add_plane(1, 1, m, "poster")
        watch = Watch("never")
        h.set_lumicut("lightcuts", 1, vpls=100)
        with h.quiet():
            watch.run()
        self.assertIsNone(watch.stopped)
        self.assertGreater(watch.polls["collecting the scene"], side * side * 4 // images.SLAB)
        self.assertLess(watch.longest["collecting the scene"], MOST_CPU)
