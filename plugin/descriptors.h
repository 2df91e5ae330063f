// The fields of every descriptor in lumicut.h, in order: what the growth rule needs to know. A field that is missing
// here or out of order does not compile.
#pragma once

#include "plugin/boundary.h"

namespace lumicut {

template <size_t N>
constexpr bool fields_fill(const FieldSpan (&fields)[N], size_t size) {
  size_t end = 0;
  for (const FieldSpan& f : fields) {
    if (f.offset != end) return false;
    end += f.size;
  }
  return end == size;
}

#define LUMICUT_DESCRIPTOR(T, ...)                                                                             \
  template <>                                                                                                  \
  struct Descriptor<T> {                                                                                       \
    using S = T;                                                                                               \
    static constexpr const char* name = #T;                                                                    \
    static constexpr FieldSpan fields[] = {__VA_ARGS__};                                                       \
    static_assert(fields_fill(fields, sizeof(T)), #T " has other fields, another order, or implicit padding"); \
  }
#define F(field) \
  FieldSpan { offsetof(S, field), sizeof(S::field) }

// NOLINTBEGIN(bugprone-sizeof-expression): the sizes of the pointers are meant

LUMICUT_DESCRIPTOR(lumicut_device_desc, F(struct_size), F(abi_major), F(threads), F(verbosity), F(log), F(user));
LUMICUT_DESCRIPTOR(lumicut_status, F(struct_size), F(state), F(phase), F(fraction), F(seconds), F(tiles_done),
                   F(tiles_total), F(passes_done), F(passes_total), F(error));
LUMICUT_DESCRIPTOR(lumicut_accel_desc, F(struct_size), F(robust), F(kind), F(builder), F(positions), F(position_count),
                   F(position_stride), F(indices), F(triangle_count), F(boxes), F(box_count));
LUMICUT_DESCRIPTOR(lumicut_accel_info, F(struct_size), F(node_count), F(primitive_count), F(bytes), F(build_seconds),
                   F(expected_boxes), F(expected_primitives), F(expected_cost), F(lower), F(upper));
LUMICUT_DESCRIPTOR(lumicut_accel_node_info, F(struct_size), F(left), F(right), F(first), F(count), F(lower), F(upper));
LUMICUT_DESCRIPTOR(lumicut_scene_desc, F(struct_size), F(robust), F(accel), F(builder));
LUMICUT_DESCRIPTOR(lumicut_texture, F(struct_size), F(width), F(height), F(channels), F(format), F(flags), F(pixels),
                   F(program));
LUMICUT_DESCRIPTOR(lumicut_material, F(struct_size), F(flags), F(diffuse), F(shininess), F(specular), F(opacity),
                   F(emission), F(diffuse_texture), F(specular_texture), F(opacity_texture), F(emission_texture),
                   F(roughness), F(metallic), F(ior), F(transmission), F(normal_texture), F(normal_strength),
                   F(height_texture), F(bump_distance), F(bump_strength), F(roughness_texture), F(metallic_texture),
                   F(coat), F(coat_roughness), F(coat_ior), F(translucency), F(translucency_texture), F(specular_tint),
                   F(absorption), F(diffuse_roughness), F(diffuse_roughness_texture));
LUMICUT_DESCRIPTOR(lumicut_mesh, F(struct_size), F(mask), F(positions), F(normals), F(uvs), F(vertex_count), F(indices),
                   F(triangle_count), F(materials), F(transforms), F(transform_count), F(material), F(group),
                   F(attributes), F(attribute_count), F(not_lit_by), F(not_blocking), F(receivers), F(blockers));
LUMICUT_DESCRIPTOR(lumicut_light, F(struct_size), F(type), F(unit), F(group), F(color), F(value), F(position),
                   F(radius), F(direction), F(angle), F(u), F(blend), F(v), F(spread), F(spot_cosine), F(profile),
                   F(tangent), F(flags), F(mask), F(receivers), F(blockers), F(texture));
LUMICUT_DESCRIPTOR(lumicut_profile, F(struct_size), F(vertical_count), F(horizontal_count), F(reserved), F(vertical),
                   F(horizontal), F(values));
LUMICUT_DESCRIPTOR(lumicut_environment, F(struct_size), F(group), F(color), F(texture), F(world_to_map), F(flags),
                   F(mask));
LUMICUT_DESCRIPTOR(lumicut_camera, F(struct_size), F(orthographic), F(to_world), F(fov_y), F(height), F(shift),
                   F(near_clip), F(far_clip), F(pixel_aspect), F(lens_radius), F(focus_distance), F(panorama),
                   F(fisheye_fov), F(fisheye_lens), F(sensor), F(longitude), F(latitude));
LUMICUT_DESCRIPTOR(lumicut_trace, F(struct_size), F(batch), F(intersect), F(occluded), F(user));
LUMICUT_DESCRIPTOR(lumicut_integrator_info, F(struct_size), F(param_count), F(id), F(label), F(description), F(source),
                   F(traits), F(reserved), F(interactive), F(preview), F(draft), F(good), F(reference));
LUMICUT_DESCRIPTOR(lumicut_param_info, F(struct_size), F(type), F(id), F(label), F(description), F(unit), F(choices),
                   F(default_text), F(minimum), F(maximum));
LUMICUT_DESCRIPTOR(lumicut_render_desc, F(struct_size), F(width), F(height), F(samples), F(crop), F(tile_size),
                   F(passes), F(max_seconds), F(target_error), F(confidence), F(flags), F(checkpoint),
                   F(checkpoint_size), F(filter), F(filter_width), F(lobes), F(occlusion));
LUMICUT_DESCRIPTOR(lumicut_tile, F(struct_size), F(x0), F(y0), F(x1), F(y1));
LUMICUT_DESCRIPTOR(lumicut_channel_info, F(struct_size), F(components), F(name), F(description));

// NOLINTEND(bugprone-sizeof-expression)
#undef F
#undef LUMICUT_DESCRIPTOR

}  // namespace lumicut
