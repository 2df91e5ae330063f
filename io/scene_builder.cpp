#include "io/scene_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "io/file_error.h"
#include "io/scene_defaults.h"
#include "io/scene_model.h"
#include "io/srgb.h"
#include "io/vertex_colours.h"

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
// Triangles without an area go, as at poles. The area of the others.
double drop_slivers(Geometry& g) {
  std::vector<uint32_t> kept;
  double area = 0;
  for (size_t i = 0; i + 2 < g.indices.size(); i += 3) {
    Vec p[3];
    for (size_t k = 0; k < 3; ++k) std::copy_n(&g.positions[3 * size_t{g.indices[i + k]}], 3, p[k].begin());
    const double twice = length(cross(p[1] - p[0], p[2] - p[0]));
    if (twice < 1e-9) continue;
    area += twice / 2;
    kept.insert(kept.end(), &g.indices[i], &g.indices[i] + 3);
  }
  g.indices = std::move(kept);
  return area;
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
  // What is left without the triangles at the poles grows to the sphere's area.
  const double area = drop_slivers(g);
  const auto grow = static_cast<float>(std::sqrt(4 * kPi / area));
  for (float& x : g.positions) x *= grow;
  return g;
}

Geometry sphere_part_geometry(double z0, double z1, double sweep) {
  constexpr uint32_t kAround = 96, kUp = 48;
  const double low = std::asin(std::clamp(z0, -1.0, 1.0)), high = std::asin(std::clamp(z1, -1.0, 1.0));
  const double grow = polygon_growth(sweep / kAround);
  Geometry out = grid(kAround, kUp, [&](Geometry& g, double s, double t) {
    const double phi = sweep * s, up = low + (high - low) * t;
    const Vec n{std::cos(up) * std::cos(phi), std::cos(up) * std::sin(phi), std::sin(up)};
    vertex(g, {n[0] * grow, n[1] * grow, n[2]}, n, s, t);
  });
  drop_slivers(out);
  return out;
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

namespace {
double below_coat(double base, double kept) {
  base = std::clamp(base, 0.0, 1.0);
  return base * (1 - kept) / (1 - base * kept);
}
}  // namespace

PaintRef coated_paint(PaintRef base, double index) {
  const double kept = std::min(internal_reflectance(index), 0.999);
  if (const auto value = constant_of(base)) {
    Vec out;
    for (size_t k = 0; k < 3; ++k) out[k] = below_coat((*value)[k], kept);
    return constant_paint(out);
  }
  auto paint = std::make_shared<Paint>();
  paint->kind = Paint::Kind::coated, paint->size = base->size + 1;
  paint->a = std::move(base), paint->value[0] = kept;
  return paint;
}

PaintRef behind_paint() {
  auto paint = std::make_shared<Paint>();
  paint->kind = Paint::Kind::behind;
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

// ---- The scene

namespace {
Vec mean_of_texels(const Texture& t) {
  const size_t texels = size_t{t.width} * t.height, n = t.channels;
  Vec sum{0, 0, 0};
  if (texels == 0) return {0.5, 0.5, 0.5};
  for (size_t i = 0; i < texels * n; ++i) {
    double x = t.bytes.empty() ? double{t.floats[i]} : t.bytes[i] / 255.0;
    if (!t.bytes.empty() && (t.flags & LUMICUT_SRGB) != 0) x = linear_of_srgb(x);
    if (n == 1)
      sum = sum + Vec{x, x, x};
    else if (i % n < 3)
      sum[i % n] += x;
  }
  return sum * (1 / double(texels));
}
}  // namespace

void SceneBuilder::fail(const std::string& where, const std::string& text) const {
  throw FileError(path_, where.empty() ? text : fmt::format("{}: {}", where, text));
}
namespace {
constexpr size_t kLongest = 160;  // of a warning, which may quote the file
}
void SceneBuilder::leave_out(const std::string& what) {
  if (told_.insert(what).second)
    scene.warnings.add("things left out", path_, fmt::format("{}: left out", shown(what, kLongest)));
}
void SceneBuilder::approximate(const std::string& what) {
  if (told_.insert(what).second) scene.warnings.add("things approximated", path_, shown(what, kLongest));
}

namespace {
// A paint and what it is multiplied by.
std::pair<PaintRef, Vec> without_factor(PaintRef paint) {
  Vec by{1, 1, 1};
  while (paint->kind == Paint::Kind::product) {
    const bool first = paint->a->kind == Paint::Kind::constant;
    const PaintRef& constant = first ? paint->a : paint->b;
    if (constant->kind != Paint::Kind::constant) break;
    for (size_t k = 0; k < 3; ++k) by[k] *= constant->value[k];
    paint = first ? paint->b : paint->a;
  }
  return {paint, by};
}
}  // namespace

double SceneBuilder::cut(double value, double low, double high, const ValuePlace& place) {
  if (value >= low && value <= high) return value;
  const double taken = std::isnan(value) ? low : std::clamp(value, low, high);
  const std::string text =
      fmt::format("{} is {:g}, not {:g} to {:g}; {:g} is taken", shown(place.name, kLongest), value, low, high, taken);
  constexpr char kKind[] = "values out of range";
  if (place.line > 0)
    scene.warnings.add(kKind, place.file, place.line, text);
  else
    scene.warnings.add(kKind, place.file, text);
  return taken;
}
PaintRef SceneBuilder::cut(const PaintRef& paint, double low, double high, const ValuePlace& place) {
  const auto first_outside = [&](const Vec& v, double most) {
    for (const double x : v)
      if (!(x >= low && x <= most)) return std::optional<double>(x);
    return std::optional<double>();
  };
  if (const auto value = constant_of(paint)) {
    const auto outside = first_outside(*value, high);
    if (!outside) return paint;
    cut(*outside, low, high, place);
    Vec kept;
    for (size_t k = 0; k < 3; ++k) kept[k] = std::clamp((*value)[k], low, high);
    return constant_paint(kept);
  }
  if (const auto outside = first_outside(without_factor(paint).second, 1e6))
    cut(*outside, 0, 1e6, {place.file, place.line, place.name + ", a factor of a texture"});
  return paint;
}

PaintRef SceneBuilder::made(Paint paint) const {
  for (const PaintRef* part : {&paint.a, &paint.b, &paint.share})
    if (*part) paint.size += (*part)->size;
  if (paint.size > 500) fail("", "a texture is made of more than 500 others");
  auto out = std::make_shared<const Paint>(std::move(paint));
  if (const auto value = constant_of(out)) return constant_paint(*value);
  return out;
}

PaintRef SceneBuilder::product(const PaintRef& a, const PaintRef& b) const {
  Paint out;
  out.kind = Paint::Kind::product, out.a = a, out.b = b;
  return made(out);
}
PaintRef SceneBuilder::mixed(const PaintRef& a, const PaintRef& b, const PaintRef& share) const {
  if (a == b) return a;
  Paint out;
  out.kind = Paint::Kind::mix, out.a = a, out.b = b, out.share = share;
  return made(out);
}

FoundFile SceneBuilder::find(const std::string& name) const {
  FoundFile file = find_beside(path_, name);
  for (size_t i = 0; i < folders_.size() && file.path.empty(); ++i) file = find_beside(folders_[i] + "/", name);
  return file;
}

int32_t SceneBuilder::image(const std::string& name, TextureUse use, uint32_t flags, const char* else_done) {
  const FoundFile file = find(name);
  if (file.path.empty()) {
    scene.warnings.add("missing textures", path_,
                       fmt::format("{}; {}", missing_file("texture", path_, name), else_done));
    return 0;
  }
  if (!file.remark.empty())
    scene.warnings.add("names of textures that differ from their files'", path_,
                       fmt::format("the texture {} does not exist; {}", shown(name), file.remark));
  return textures_.get(file.path, use, flags, path_);
}

PaintRef SceneBuilder::image_paint(int32_t texture) {
  auto paint = std::make_shared<Paint>();
  paint->kind = Paint::Kind::image, paint->texture = texture;
  return paint;
}

PaintRef SceneBuilder::vertex_paint() {
  auto paint = std::make_shared<Paint>();
  paint->kind = Paint::Kind::vertices;
  return paint;
}

Vec SceneBuilder::mean_of(const PaintRef& paint) const {
  switch (paint->kind) {
    case Paint::Kind::constant:
      return paint->value;
    case Paint::Kind::image:
      return mean_of_texels(scene.textures.at(static_cast<size_t>(paint->texture) - 1));
    case Paint::Kind::checker:
      return (mean_of(paint->a) + mean_of(paint->b)) * 0.5;
    case Paint::Kind::product: {
      const Vec a = mean_of(paint->a), b = mean_of(paint->b);
      return {a[0] * b[0], a[1] * b[1], a[2] * b[2]};
    }
    case Paint::Kind::mix: {
      const Vec a = mean_of(paint->a), b = mean_of(paint->b);
      return a + (b - a) * mean_of(paint->share)[0];
    }
    case Paint::Kind::invert:
      return Vec{1, 1, 1} - mean_of(paint->a);
    case Paint::Kind::power: {
      Vec out = mean_of(paint->a);
      for (double& x : out) x = std::pow(std::max(0.0, x), paint->value[0]);
      return out;
    }
    case Paint::Kind::coated: {
      Vec out = mean_of(paint->a);
      for (double& x : out) x = below_coat(x, paint->value[0]);
      return out;
    }
    default:
      return {0.5, 0.5, 0.5};
  }
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
    const auto& m = paint->place.to.m;
    const TexturePlace::Kind kind = paint->place.kind;
    const int32_t from = step(kind == TexturePlace::Kind::uv ? LUMICUT_OP_UV : LUMICUT_OP_POSITION, 0, {});
    if (m == Affine{}.m && kind <= TexturePlace::Kind::point) return from;
    if (kind == TexturePlace::Kind::uv && m[1] == 0 && m[4] == 0)
      return step(LUMICUT_OP_VECTOR, kMultiplyAdd, {from, constant(m[0], m[5], 1), constant(m[3], m[7], 0)});
    const auto row = static_cast<uint32_t>(program.table.size());
    for (const double x : m) program.table.push_back(static_cast<float>(x));
    const int32_t out = step(LUMICUT_OP_TRANSFORM, 0, {from}, row);
    program.instructions.back().count = 12;
    if (kind <= TexturePlace::Kind::point) return out;
    const auto part = [&](int32_t of, uint32_t which) { return step(LUMICUT_OP_SEPARATE, which, {of}); };
    constexpr uint32_t kFraction = 23, kArcCosine = 33, kArcTangent2 = 35, kNormalize = 14;
    const int32_t turn = step(LUMICUT_OP_MATH, kArcTangent2, {part(out, 1), part(out, 0)});
    const double per_turn = 1 / (2 * kPi), half = kind == TexturePlace::Kind::cylinder ? 0.5 : 0;
    const int32_t around =
        step(LUMICUT_OP_MATH, kMultiplyAdd, {turn, constant(per_turn, per_turn, per_turn), constant(half, half, half)});
    if (kind == TexturePlace::Kind::cylinder)
      return step(LUMICUT_OP_COMBINE, 0, {around, part(out, 2), constant(0, 0, 0)});
    const int32_t z = part(step(LUMICUT_OP_VECTOR, kNormalize, {out}), 2);
    const int32_t down =
        step(LUMICUT_OP_MATH, kMultiply, {step(LUMICUT_OP_MATH, kArcCosine, {z}), constant(1 / kPi, 1 / kPi, 1 / kPi)});
    return step(LUMICUT_OP_COMBINE, 0, {down, step(LUMICUT_OP_MATH, kFraction, {around}), constant(0, 0, 0)});
  };
  switch (paint->kind) {
    case Paint::Kind::constant:
      return constant(paint->value[0], paint->value[1], paint->value[2]);
    case Paint::Kind::image:
      return step(LUMICUT_OP_IMAGE, paint->mode, {place()}, static_cast<uint32_t>(paint->texture));
    case Paint::Kind::vertices:
      return step(LUMICUT_OP_ATTRIBUTE, 0, {}, VertexColours::kAttribute);
    case Paint::Kind::axis:
      return step(LUMICUT_OP_SEPARATE, paint->mode, {place()});
    case Paint::Kind::along: {
      constexpr uint32_t kDot = 10, kAbsolute = 9;
      const int32_t normal = step(LUMICUT_OP_NORMAL, 1, {});
      const int32_t cosine =
          step(LUMICUT_OP_VECTOR, kDot, {normal, constant(paint->value[0], paint->value[1], paint->value[2])});
      return step(LUMICUT_OP_MATH, kAbsolute, {cosine});
    }
    case Paint::Kind::behind:
      return step(LUMICUT_OP_BEHIND, 0, {});
    case Paint::Kind::checker: {
      const int32_t cell = step(LUMICUT_OP_VECTOR, kFloor, {place()});
      int32_t sum =
          step(LUMICUT_OP_MATH, kAdd, {step(LUMICUT_OP_SEPARATE, 0, {cell}), step(LUMICUT_OP_SEPARATE, 1, {cell})});
      if (paint->place.kind == TexturePlace::Kind::point)
        sum = step(LUMICUT_OP_MATH, kAdd, {sum, step(LUMICUT_OP_SEPARATE, 2, {cell})});
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
    case Paint::Kind::coated: {
      constexpr uint32_t kDivide = 3, kMinimum = 16;
      const double kept = paint->value[0];
      const int32_t one = constant(1, 1, 1);
      const int32_t base = step(LUMICUT_OP_VECTOR, kMinimum, {compile(paint->a, program), one});
      const int32_t rest = step(LUMICUT_OP_VECTOR, kMultiplyAdd, {base, constant(-kept, -kept, -kept), one});
      const int32_t share = step(LUMICUT_OP_VECTOR, kDivide, {base, rest});
      return step(LUMICUT_OP_VECTOR, kMultiply, {share, constant(1 - kept, 1 - kept, 1 - kept)});
    }
  }
  return 0;
}

int32_t SceneBuilder::texture_of(const PaintRef& paint) {
  if (paint->kind == Paint::Kind::image && paint->mode == 0 && paint->place.kind == TexturePlace::Kind::uv &&
      paint->place.to.m == Affine{}.m) {
    made_of_[paint->texture] = paint;
    return paint->texture;
  }
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
  const int32_t number = add_program(std::move(program));
  painted_[paint.get()] = {paint, number};
  made_of_[number] = paint;
  return number;
}
int32_t SceneBuilder::add_program(Program program) {
  Texture texture;
  texture.file = fmt::format("texture {}", scene.textures.size() + 1);
  texture.program = std::move(program);
  scene.textures.push_back(std::move(texture));
  return static_cast<int32_t>(scene.textures.size());
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

void SceneBuilder::set_bump(const PaintRef& height, double scale, lumicut_material& m) {
  if (constant_of(height) || scale == 0) return;
  const int32_t heights = number_texture(height);
  if (!scene.textures.at(static_cast<size_t>(heights) - 1).program) {
    m.height_texture = heights, m.bump_distance = static_cast<float>(scale);
    return;
  }
  Program program;
  lumicut_instruction in{};
  in.op = LUMICUT_OP_BUMP;
  in.inputs[0] = compile(decoded(height, false), program);
  const auto number = [&](double x) {
    for (int k = 0; k < 3; ++k) program.constants.push_back(static_cast<float>(x));
    return -static_cast<int32_t>(program.constants.size() / 3);
  };
  in.inputs[1] = number(1), in.inputs[2] = number(scale), in.inputs[4] = number(0);  // the library's own width
  lumicut_instruction normal{};
  normal.op = LUMICUT_OP_NORMAL;
  program.instructions.push_back(normal);
  in.inputs[3] = static_cast<int32_t>(program.instructions.size() - 1);
  program.instructions.push_back(in);
  m.normal_texture = add_program(std::move(program)), m.normal_strength = 0;
}

void SceneBuilder::set_colour(const PaintRef& paint, float* factor, int32_t& texture) {
  texture = 0;
  if (const auto value = constant_of(paint)) {
    for (size_t k = 0; k < 3; ++k) factor[k] = static_cast<float>(std::clamp((*value)[k], 0.0, 1.0));
    return;
  }
  const auto [rest, by] = without_factor(paint);
  for (size_t k = 0; k < 3; ++k) factor[k] = static_cast<float>(std::clamp(by[k], 0.0, 1e6));
  texture = texture_of(decoded(rest, true));
}
void SceneBuilder::set_number(const PaintRef& paint, float& factor, int32_t& texture) {
  texture = 0;
  if (const auto value = constant_of(paint)) {
    factor = static_cast<float>(std::clamp((*value)[0], 0.0, 1.0));
    return;
  }
  const auto [rest, by] = without_factor(paint);
  const bool apart = by[0] > 0 && by[0] <= 1;
  factor = apart ? static_cast<float>(by[0]) : 1;
  texture = number_texture(apart ? rest : paint);
}

uint32_t SceneBuilder::add_material(const std::string& name, const lumicut_material& values) {
  scene.materials.push_back({name, values});
  return static_cast<uint32_t>(scene.materials.size() - 1);
}

std::optional<uint32_t> SceneBuilder::with_absorption(uint32_t material, const Vec& absorption) {
  lumicut_material values = scene.materials.at(material).values;
  if (!(values.transmission > 0) || (values.flags & LUMICUT_SHADOWS_PASS) != 0) return std::nullopt;
  for (size_t k = 0; k < 3; ++k) values.absorption[k] = static_cast<float>(std::clamp(absorption[k], 0.0, 1e15));
  return variant_of(material, values, ", which absorbs");
}

uint32_t SceneBuilder::with_emission(uint32_t material, const Vec& radiance, int32_t texture, bool both_sides) {
  lumicut_material values = scene.materials.at(material).values;
  for (size_t k = 0; k < 3; ++k) values.emission[k] = static_cast<float>(std::clamp(radiance[k], 0.0, 1e15));
  values.emission_texture = texture;
  if (both_sides) values.flags |= LUMICUT_EMIT_BOTH_SIDES;
  return variant_of(material, values, ", which emits");
}

uint32_t SceneBuilder::variant_of(uint32_t material, const lumicut_material& values, const char* what) {
  for (size_t i = material + 1; i < scene.materials.size(); ++i)
    if (std::equal(reinterpret_cast<const char*>(&values), reinterpret_cast<const char*>(&values + 1),
                   reinterpret_cast<const char*>(&scene.materials[i].values)))
      return static_cast<uint32_t>(i);
  return add_material(scene.materials[material].name + what, values);
}

bool SceneBuilder::reads_vertices(uint32_t material) const {
  const lumicut_material& m = scene.materials.at(material).values;
  for (const int32_t texture :
       {m.diffuse_texture, m.specular_texture, m.translucency_texture, m.roughness_texture, m.diffuse_roughness_texture,
        m.metallic_texture, m.opacity_texture, m.emission_texture, m.normal_texture}) {
    if (texture <= 0) continue;
    const auto& program = scene.textures.at(static_cast<size_t>(texture) - 1).program;
    if (program && std::any_of(program->instructions.begin(), program->instructions.end(),
                               [](const lumicut_instruction& in) { return in.op == LUMICUT_OP_ATTRIBUTE; }))
      return true;
  }
  return false;
}

void SceneBuilder::add(const std::string& name, const Geometry& geometry, const Affine& place, uint32_t material,
                       bool flipped, const std::string& key, uint32_t mask) {
  for (const double v : place.m)
    if (!(std::abs(v) < kLargestCoordinate)) fail(name, fmt::format("its transform has the number {}", v));
  if (!(std::abs(place.determinant()) > 0)) return leave_out(name + ", which is scaled to nothing");
  if (geometry.indices.empty()) return leave_out(name + ", which has no triangles");
  const std::string whole = fmt::format("{} {} {} {}", key, material, flipped, mask);
  if (!key.empty()) {
    const auto known = shared_.find(whole);
    if (known != shared_.end()) {
      for (const double v : place.m) scene.meshes[known->second].transforms.push_back(static_cast<float>(v));
      return;
    }
    shared_[whole] = scene.meshes.size();
  }
  Mesh mesh;
  mesh.name = name, mesh.mask = mask;
  mesh.positions = geometry.positions, mesh.normals = geometry.normals, mesh.uvs = geometry.uvs,
  mesh.indices = geometry.indices;
  if (flipped) {
    for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) std::swap(mesh.indices[i + 1], mesh.indices[i + 2]);
    for (float& n : mesh.normals) n = -n;
  }
  for (const float x : mesh.positions)
    if (!(std::abs(x) < static_cast<float>(kLargestCoordinate))) fail(name, fmt::format("has a coordinate of {}", x));
  mesh.materials.assign(mesh.indices.size() / 3, material);
  if (reads_vertices(material)) {
    if (geometry.colours.empty())
      approximate(name + " has no colours of vertices and is black");
    else
      mesh.attributes.push_back({VertexColours::kAttribute, 3, LUMICUT_OF_VERTICES, geometry.colours});
  }
  for (const double v : place.m) mesh.transforms.push_back(static_cast<float>(v));
  scene.meshes.push_back(std::move(mesh));
}

std::vector<Geometry> SceneBuilder::read_meshes(const std::string& name) {
  const FoundFile file = find(name);
  if (file.path.empty()) fail("", missing_file("mesh", path_, name));
  if (!has_meshes(file.path)) fail("", fmt::format("the mesh {} is of no format that is read here", shown(name)));
  std::vector<Geometry> out;
  for (Mesh& mesh : read_model_meshes(file.path, scene.warnings)) {
    out.push_back(
        {std::move(mesh.positions), std::move(mesh.normals), std::move(mesh.uvs), std::move(mesh.indices), {}});
    // They were taken as sRGB.
    for (const Attribute& attribute : mesh.attributes)
      for (const float x : attribute.values)
        out.back().colours.push_back(x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f);
  }
  return out;
}

void SceneBuilder::add_light(const lumicut_light& light, const std::string& name) {
  scene.lights.push_back(light);
  scene.lights.back().struct_size = sizeof(light);
  scene.light_names.push_back(name);
}

void SceneBuilder::add_profile_light(const Vec& position, const Vec& direction, const Vec& tangent, const Vec& colour,
                                     Profile profile, const std::string& name) {
  profile.file = name;
  scene.profiles.push_back(std::move(profile));
  lumicut_light light{};
  light.type = LUMICUT_POINT, light.value = 1;
  light.profile = static_cast<uint32_t>(scene.profiles.size());
  store(light.position, position), store(light.direction, unit(direction)), store(light.color, colour);
  store(light.tangent, tangent);
  add_light(light, name);
}

void SceneBuilder::hide_emitters() {
  if (scene.environment) scene.environment->flags |= LUMICUT_HIDDEN;
  const auto emits = [&](uint32_t number) {
    const float* e = scene.materials.at(number).values.emission;
    return std::max({e[0], e[1], e[2]}) > 0;
  };
  constexpr uint32_t kAll = LUMICUT_CAMERA_RAYS | LUMICUT_DIFFUSE_RAYS | LUMICUT_GLOSSY_RAYS |
                            LUMICUT_TRANSMISSION_RAYS | LUMICUT_SHADOW_RAYS;
  for (Mesh& mesh : scene.meshes)
    if (!mesh.materials.empty() && emits(mesh.materials[0]))
      mesh.mask = (mesh.mask == 0 ? kAll : mesh.mask) & ~uint32_t{LUMICUT_CAMERA_RAYS};
}

SceneData SceneBuilder::finish(bool has_camera) {
  if (scene.meshes.empty()) fail("", "has no triangles: there is nothing to see");
  if (!has_camera) frame_scene(scene);
  if (!is_lit(scene)) add_sky(scene);
  const auto factor = static_cast<float>(exposure);
  for (lumicut_light& light : scene.lights) light.value *= factor;
  for (Material& material : scene.materials)
    for (float& x : material.values.emission) x *= factor;
  if (scene.environment)
    for (float& x : scene.environment->color) x *= factor;
  if (!emitters_seen) hide_emitters();
  scene.file = path_;
  return std::move(scene);
}

}  // namespace lumicut::io
