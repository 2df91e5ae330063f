#include "lights/near_lights.h"

#include <algorithm>
#include <numbers>

#include "core/spherical.h"
#include "lights/light_boxes.h"

namespace lumicut {

namespace {

constexpr uint32_t kLeaf = 4;
constexpr double kLeastSolidAngle = 1e-5;  // smaller ones are drawn by area: their sides are lost to rounding
constexpr float kPi = std::numbers::pi_v<float>;

struct Place {
  Vec3f at;
  double density;  // per steradian
};

// By area.
Place even_place(const EmitterShape& s, const Vec3f& from, float u, float v) {
  const float root = std::sqrt(u);
  const Vec3f at = s.corner + s.u * (root * (1.0f - v)) + s.v * (root * v);
  const Vec3f to = at - from;
  const double d2 = static_cast<double>(length2(to));
  const double cosine = std::abs(static_cast<double>(dot(s.normal, to))) / std::sqrt(d2);
  const double area = 0.5 * static_cast<double>(length(cross(s.u, s.v)));
  return {at, d2 / std::max(1e-9 * d2, cosine * area)};
}

std::optional<Place> on_plane(const EmitterShape& s, const Vec3f& from, const Vec3f& direction, double solid_angle) {
  const float towards = dot(s.normal, direction);
  if (towards == 0.0f) return {};
  const float t = dot(s.normal, s.corner - from) / towards;
  if (!(t > 0.0f)) return {};
  return Place{from + direction * t, 1.0 / solid_angle};
}

// A triangle, or both halves of a parallelogram.
std::optional<Place> flat_place(const EmitterShape& s, const Vec3f& from, float u, float v) {
  const SphericalTriangle first(from, s.corner, s.corner + s.u,
                                s.kind == EmitterShape::Kind::triangle ? s.corner + s.v : s.corner + s.u + s.v);
  if (s.kind == EmitterShape::Kind::triangle) {
    if (!(first.solid_angle() > kLeastSolidAngle)) return even_place(s, from, u, v);
    return on_plane(s, from, first.sample(u, v), first.solid_angle());
  }
  const SphericalTriangle second(from, s.corner, s.corner + s.u + s.v, s.corner + s.v);
  const double both = first.solid_angle() + second.solid_angle();
  if (!(both > kLeastSolidAngle)) {
    const Vec3f at = s.corner + s.u * u + s.v * v, to = at - from;
    const double d2 = static_cast<double>(length2(to));
    const double cosine = std::abs(static_cast<double>(dot(s.normal, to))) / std::sqrt(d2);
    return Place{at, d2 / std::max(1e-9 * d2, cosine * static_cast<double>(length(cross(s.u, s.v))))};
  }
  const auto share = static_cast<float>(first.solid_angle() / both);
  const Vec3f direction = u < share ? first.sample(std::min(u / share, 1.0f), v)
                                    : second.sample(std::min((u - share) / (1.0f - share), 1.0f), v);
  return on_plane(s, from, direction, both);
}

bool within_disk(const EmitterShape& s, const Vec3f& at) {
  const Vec2f along = s.along_edges(at);
  const float x = along.x - 0.5f, y = along.y - 0.5f;
  return x * x + y * y <= 0.25f;
}

std::optional<Place> sphere_place(const EmitterShape& s, const Vec3f& from, float u, float v) {
  const Vec3f to = s.corner - from;
  const float d2 = length2(to), r2 = s.radius * s.radius;
  if (!(d2 > r2)) return {};                                                       // within it nothing is seen
  const float sine2 = r2 / d2, height = sine2 / (1.0f + std::sqrt(1.0f - sine2));  // 1 − cosine of the cone
  const float below = u * height, cosine = 1.0f - below, sine = std::sqrt(std::max(0.0f, below * (2.0f - below)));
  const float d = std::sqrt(d2);
  const Vec3f direction =
      Frame(to / d).to_world({sine * std::cos(2.0f * kPi * v), sine * std::sin(2.0f * kPi * v), cosine});
  const float t = d * cosine - std::sqrt(std::max(0.0f, r2 - d2 * sine * sine));
  return Place{from + direction * t, 1.0 / (2.0 * std::numbers::pi * static_cast<double>(height))};
}

double solid_angle_of(const EmitterShape& s, const Vec3f& from) {
  const SphericalTriangle first(from, s.corner, s.corner + s.u,
                                s.kind == EmitterShape::Kind::triangle ? s.corner + s.v : s.corner + s.u + s.v);
  if (s.kind == EmitterShape::Kind::triangle) return first.solid_angle();
  return first.solid_angle() + SphericalTriangle(from, s.corner, s.corner + s.u + s.v, s.corner + s.v).solid_angle();
}

}  // namespace

NearLights::NearLights(const LightSampler& sampler, uint64_t lights, double clamp_lights, float distance,
                       const Progress& progress, const DiscreteDistribution* chances)
    : sampler_(sampler) {
  if (lights == 0 || !(clamp_lights > 0.0 || distance > 0.0f)) return;
  const size_t count = sampler.extended_count();
  std::vector<Aabb> boxes(count);
  std::vector<float> reach2(count), power(count);
  for (size_t i = 0; i < count; ++i) {
    if (i % 4096 == 0) progress.check();
    const auto shape = sampler.shape(i);
    if (!shape) continue;
    boxes[i] = shape->bounds();
    const double cell = sampler.cell(i, *shape, lights, chances);
    reach2[i] = distance > 0.0f ? distance * distance : static_cast<float>(clamp_lights * cell * std::numbers::inv_pi);
    power[i] = static_cast<float>(static_cast<double>(shape->area) / cell);
    if (reach2[i] > 0.0f && power[i] > 0.0f) order_.push_back(static_cast<uint32_t>(i));
  }
  if (order_.empty()) return;
  boxes_ = std::move(boxes), reach2_ = std::move(reach2), power_ = std::move(power);
  nodes_.reserve(2 * order_.size() / kLeaf + 2);
  nodes_.emplace_back();
  build(0, 0, static_cast<uint32_t>(order_.size()), progress);
  slot_of_.assign(count, 0), leaf_of_.assign(count, ~0u);
  for (uint32_t n = 0; n < nodes_.size(); ++n)
    for (uint32_t k = 0; k < nodes_[n].count; ++k) {
      const uint32_t slot = nodes_[n].first + k;
      slot_of_[order_[slot]] = slot, leaf_of_[order_[slot]] = n;
    }
  // By slot from here on.
  const auto in_order = [&](auto& values) {
    auto moved = values;
    moved.resize(order_.size());
    for (size_t s = 0; s < order_.size(); ++s) moved[s] = values[order_[s]];
    values = std::move(moved);
  };
  in_order(boxes_), in_order(reach2_), in_order(power_);
}

// Splits at the median of the longest axis. Boxes are by emitter yet.
void NearLights::build(uint32_t node, uint32_t begin, uint32_t end, const Progress& progress) {
  progress.check();
  Aabb box, centres;
  float reach2 = 0.0f, power = 0.0f;
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t e = order_[i];
    box.extend(boxes_[e]), centres.extend(boxes_[e].center());
    reach2 = std::max(reach2, reach2_[e]), power += power_[e];
  }
  nodes_[node].box = box, nodes_[node].reach2 = reach2, nodes_[node].power = power;
  if (end - begin <= kLeaf) {
    nodes_[node].first = begin, nodes_[node].count = end - begin;
    return;
  }
  const uint32_t middle = halve(boxes_, centres, order_, begin, end);
  const auto first = static_cast<uint32_t>(nodes_.size());
  nodes_[node].first = first;
  nodes_.emplace_back().parent = node;
  nodes_.emplace_back().parent = node;
  build(first, begin, middle, progress);
  build(first + 1, middle, end, progress);
}

// Of equal power, the nearer one counts more; 0 where the clamp takes nothing from any of its lights.
float NearLights::importance(const Aabb& box, float power, float reach2, const Vec3f& position) {
  if (!(box.dist2(position) < reach2)) return 0.0f;
  const float d2 = std::max(length2(box.center() - position), 0.25f * box.diagonal2());
  return power / std::max(d2, 1e-30f);
}

float NearLights::emitter_importance(uint32_t slot, const Vec3f& position) const {
  return importance(boxes_[slot], power_[slot], reach2_[slot], position);
}

std::optional<float> NearLights::share_of_first(const Node& parent, const Vec3f& position) const {
  const Node &a = nodes_[parent.first], &b = nodes_[parent.first + 1];
  const float wa = importance(a.box, a.power, a.reach2, position), wb = importance(b.box, b.power, b.reach2, position);
  if (!(wa + wb > 0.0f)) return {};
  return wa / (wa + wb);
}

bool NearLights::near(const Vec3f& position) const {
  return !nodes_.empty() && nodes_[0].box.dist2(position) < nodes_[0].reach2;
}

std::optional<NearLights::Sample> NearLights::sample(const Vec3f& position, float choice, float u, float v) const {
  if (!near(position)) return {};
  double chance = 1.0;
  uint32_t n = 0;
  while (nodes_[n].count == 0) {
    const std::optional<float> first_share = share_of_first(nodes_[n], position);
    if (!first_share) return {};
    const float share = *first_share;
    const bool left = choice < share;
    choice = left ? choice / share : (choice - share) / (1.0f - share);
    choice = std::clamp(choice, 0.0f, 0x1.fffffep-1f);
    chance *= static_cast<double>(left ? share : 1.0f - share);
    n = nodes_[n].first + (left ? 0 : 1);
  }
  float weights[kLeaf], sum = 0.0f;
  const Node& leaf = nodes_[n];
  for (uint32_t k = 0; k < leaf.count; ++k) sum += weights[k] = emitter_importance(leaf.first + k, position);
  if (!(sum > 0.0f)) return {};
  float at = choice * sum;
  uint32_t k = 0;
  while (k + 1 < leaf.count && at >= weights[k]) at -= weights[k++];
  if (!(weights[k] > 0.0f)) return {};
  const uint32_t slot = leaf.first + k, emitter = order_[slot];
  chance *= static_cast<double>(weights[k] / sum);

  const EmitterShape shape = *sampler_.shape(emitter);
  std::optional<Place> place;
  if (shape.kind == EmitterShape::Kind::sphere)
    place = sphere_place(shape, position, u, v);
  else
    place = flat_place(shape, position, u, v);
  if (!place || (shape.kind == EmitterShape::Kind::disk && !within_disk(shape, place->at))) return {};
  const Vec3f to = place->at - position;
  const float d2 = length2(to), lost = 1.0f - d2 / reach2_[slot];
  if (!(lost > 0.0f) || !(d2 > 0.0f)) return {};
  Sample s;
  s.density = chance * place->density;
  s.found_by_rays = sampler_.found_by_rays(emitter);
  const Vec3f normal = shape.kind == EmitterShape::Kind::sphere ? normalize(place->at - shape.corner) : shape.normal;
  const double cosine = std::abs(static_cast<double>(dot(normal, to))) / std::sqrt(static_cast<double>(d2));
  if (!(cosine > 0.0)) return {};
  // A solid angle of 1/density covers that much of its surface.
  const double area = static_cast<double>(d2) / (s.density * cosine);
  s.vpl = sampler_.place_on(emitter, shape, place->at, position, static_cast<float>(area), s.offset);
  s.vpl.intensity *= lost;
  return s;
}

NearLights::Found NearLights::found(const Vec3f& position, uint32_t emitter, float distance) const {
  if (nodes_.empty() || leaf_of_[emitter] == ~0u) return {};
  const uint32_t slot = slot_of_[emitter];
  const float lost = 1.0f - distance * distance / reach2_[slot];
  if (!(lost > 0.0f)) return {};
  const Node& leaf = nodes_[leaf_of_[emitter]];
  float sum = 0.0f;
  for (uint32_t k = 0; k < leaf.count; ++k) sum += emitter_importance(leaf.first + k, position);
  double chance = sum > 0.0f ? static_cast<double>(emitter_importance(slot, position) / sum) : 0.0;
  for (uint32_t n = leaf_of_[emitter]; n != 0; n = nodes_[n].parent) {
    const Node& parent = nodes_[nodes_[n].parent];
    const std::optional<float> share = share_of_first(parent, position);
    chance *= share ? static_cast<double>(n == parent.first ? *share : 1.0f - *share) : 0.0;
  }
  return {lost, chance};
}

NearLights::Found NearLights::find_light(const Vec3f& position, uint32_t light, float distance) const {
  const auto emitter = sampler_.emitter_of_light(light);
  return emitter ? with_solid_angle(position, static_cast<uint32_t>(*emitter), distance) : Found{};
}

NearLights::Found NearLights::find_triangle(const Vec3f& position, uint32_t mesh, uint32_t triangle, uint32_t instance,
                                            float distance) const {
  const auto emitter = sampler_.emitter_of_triangle(mesh, triangle, instance);
  return emitter ? with_solid_angle(position, static_cast<uint32_t>(*emitter), distance) : Found{};
}

NearLights::Found NearLights::with_solid_angle(const Vec3f& position, uint32_t emitter, float distance) const {
  Found f = found(position, emitter, distance);
  if (!(f.lost > 0.0f)) return f;
  const double solid_angle = solid_angle_of(*sampler_.shape(emitter), position);
  // Those drawn by area have about the same.
  f.density /= std::max(solid_angle, 1e-12);
  return f;
}

}  // namespace lumicut
