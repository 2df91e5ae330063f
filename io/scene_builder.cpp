#include "io/scene_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "io/file_error.h"
#include "io/find_beside.h"
#include "io/scene_defaults.h"
#include "io/scene_model.h"

namespace lumicut::io {

Affine translation(const Vec& v) {
  Affine out;
  out.m[3] = v[0], out.m[7] = v[1], out.m[11] = v[2];
  return out;
}
Affine scaling(const Vec& v) {
  Affine out;
  out.m[0] = v[0], out.m[5] = v[1], out.m[10] = v[2];
  return out;
}
Affine rotation(const Vec& axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), t = 1 - c;
  const auto [x, y, z] = unit(axis);
  Affine out;
  out.m = {t * x * x + c,     t * x * y - s * z, t * x * z + s * y, 0,
           t * x * y + s * z, t * y * y + c,     t * y * z - s * x, 0,
           t * x * z - s * y, t * y * z + s * x, t * z * z + c,     0};
  return out;
}
std::optional<Affine> inverse(const Affine& m) {
  const double d = m.determinant();
  if (!(std::abs(d) > 0) || !std::isfinite(d)) return std::nullopt;
  const Vec x = m.column(0), y = m.column(1), z = m.column(2);
  const Vec rows[3] = {cross(y, z) * (1 / d), cross(z, x) * (1 / d), cross(x, y) * (1 / d)};
  Affine out;
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c) out.m[4 * r + c] = rows[r][c];
    out.m[4 * r + 3] = -dot(rows[r], m.column(3));
  }
  return out;
}

// ---- Shapes

namespace {

// A grid of (columns + 1) by (rows + 1) places: `at` adds the vertex of (s, t), each 0 to 1.
Geometry grid(uint32_t columns, uint32_t rows, const std::function<void(Geometry&, double, double)>& at) {
  Geometry g;
  for (uint32_t j = 0; j <= rows; ++j)
    for (uint32_t i = 0; i <= columns; ++i) at(g, double(i) / columns, double(j) / rows);
  for (uint32_t j = 0; j < rows; ++j)
    for (uint32_t i = 0; i < columns; ++i) {
      const uint32_t a = j * (columns + 1) + i, b = a + 1, c = b + columns + 1, d = c - 1;
      g.indices.insert(g.indices.end(), {a, b, c, a, c, d});
    }
  return g;
}
void vertex(Geometry& g, const Vec& p, const Vec& n, double u, double v) {
  for (const double x : p) g.positions.push_back(static_cast<float>(x));
  for (const double x : n) g.normals.push_back(static_cast<float>(x));
  g.uvs.push_back(static_cast<float>(u)), g.uvs.push_back(static_cast<float>(v));
}
// A polygon around a circle has its area, or its length of arc, where its radius is so much larger.
double polygon_growth(double step) { return std::sqrt(step / std::sin(step)); }

}  // namespace

Geometry sphere_geometry() {
  constexpr uint32_t kAround = 96, kUp = 48;
  const auto place = [](double s, double t, double radius) {
    const double phi = 2 * kPi * s, theta = kPi * (1 - t);
    return Vec{radius * std::sin(theta) * std::cos(phi), radius * std::sin(theta) * std::sin(phi),
               radius * std::cos(theta)};
  };
  Geometry g = grid(kAround, kUp, [&](Geometry& out, double s, double t) {
    const Vec n = place(s, t, 1);
    vertex(out, n, n, s, t);
  });
  // Triangles without an area at the poles go; what is left grows to the sphere's area.
  std::vector<uint32_t> kept;
  double area = 0;
  for (size_t i = 0; i < g.indices.size(); i += 3) {
    Vec p[3];
    for (size_t k = 0; k < 3; ++k) std::copy_n(&g.positions[3 * size_t{g.indices[i + k]}], 3, p[k].begin());
    const double twice = length(cross(p[1] - p[0], p[2] - p[0]));
    if (twice < 1e-9) continue;
    area += twice / 2;
    kept.insert(kept.end(), &g.indices[i], &g.indices[i] + 3);
  }
  g.indices = std::move(kept);
  const auto grow = static_cast<float>(std::sqrt(4 * kPi / area));
  for (float& x : g.positions) x *= grow;
  return g;
}

Geometry rectangle_geometry() {
  return grid(1, 1, [](Geometry& g, double s, double t) { vertex(g, {2 * s - 1, 2 * t - 1, 0}, {0, 0, 1}, s, t); });
}

Geometry cube_geometry() {
  Geometry all;
  for (size_t axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const Geometry face = grid(1, 1, [&](Geometry& g, double s, double t) {
        Vec p, n{0, 0, 0};
        n[axis] = p[axis] = side;
        p[(axis + 1) % 3] = side * (2 * s - 1), p[(axis + 2) % 3] = 2 * t - 1;
        vertex(g, p, n, s, t);
      });
      const auto first = static_cast<uint32_t>(all.positions.size() / 3);
      all.positions.insert(all.positions.end(), face.positions.begin(), face.positions.end());
      all.normals.insert(all.normals.end(), face.normals.begin(), face.normals.end());
      all.uvs.insert(all.uvs.end(), face.uvs.begin(), face.uvs.end());
      for (const uint32_t i : face.indices) all.indices.push_back(first + i);
    }
  return all;
}

Geometry disk_geometry(double height, double radius, double inner, double sweep) {
  constexpr uint32_t kAround = 96;
  const double grow = polygon_growth(sweep / kAround);
  return grid(kAround, 1, [&](Geometry& g, double s, double t) {
    const double phi = sweep * s, r = (radius + (inner - radius) * t) * grow;
    vertex(g, {r * std::cos(phi), r * std::sin(phi), height}, {0, 0, 1}, s, t);
  });
}

Geometry cylinder_geometry(double radius, double z0, double z1, double sweep) {
  constexpr uint32_t kAround = 96;
  const double grow = polygon_growth(sweep / kAround);
  return grid(kAround, 1, [&](Geometry& g, double s, double t) {
    const double phi = sweep * s;
    const Vec n{std::cos(phi), std::sin(phi), 0};
    vertex(g, {radius * grow * n[0], radius * grow * n[1], z0 + (z1 - z0) * t}, n, s, t);
  });
}

// ---- Colours

PaintRef constant_paint(const Vec& value) {
  auto paint = std::make_shared<Paint>();
  paint->value = value;
  return paint;
}
PaintRef constant_paint(double value) { return constant_paint(Vec{value, value, value}); }
PaintRef power_paint(PaintRef base, double exponent) {
  if (const auto value = constant_of(base)) {
    Vec out;
    for (size_t k = 0; k < 3; ++k) out[k] = std::pow(std::max(0.0, (*value)[k]), exponent);
    return constant_paint(out);
  }
  auto paint = std::make_shared<Paint>();
  paint->kind = Paint::Kind::power, paint->a = std::move(base), paint->value[0] = exponent;
  return paint;
}

std::optional<Vec> constant_of(const PaintRef& paint) {
  const auto both = [&](auto&& combine) -> std::optional<Vec> {
    const auto a = constant_of(paint->a);
    const auto b = a ? constant_of(paint->b) : std::nullopt;
    if (!b) return std::nullopt;
    Vec out;
    for (size_t k = 0; k < 3; ++k) out[k] = combine((*a)[k], (*b)[k]);
    return out;
  };
  switch (paint->kind) {
    case Paint::Kind::constant:
      return paint->value;
    case Paint::Kind::product:
      return both([](double a, double b) { return a * b; });
    case Paint::Kind::mix: {
      const auto share = constant_of(paint->share);
      if (!share) return std::nullopt;
      return both([&](double a, double b) { return a + ((*share)[0]) * (b - a); });
    }
    case Paint::Kind::invert: {
      const auto a = constant_of(paint->a);
      if (!a) return std::nullopt;
      return Vec{1 - (*a)[0], 1 - (*a)[1], 1 - (*a)[2]};
    }
    default:
      return std::nullopt;
  }
}

Metal metal_of(const Vec& eta, const Vec& k) {
  // Fresnel's equations for a conductor in air.
  const auto reflectance = [](double c, double n, double absorbing) {
    const double c2 = c * c, s2 = 1 - c2, n2 = n * n, k2 = absorbing * absorbing, t = n2 - k2 - s2;
    const double both = std::sqrt(std::max(0.0, t * t + 4 * n2 * k2)), a = std::sqrt(std::max(0.0, 0.5 * (both + t)));
    const double across = (both + c2 - 2 * a * c) / (both + c2 + 2 * a * c);
    return 0.5 * across * (1 + (c2 * both + s2 * s2 - 2 * a * c * s2) / (c2 * both + s2 * s2 + 2 * a * c * s2));
  };
  Metal out;
  const double c = std::cos(radians(82));
  for (size_t i = 0; i < 3; ++i) {
    const double f0 = std::clamp(reflectance(1, eta[i], k[i]), 0.0, 1.0);
    const double schlick = f0 + (1 - f0) * std::pow(1 - c, 5);
    out.colour[i] = f0;
    out.tint[i] = schlick > 0 ? std::clamp(reflectance(c, eta[i], k[i]) / schlick, 1e-6, 1.0) : 1;
  }
  return out;
}

std::optional<std::pair<Vec, Vec>> named_metal(const std::string& name) {
  static const std::map<std::string, std::pair<Vec, Vec>> kMetals = {
      {"Cu", {{0.2004, 0.9240, 1.1022}, {3.9129, 2.4528, 2.1422}}},
      {"Au", {{0.1431, 0.3750, 1.4424}, {3.9832, 2.3857, 1.6032}}},
      {"Ag", {{0.1552, 0.1167, 0.1384}, {4.8283, 3.1225, 2.1470}}},
      {"Al", {{1.6574, 0.8803, 0.5212}, {9.2238, 6.2695, 4.8370}}},
      {"CuZn", {{0.4440, 0.5270, 1.0940}, {3.6950, 2.7650, 1.8290}}},
      {"Cr", {{3.1071, 3.1812, 2.3230}, {3.3314, 3.3291, 3.1350}}}};
  const auto found = kMetals.find(name);
  if (found == kMetals.end()) return std::nullopt;
  return found->second;
}

namespace {

// CIE 1931 colour matching functions by the fit of Wyman, Sloan and Shirley (2013), multi-lobe.
Vec colour_matching(double nm) {
  const auto lobe = [&](double height, double middle, double below, double above) {
    const double t = (nm - middle) * (nm < middle ? below : above);
    return height * std::exp(-0.5 * t * t);
  };
  return {lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) - lobe(0.065, 501.1, 0.0490, 0.0382),
          lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
          lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)};
}
Vec rgb_of_xyz(const Vec& c) {
  Vec out{3.2404542 * c[0] - 1.5371385 * c[1] - 0.4985314 * c[2],
          -0.9692660 * c[0] + 1.8760108 * c[1] + 0.0415560 * c[2],
          0.0556434 * c[0] - 0.2040259 * c[1] + 1.0572252 * c[2]};
  for (double& x : out) x = std::max(0.0, x);
  return out;
}

}  // namespace

Vec rgb_of_spectrum(const std::vector<std::pair<double, double>>& spectrum) {
  if (spectrum.empty()) return {0, 0, 0};
  Vec sum{0, 0, 0};
  double white = 0;
  for (double nm = 360; nm <= 830; nm += 1) {
    const auto above =
        std::lower_bound(spectrum.begin(), spectrum.end(), nm, [](const auto& s, double x) { return s.first < x; });
    double value = 0;
    if (above != spectrum.end() && above->first == nm) {
      value = above->second;
    } else if (above != spectrum.begin() && above != spectrum.end()) {
      const auto below = above - 1;
      value = below->second + (above->second - below->second) * (nm - below->first) / (above->first - below->first);
    }
    const Vec c = colour_matching(nm);
    sum = sum + c * value;
    white += c[1];
  }
  return rgb_of_xyz(sum * (1 / white));
}

Vec blackbody(double kelvin) {
  std::vector<std::pair<double, double>> spectrum;
  for (double nm = 360; nm <= 830; nm += 5) {
    const double x = 1.438776877e7 / (nm * kelvin);
    spectrum.emplace_back(nm, std::pow(nm / 560, -5) / (x < 700 ? std::expm1(x) : 1e304));
  }
  const Vec rgb = rgb_of_spectrum(spectrum);
  const double luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
  return luminance > 0 ? rgb * (1 / luminance) : Vec{1, 0, 0};
}

// ---- The scene

void SceneBuilder::fail(const std::string& where, const std::string& text) const {
  throw FileError(path_, where.empty() ? text : fmt::format("{}: {}", where, text));
}
void SceneBuilder::leave_out(const std::string& what) {
  if (told_.insert(what).second) scene.warnings.add("things left out", path_, fmt::format("{}: left out", shown(what)));
}
void SceneBuilder::approximate(const std::string& what) {
  if (told_.insert(what).second) scene.warnings.add("things approximated", path_, shown(what));
}

PaintRef SceneBuilder::made(Paint paint) const {
  for (const PaintRef* part : {&paint.a, &paint.b, &paint.share})
    if (*part) paint.size += (*part)->size;
  if (paint.size > 500) fail("", "a texture is made of more than 500 others");
  auto out = std::make_shared<const Paint>(std::move(paint));
  if (const auto value = constant_of(out)) return constant_paint(*value);
  return out;
}

int32_t SceneBuilder::image(const std::string& name, TextureUse use, uint32_t flags) {
  const FoundFile file = find_beside(path_, name);
  if (file.path.empty()) {
    scene.warnings.add("missing textures", path_,
                       fmt::format("the texture {} does not exist; grey stands in", shown(name)));
    return 0;
  }
  if (!file.remark.empty())
    scene.warnings.add("names of textures that differ from their files'", path_,
                       fmt::format("the texture {} does not exist; {}", shown(name), file.remark));
  return textures_.get(file.path, use, flags, path_);
}

int32_t SceneBuilder::compile(const PaintRef& paint, Program& program) {
  const auto constant = [&](double x, double y, double z) {
    for (const double v : {x, y, z}) program.constants.push_back(static_cast<float>(v));
    return -static_cast<int32_t>(program.constants.size() / 3);
  };
  const auto step = [&](uint32_t op, uint32_t mode, std::initializer_list<int32_t> inputs, uint32_t data = 0) {
    if (program.instructions.size() >= 1000) fail("", "a texture is made of more than 1000 steps");
    lumicut_instruction in{};
    in.op = op, in.mode = mode, in.data = data;
    std::copy(inputs.begin(), inputs.end(), in.inputs);
    program.instructions.push_back(in);
    return static_cast<int32_t>(program.instructions.size() - 1);
  };
  constexpr uint32_t kAdd = 0, kSubtract = 1, kMultiply = 2, kMultiplyAdd = 4, kPower = 5, kFloor = 18,
                     kFlooredModulo = 25;
  const auto place = [&] {
    const int32_t uv = step(LUMICUT_OP_UV, 0, {});
    if (paint->uv[0] == 1 && paint->uv[1] == 1 && paint->uv[2] == 0 && paint->uv[3] == 0) return uv;
    return step(LUMICUT_OP_VECTOR, kMultiplyAdd,
                {uv, constant(paint->uv[0], paint->uv[1], 1), constant(paint->uv[2], paint->uv[3], 0)});
  };
  switch (paint->kind) {
    case Paint::Kind::constant:
      return constant(paint->value[0], paint->value[1], paint->value[2]);
    case Paint::Kind::image:
      return step(LUMICUT_OP_IMAGE, 0, {place()}, static_cast<uint32_t>(paint->texture));
    case Paint::Kind::checker: {
      const int32_t cell = step(LUMICUT_OP_VECTOR, kFloor, {place()});
      const int32_t sum =
          step(LUMICUT_OP_MATH, kAdd, {step(LUMICUT_OP_SEPARATE, 0, {cell}), step(LUMICUT_OP_SEPARATE, 1, {cell})});
      const int32_t odd = step(LUMICUT_OP_MATH, kFlooredModulo, {sum, constant(2, 2, 2)});
      const int32_t a = compile(paint->a, program), b = compile(paint->b, program);
      return step(LUMICUT_OP_MIX, 0, {odd, a, b});
    }
    case Paint::Kind::product: {
      const int32_t a = compile(paint->a, program), b = compile(paint->b, program);
      return step(LUMICUT_OP_VECTOR, kMultiply, {a, b});
    }
    case Paint::Kind::mix: {
      const int32_t share = compile(paint->share, program);
      const int32_t a = compile(paint->a, program), b = compile(paint->b, program);
      return step(LUMICUT_OP_MIX, 0, {share, a, b});
    }
    case Paint::Kind::invert: {
      const int32_t a = compile(paint->a, program);
      return step(LUMICUT_OP_VECTOR, kSubtract, {constant(1, 1, 1), a});
    }
    case Paint::Kind::power: {
      const int32_t a = compile(paint->a, program);
      const int32_t exponent = constant(paint->value[0], paint->value[0], paint->value[0]);
      return step(LUMICUT_OP_MATH, kPower, {a, exponent});
    }
  }
  return 0;
}

int32_t SceneBuilder::texture_of(const PaintRef& paint) {
  if (paint->kind == Paint::Kind::image && paint->uv[0] == 1 && paint->uv[1] == 1 && paint->uv[2] == 0 &&
      paint->uv[3] == 0)
    return paint->texture;
  const auto found = painted_.find(paint.get());
  if (found != painted_.end()) return found->second.second;
  Program program;
  const int32_t last = compile(paint, program);
  if (last < 0) {  // a constant alone
    lumicut_instruction in{};
    in.op = LUMICUT_OP_VECTOR, in.inputs[0] = last;
    for (int k = 0; k < 3; ++k) program.constants.push_back(0);
    in.inputs[1] = -static_cast<int32_t>(program.constants.size() / 3);
    program.instructions.push_back(in);
  }
  Texture texture;
  texture.file = fmt::format("texture {}", scene.textures.size() + 1);
  texture.program = std::move(program);
  scene.textures.push_back(std::move(texture));
  const auto number = static_cast<int32_t>(scene.textures.size());
  painted_[paint.get()] = {paint, number};
  return number;
}

// Scene files take the pictures of colours for sRGB and those of numbers for linear: what is the other way round becomes a
// program, which takes it as it is.
PaintRef SceneBuilder::decoded(const PaintRef& paint, bool colour) const {
  if (paint->kind != Paint::Kind::image) return paint;
  const Texture& image = scene.textures.at(static_cast<size_t>(paint->texture) - 1);
  if (image.bytes.empty() || ((image.flags & LUMICUT_SRGB) != 0) == colour) return paint;
  auto out = std::make_shared<Paint>();
  out->kind = Paint::Kind::product, out->a = paint, out->b = constant_paint(1.0);
  return out;
}
int32_t SceneBuilder::number_texture(const PaintRef& paint) { return texture_of(decoded(paint, false)); }

void SceneBuilder::set_colour(const PaintRef& paint, float* factor, int32_t& texture, double most) {
  texture = 0;
  if (const auto value = constant_of(paint)) {
    for (size_t k = 0; k < 3; ++k) factor[k] = static_cast<float>(std::clamp((*value)[k], 0.0, most));
    return;
  }
  for (size_t k = 0; k < 3; ++k) factor[k] = 1;
  texture = texture_of(decoded(paint, true));
}
void SceneBuilder::set_number(const PaintRef& paint, float& factor, int32_t& texture) {
  texture = 0;
  if (const auto value = constant_of(paint)) {
    factor = static_cast<float>(std::clamp((*value)[0], 0.0, 1.0));
    return;
  }
  factor = 1;
  texture = number_texture(paint);
}

uint32_t SceneBuilder::add_material(const std::string& name, const lumicut_material& values) {
  scene.materials.push_back({name, values});
  return static_cast<uint32_t>(scene.materials.size() - 1);
}

uint32_t SceneBuilder::with_emission(uint32_t material, const Vec& radiance, int32_t texture, bool both_sides) {
  lumicut_material values = scene.materials.at(material).values;
  for (size_t k = 0; k < 3; ++k) values.emission[k] = static_cast<float>(std::clamp(radiance[k], 0.0, 1e15));
  values.emission_texture = texture;
  if (both_sides) values.flags |= LUMICUT_EMIT_BOTH_SIDES;
  for (size_t i = material + 1; i < scene.materials.size(); ++i)
    if (std::equal(reinterpret_cast<const char*>(&values), reinterpret_cast<const char*>(&values + 1),
                   reinterpret_cast<const char*>(&scene.materials[i].values)))
      return static_cast<uint32_t>(i);
  return add_material(scene.materials[material].name + ", which emits", values);
}

void SceneBuilder::add(const std::string& name, const Geometry& geometry, const Affine& place, uint32_t material,
                       bool flipped, const std::string& key) {
  for (const double v : place.m)
    if (!(std::abs(v) < kLargestCoordinate)) fail(name, fmt::format("its transform has the number {}", v));
  if (!(std::abs(place.determinant()) > 0)) return leave_out(name + ", which is scaled to nothing");
  if (geometry.indices.empty()) return;
  const std::string whole = fmt::format("{} {} {}", key, material, flipped);
  if (!key.empty()) {
    const auto known = shared_.find(whole);
    if (known != shared_.end()) {
      for (const double v : place.m) scene.meshes[known->second].transforms.push_back(static_cast<float>(v));
      return;
    }
    shared_[whole] = scene.meshes.size();
  }
  Mesh mesh;
  mesh.name = name;
  mesh.positions = geometry.positions, mesh.normals = geometry.normals, mesh.uvs = geometry.uvs,
  mesh.indices = geometry.indices;
  if (flipped) {
    for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) std::swap(mesh.indices[i + 1], mesh.indices[i + 2]);
    for (float& n : mesh.normals) n = -n;
  }
  for (const float x : mesh.positions)
    if (!(std::abs(x) < static_cast<float>(kLargestCoordinate))) fail(name, fmt::format("has a coordinate of {}", x));
  mesh.materials.assign(mesh.indices.size() / 3, material);
  for (const double v : place.m) mesh.transforms.push_back(static_cast<float>(v));
  scene.meshes.push_back(std::move(mesh));
}

std::vector<Geometry> SceneBuilder::read_meshes(const std::string& name) {
  const FoundFile file = find_beside(path_, name);
  if (file.path.empty()) fail("", fmt::format("the mesh {} does not exist", shown(name)));
  if (!is_model(file.path)) fail("", fmt::format("the mesh {} is of no format that is read here", shown(name)));
  std::vector<Geometry> out;
  for (Mesh& mesh : read_model_meshes(file.path, scene.warnings))
    out.push_back({std::move(mesh.positions), std::move(mesh.normals), std::move(mesh.uvs), std::move(mesh.indices)});
  return out;
}

void SceneBuilder::add_light(const lumicut_light& light, const std::string& name) {
  scene.lights.push_back(light);
  scene.lights.back().struct_size = sizeof(light);
  scene.light_names.push_back(name);
}

void SceneBuilder::add_profile_light(const Vec& position, const Vec& direction, const Vec& colour,
                                     std::vector<float> angles, std::vector<float> values, const std::string& name) {
  Profile profile;
  profile.file = name;
  profile.vertical = std::move(angles), profile.horizontal = {0}, profile.values = std::move(values);
  scene.profiles.push_back(std::move(profile));
  lumicut_light light{};
  light.type = LUMICUT_POINT, light.value = 1;
  light.profile = static_cast<uint32_t>(scene.profiles.size());
  store(light.position, position), store(light.direction, unit(direction)), store(light.color, colour);
  add_light(light, name);
}

SceneData SceneBuilder::finish(bool has_camera) {
  if (scene.meshes.empty()) fail("", "has no triangles: there is nothing to see");
  if (!has_camera) frame_scene(scene);
  if (!is_lit(scene)) add_sky(scene);
  scene.file = path_;
  return std::move(scene);
}

}  // namespace lumicut::io
