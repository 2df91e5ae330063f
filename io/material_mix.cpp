// Two materials as one: exact where their lobes are of a kind, else as near as one material comes, which is told.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/scene_builder.h"

namespace lumicut::io {

namespace {

enum class Family { matt, coated, metal, glass };

Family family_of(const lumicut_material& m) {
  if ((m.flags & LUMICUT_GGX) == 0) return Family::matt;
  if (m.metallic >= 1 && m.metallic_texture == 0) return Family::metal;
  return m.transmission >= 1 ? Family::glass : Family::coated;
}
bool is_hole(const lumicut_material& m) { return m.opacity > 0 && m.opacity <= kHole && m.opacity_texture == 0; }

}  // namespace

PaintRef SceneBuilder::colour_of(const float* factor, int32_t texture) const {
  PaintRef constant = constant_paint(Vec{factor[0], factor[1], factor[2]});
  if (texture == 0) return constant;
  const bool alone = factor[0] == 1 && factor[1] == 1 && factor[2] == 1;
  return alone ? made_of_.at(texture) : product(made_of_.at(texture), constant);
}
PaintRef SceneBuilder::number_of(float factor, int32_t texture) const {
  const float three[3] = {factor, factor, factor};
  return colour_of(three, texture);
}

uint32_t SceneBuilder::mix_materials(const std::string& name, uint32_t first, uint32_t second, const PaintRef& share) {
  const auto constant = constant_of(share);
  if (first == second || (constant && (*constant)[0] <= 0)) return first;
  if (constant && (*constant)[0] >= 1) return second;
  lumicut_material a = scene.materials.at(first).values, b = scene.materials.at(second).values;
  Paint rest;
  rest.kind = Paint::Kind::invert, rest.a = share;
  const PaintRef of_a = made(rest);
  const auto opacity = [&](const lumicut_material& m) {
    return number_of(m.opacity > 0 ? m.opacity : 1, m.opacity_texture);
  };
  const auto set_opacity = [&](lumicut_material& m, const PaintRef& value) {
    set_number(value, m.opacity, m.opacity_texture);
    m.opacity = std::max(m.opacity, kHole);
  };
  // Beside a hole: the other one, seen through in part.
  if (is_hole(a) || is_hole(b)) {
    lumicut_material& m = is_hole(a) ? b : a;
    set_opacity(m, product(opacity(m), is_hole(a) ? share : of_a));
    return add_material(name, m);
  }
  const auto tell = [&](const char* text) { approximate(fmt::format("the mix \"{}\" of materials {}", name, text)); };
  // What is no texture is of the mean; the share of one that is counts as a half.
  const auto t = static_cast<float>(constant ? (*constant)[0] : 0.5);
  const Family of_first = family_of(a), of_second = family_of(b);
  const auto either = [&](Family f) { return of_first == f || of_second == f; };
  if (either(Family::metal) && either(Family::glass)) {
    tell("is the one that it has more of");
    return t > 0.5f ? second : first;
  }
  lumicut_material m = a;
  const auto mix_colours = [&](float(lumicut_material::*factor)[3], int32_t lumicut_material::*texture) {
    set_colour(mixed(colour_of(a.*factor, a.*texture), colour_of(b.*factor, b.*texture), share), m.*factor, m.*texture);
  };
  const auto mix_numbers = [&](float lumicut_material::*factor, int32_t lumicut_material::*texture) {
    set_number(mixed(number_of(a.*factor, a.*texture), number_of(b.*factor, b.*texture), share), m.*factor, m.*texture);
  };
  m.flags = a.flags | b.flags;
  if (of_first != of_second && either(Family::metal)) {
    // Lambert beside a lobe of the metal's reflectance.
    const bool metal_first = of_first == Family::metal;
    const lumicut_material &metal = metal_first ? a : b, &base = metal_first ? b : a;
    const PaintRef of_metal = metal_first ? of_a : share, of_base = metal_first ? share : of_a;
    m = base;
    m.flags = LUMICUT_GGX | LUMICUT_NO_FRESNEL;
    set_colour(product(colour_of(base.diffuse, base.diffuse_texture), of_base), m.diffuse, m.diffuse_texture);
    set_colour(product(colour_of(metal.diffuse, metal.diffuse_texture), of_metal), m.specular, m.specular_texture);
    m.roughness = metal.roughness, m.roughness_texture = metal.roughness_texture;
    m.metallic = m.transmission = 0, m.metallic_texture = 0;
    tell("reflects alike at all angles");
  } else {
    // A matt one has no gloss; else it is as the other.
    for (auto [matt, other] : {std::pair(&a, &b), std::pair(&b, &a)})
      if (family_of(*matt) == Family::matt && family_of(*other) != Family::matt) {
        matt->roughness = other->roughness, matt->roughness_texture = other->roughness_texture;
        matt->ior = other->ior, matt->coat_ior = other->coat_ior, matt->coat_roughness = other->coat_roughness;
        std::copy_n(other->specular_tint, 3, matt->specular_tint);
        if (family_of(*other) == Family::glass) {
          std::copy_n(other->specular, 3, matt->specular), matt->specular_texture = other->specular_texture;
        } else {
          std::fill_n(matt->specular, 3, 0.0f), matt->specular_texture = 0;
        }
      }
    for (auto [bare, other] : {std::pair(&a, &b), std::pair(&b, &a)}) {
      if (bare->ior == 0) bare->ior = 1.5f;
      if (bare->coat == 0) bare->coat_ior = other->coat_ior, bare->coat_roughness = other->coat_roughness;
    }
    if (either(Family::glass) && of_first != of_second) tell("has one colour, for the glass as for what is beside it");
    if (a.roughness != b.roughness || a.roughness_texture != b.roughness_texture || a.ior != b.ior)
      tell("has the mean of their roughness and index");
    mix_colours(&lumicut_material::diffuse, &lumicut_material::diffuse_texture);
    mix_colours(&lumicut_material::specular, &lumicut_material::specular_texture);
    mix_numbers(&lumicut_material::roughness, &lumicut_material::roughness_texture);
    mix_numbers(&lumicut_material::metallic, &lumicut_material::metallic_texture);
    for (const auto number : {&lumicut_material::ior, &lumicut_material::transmission, &lumicut_material::coat,
                              &lumicut_material::coat_roughness, &lumicut_material::coat_ior})
      m.*number = a.*number + t * (b.*number - a.*number);
    for (size_t k = 0; k < 3; ++k) {
      const auto tint = [&](const lumicut_material& of) {  // all 0: not given
        return std::max({of.specular_tint[0], of.specular_tint[1], of.specular_tint[2]}) > 0 ? of.specular_tint[k] : 1;
      };
      m.specular_tint[k] = tint(a) + t * (tint(b) - tint(a));
    }
  }
  mix_colours(&lumicut_material::translucency, &lumicut_material::translucency_texture);
  set_opacity(m, mixed(opacity(a), opacity(b), share));
  const lumicut_material& bent = a.normal_texture != 0 || a.height_texture != 0 ? a : b;
  const lumicut_material& other = &bent == &a ? b : a;
  if ((other.normal_texture != 0 || other.height_texture != 0) &&
      (other.normal_texture != bent.normal_texture || other.height_texture != bent.height_texture))
    tell("has the bumps of the first");
  m.normal_texture = bent.normal_texture, m.normal_strength = bent.normal_strength;
  m.height_texture = bent.height_texture, m.bump_distance = bent.bump_distance, m.bump_strength = bent.bump_strength;
  return add_material(name, m);
}

}  // namespace lumicut::io
