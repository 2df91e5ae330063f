# SPDX-License-Identifier: Apache-2.0
"""Where Blender's Python interface differs between versions: 3.4 to 4.3 are tested, of 5.x what its release notes say.
(Units and shaders that Cycles changed are where they are used: they are measured, not looked up.)"""
import bpy

try:
    from bl_ui.properties_material import panel_node_draw
except ImportError:  # private to Blender's own panels: may move
    def panel_node_draw(layout, tree, _output_type, input_name):
        output = tree.get_output_node("ALL")
        if output is not None and input_name in output.inputs:
            layout.template_node_view(tree, output, output.inputs[input_name])

# Blender 5.0 has these passes by longer names.
LONG_PASS_NAMES = {"IndexOB": "Object Index", "IndexMA": "Material Index", "Emit": "Emission", "Env": "Environment",
                   "AO": "Ambient Occlusion"}
LONG_PASS_NAMES |= {short + what: f"{long} {means}" for short, long in (("Diff", "Diffuse"), ("Gloss", "Glossy"), ("Trans", "Transmission"))
                    for what, means in (("Dir", "Direct"), ("Ind", "Indirect"), ("Col", "Color"))}
LONG_PASS_NAMES |= {"VolumeDir": "Volume Direct", "VolumeInd": "Volume Indirect"}


def pass_name(short):
    return LONG_PASS_NAMES[short] if bpy.app.version >= (5, 0, 0) else short


# Normal Map of tangents: the strength scales what lies along the surface, and leaves some of the rest; 3.4 mixes normals,
# which is the same for maps of unit length and strengths up to 1. Measured.
NORMAL_MAPS_BY_SLOPE = bpy.app.version >= (4, 3, 0)
# Of area lamps whose axes are oblique. Measured.
SHEARED_FROM_CORNER = bpy.app.version < (4, 3, 0)
SHEARED_DISKS_LOSE_SPREAD = bpy.app.version >= (4, 3, 0)
RECTANGLES_NEED_NO_AXIS = bpy.app.version < (4, 3, 0)  # to shine on both sides; disks do. Measured
NORMALS_BY_COFACTORS = bpy.app.version >= (4, 3, 0)  # in Vector Transform; 3.4 turns them as vectors. Measured
FLAT_RECTS = bpy.app.version >= (4, 1, 0)  # pixels of passes are set as one row of numbers


def has_denoiser():
    """Whether the compositor's Denoise node does something: some are built without Open Image Denoise. (Cycles knows; where
    there is no Cycles, nobody does.)"""
    try:
        import _cycles
    except ImportError:
        return True
    return bool(getattr(_cycles, "with_openimagedenoise", True))


def has_nodes(owner):
    """Whether a material, world or light is described by nodes: always from 5.0 on, where the switch is deprecated."""
    return bool(getattr(owner, "use_nodes", True)) and getattr(owner, "node_tree", None) is not None


def shows_nodes_switch(owner):
    return hasattr(owner, "use_nodes") and bpy.app.version < (5, 0, 0)


def compositor_tree(scene):
    """The scene's compositor nodes, or None. 5.0 has them in a node group of their own."""
    if hasattr(scene, "compositing_node_group"):
        return scene.compositing_node_group
    return scene.node_tree if getattr(scene, "use_nodes", False) else None


def make_compositor_tree(scene):
    if hasattr(scene, "compositing_node_group"):
        if scene.compositing_node_group is None:
            scene.compositing_node_group = bpy.data.node_groups.new("Compositor Nodes", "CompositorNodeTree")
        return scene.compositing_node_group
    scene.use_nodes = True
    return scene.node_tree


def compositor_image_input(tree):
    """The socket that the compositor's image goes into, made where there is none."""
    output = next((n for n in tree.nodes if n.type in {"COMPOSITE", "GROUP_OUTPUT"}), None)
    if output is None:
        if hasattr(bpy.types, "CompositorNodeComposite"):  # gone in 5.0
            output = tree.nodes.new("CompositorNodeComposite")
        else:
            output = tree.nodes.new("NodeGroupOutput")
    if output.type == "GROUP_OUTPUT" and "Image" not in output.inputs:
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    return output.inputs["Image"]
