"""Cycles with what a denoiser takes, after so many samples: to be denoised, and measured by `lumicut compare`.

    blender -b room.blend --addons cycles,lumicut_blender -P bench/blender_denoised.py -- --output cycles --size 240x180 --samples 20 35 100

Writes cycles_20.exr ... with the passes Noisy Image, Denoising Albedo and Denoising Normal, and prints the CPU seconds of
each render. Nothing is clamped or blurred, light bounces on, and samples lie in a box of one pixel, as Lumicut's do: so both
converge to one image.
"""
import argparse
import resource
import sys

import bpy


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--output", required=True)
    parser.add_argument("--size", default="240x180")
    parser.add_argument("--samples", type=int, nargs="+", default=[20, 35, 100])
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine, render.threads_mode, render.threads = "CYCLES", "FIXED", 1
    render.resolution_x, render.resolution_y = map(int, options.size.split("x"))
    render.resolution_percentage = 100
    render.use_compositing = False
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    cycles.device, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", True, False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 32
    cycles.transparent_max_bounces = 32
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.pixel_filter_type = "BOX"
    bpy.context.view_layer.cycles.denoising_store_passes = True
    for samples in options.samples:
        cycles.samples = samples
        render.filepath = f"{options.output}_{samples}.exr"
        before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
        bpy.ops.render.render(write_still=True)
        print(f"{samples} samples: {resource.getrusage(resource.RUSAGE_SELF).ru_utime - before:.1f} CPU s", flush=True)


main()
