#include "bsdf/bsdf.h"

#include "bsdf/ggx_transmission.h"
#include "bsdf/straight_glass.h"

namespace lumicut {

namespace {

constexpr float kInvPi = std::numbers::inv_pi_v<float>;

// Sets the view's mirror image; returns the view's cosine. Bent shading normals may turn from the viewer: seen edge-on
// then.
float set_mirror(const Vec3f& to_viewer, SurfacePoint& p) {
  constexpr float kEdge = 0.01f;
  float cosine = dot(p.normal, to_viewer);
  Vec3f view = to_viewer;
  if (cosine < kEdge) view = normalize(view + p.normal * (kEdge - cosine)), cosine = kEdge;
  p.mirror = normalize(reflect(view, p.normal));
  return cosine;
}

float largest_albedo(const SurfacePoint& layer) { return max_component(PointBsdf(layer).albedo()); }

}  // namespace

Bsdf::Bsdf(const BsdfParameters& parameters, const SurfaceView& view)
    : parameters_(parameters),
      behind_(dot(view.geometric_normal, view.to_viewer) < 0.0f),  // two-sided: scenes are wound as they are
      position_(view.position),
      side_(behind_ ? -view.geometric_normal : view.geometric_normal),
      normal_(behind_ ? -view.normal : view.normal),
      to_viewer_(view.to_viewer),
      offset_(view.offset) {
  SurfacePoint& p = layers_[0];
  layer_count_ = 1;
  p.position = origin(kReflected);
  p.normal = normal_;
  p.pixel = view.pixel;
  p.smooth = behind_ ? -view.smooth : view.smooth;
  p.not_lit_by = view.not_lit_by;
  if (parameters.model != LobeModel::ggx) {
    p.mirror = normalize(reflect(to_viewer_, p.normal));
    p.diffuse = parameters.diffuse * kInvPi;
    if (parameters.slope > 0.0f) {
      const Grooves facets =
          grooves(parameters.diffuse, parameters.slope, parameters.diffuse_once, set_mirror(to_viewer_, p));
      p.diffuse *= facets.scale, p.slope = facets.slope, p.again = facets.again;
    }
    p.specular = parameters.specular * cosine_lobe_scale(parameters.model == LobeModel::phong, parameters.exponent);
    p.shape = parameters.exponent;
    diffuse_color_ = parameters.diffuse, specular_color_ = parameters.specular;
    add_other_side();
    return;
  }
  colors_ = ggx_colors(parameters);
  diffuse_color_ = parameters.diffuse * ((1.0f - parameters.metallic) * (1.0f - parameters.transmission));
  specular_color_ = colors_.specular;
  specular_ = smooth_coat(parameters.coat, parameters.coat_alpha) || colors_.is_specular();
  const float cosine = set_mirror(to_viewer_, p);
  const GgxDiffuse diffuse = ggx_diffuse(colors_, parameters, cosine);
  p.diffuse = diffuse.scale * kInvPi;
  p.falloff = diffuse.falloff, p.slope = diffuse.slope, p.again = diffuse.again;
  p.retro = 2.0f * std::sqrt(colors_.alpha) * diffuse.burley, p.dim = 0.5f * diffuse.burley;
  p.lobe = kLobe<GgxReflection>, p.shape = std::max(kLeastAlpha, colors_.alpha);
  p.ior = colors_.ior;
  if (colors_.alpha >= kLeastAlpha) {
    p.specular = colors_.specular, p.grazing = colors_.grazing;
    if (parameters.bright_lobe) brighten_lobe(colors_, parameters.fresnel, cosine, p.specular, p.grazing);
  }
  if (parameters.coat > 0.0f) {
    const ClearCoat coat = clear_coat(parameters, cosine);
    if (!parameters.additive) dim_by_coat(coat, p);
    if (!smooth_coat(parameters.coat, parameters.coat_alpha)) {
      SurfacePoint& above = layers_[layer_count_++];
      above.position = p.position, above.normal = p.normal, above.mirror = p.mirror, above.pixel = p.pixel;
      above.not_lit_by = p.not_lit_by;
      above.lobe = kLobe<GgxReflection>, above.shape = coat.alpha, above.ior = coat.ior;
      above.specular = Rgb{1, 1, 1} * coat.f0, above.grazing = Rgb{1, 1, 1} * coat.f90;
    }
  }
  add_other_side();
}

// What passes evenly is a Lambert point on the other side: kernels and bounds know nothing of it.
void Bsdf::add_other_side() {
  if (!translucent()) return;
  SurfacePoint& other = layers_[layer_count_++];
  other.position = origin(kTransmitted);
  other.normal = other.mirror = -normal_;
  other.diffuse = parameters_.translucency * kInvPi;
  other.pixel = layers_[0].pixel, other.not_lit_by = layers_[0].not_lit_by;
  other.smooth = -layers_[0].smooth;
}

Rgb Bsdf::evaluate(const Vec3f& to_light) const {
  Rgb f{};
  for (const SurfacePoint& p : layers())
    if (!translucent() || dot(p.normal, to_light) > 0.0f) f += reflectance(p, to_light);
  return f;
}

std::array<float, 3> Bsdf::layer_shares() const {
  std::array<float, 3> shares{};
  float sum = 0.0f;
  for (size_t i = 0; i < layer_count_; ++i) sum += shares[i] = layer_count_ > 1 ? largest_albedo(layers_[i]) : 1.0f;
  for (float& share : shares) share = sum > 0.0f ? share / sum : 0.0f;
  return shares;
}

// The layer that a number in [0, 1) falls to, from the last to the first.
size_t Bsdf::layer_at(const std::array<float, 3>& shares, float choice) const {
  size_t layer = layer_count_ - 1;
  while (layer > 0 && choice >= shares[layer]) choice -= shares[layer--];
  return layer;
}

float Bsdf::pdf(const Vec3f& direction) const {
  const auto shares = layer_shares();
  float sum = 0.0f;
  for (size_t i = 0; i < layer_count_; ++i)
    if (dot(layers_[i].normal, direction) > 0.0f) sum += shares[i] * PointBsdf(layers_[i]).pdf(direction);
  return sum;
}

std::optional<BsdfSample> Bsdf::sample(float layer, float choice, float u, float v) const {
  const size_t chosen = layer_at(layer_shares(), layer);
  auto s = PointBsdf(layers_[chosen]).sample(choice, u, v);
  if (!s || layer_count_ < 2) return s;
  s->flags = side_of(chosen);
  s->pdf = pdf(s->direction);
  s->weight = evaluate(s->direction) * (std::max(0.0f, dot(layers_[chosen].normal, s->direction)) / s->pdf);
  return s;
}

Rgb Bsdf::passed_intensity(const Rgb& flux) const { return flux * parameters_.translucency * kInvPi; }

Rgb Bsdf::lambertian_intensity(const Rgb& flux) const {
  const SurfacePoint& p = layers_[0];
  if (parameters_.model != LobeModel::ggx && !p.grooved()) return flux * parameters_.diffuse * kInvPi;
  return flux * p.diffuse * mean_diffuse_factor(p);
}

std::optional<BsdfSample> Bsdf::sample_specular(float choice, float u, float v, Passage passage) const {
  return specular_way({}, choice, u, v, passage);
}

std::array<std::optional<BsdfSample>, 3> Bsdf::specular_ways(float u, float v, Passage passage) const {
  return {specular_way(Way::reflected, 0.0f, u, v, passage), specular_way(Way::coat, 0.0f, u, v, passage),
          specular_way(Way::passed, 0.0f, u, v, passage)};
}

std::optional<BsdfSample> Bsdf::specular_way(std::optional<Way> way, float choice, float u, float v,
                                             Passage passage) const {
  if (!specular_) return {};
  const bool straight = parameters_.shadows_pass && passage != Passage::refracted;
  const GgxColors& c = colors_;
  const Frame frame(normal_);
  Vec3f view = frame.to_local(to_viewer_);
  if (view.z < 1e-3f) view = normalize(Vec3f{view.x, view.y, 1e-3f});  // shading normals may turn from the viewer
  const auto half_vector = [&](float alpha) {
    return alpha < kSmoothAlpha ? Vec3f{0, 0, 1} : sample_visible_normal(view, alpha, u, v);
  };

  float alpha = c.alpha;
  Vec3f h = half_vector(alpha);
  const float cosine = std::min(1.0f, std::max(0.0f, dot(view, h)));
  const bool inside = behind_ && (!straight || parameters_.open_glass);
  const float ratio = inside ? 1.0f / parameters_.ior : parameters_.ior;
  float refracted = 0.0f;
  Rgb reflected{}, passed{};
  if (c.clear > 0.0f) {
    const float border = fresnel_reflectance(cosine, ratio, refracted);
    const bool rough = !(alpha < kSmoothAlpha) && parameters_.glass != nullptr;
    const float kept = rough && !parameters_.facets_once ? parameters_.glass->at(inside, alpha, view.z) : 1.0f;
    const float clear = c.clear / kept;
    reflected += parameters_.specular_tint * (clear * border);
    // The base colour is that of two borders, as a closed body has them.
    for (int k = 0; k < 3; ++k) passed[k] = clear * (1.0f - border) * std::sqrt(std::max(0.0f, c.base[k]));
  }
  if (alpha < kLeastAlpha) {
    const float p = fresnel_share(cosine, c.ior);
    reflected += c.specular * (1.0f - p) + c.grazing * p;
  }
  float of_coat = 0.0f;
  if (parameters_.coat > 0.0f) {
    const ClearCoat coat = clear_coat(parameters_, view.z);
    const float shown = coat.transmittance.to_viewer;
    if (!parameters_.additive) reflected *= shown, passed *= shown;
    if (smooth_coat(parameters_.coat, parameters_.coat_alpha))
      of_coat = coat_reflectance(coat, dot(view, half_vector(coat.alpha)));
  }
  if (straight)
    passed = straight_transmittance(parameters_, dot(side_, to_viewer_), behind_ == (passage == Passage::straight));
  const float most_reflected = max_component(reflected), most_passed = max_component(passed);
  const float sum = most_reflected + most_passed + of_coat;
  if (!(sum > 0.0f)) return {};

  const float of_way[] = {most_reflected, of_coat, most_passed};
  const float place = choice * sum;
  const bool chosen = !way.has_value();
  if (chosen) {
    way = most_passed > 0.0f && place >= most_reflected + of_coat ? Way::passed
          : of_coat > 0.0f && place >= most_reflected             ? Way::coat
                                                                  : Way::reflected;
  }
  const float of_this = of_way[static_cast<size_t>(*way)];
  if (!(of_this > 0.0f) && !chosen) return {};
  BsdfSample s;
  const bool transmitted = *way == Way::passed;
  if (*way == Way::coat) {
    alpha = parameters_.coat_alpha;
    h = half_vector(alpha);
    const float all = chosen ? sum : of_coat;
    s.weight = Rgb{all, all, all};
  } else {
    s.weight = transmitted ? passed : reflected;
    if (chosen) s.weight *= sum / std::max(of_this, 1e-30f);
  }
  if (transmitted && straight) {
    s.direction = -to_viewer_, s.flags = kSpecular | kTransmitted | kStraight | kSharp;
    return s;
  }
  const Vec3f local = transmitted ? refract(view, h, cosine, ratio, refracted) : reflect(view, h);
  const float nl = transmitted ? -local.z : local.z;
  if (!(nl > 0.0f)) return {};
  s.direction = normalize(frame.to_world(local));
  if (!transmitted && alpha < kSmoothAlpha && dot(s.direction, side_) <= 0.0f) s.direction = reflect(to_viewer_, side_);
  const float away = dot(s.direction, side_);
  if (transmitted ? !(away < 0.0f) : !(away > 0.0f)) return {};
  if (alpha >= kSmoothAlpha)
    s.weight *= transmitted ? masking_transmitted(alpha * alpha, nl) : masking_reflected(alpha * alpha, view.z, nl);
  s.flags = kSpecular | (transmitted ? kTransmitted : kReflected);
  if (alpha < kSharpAlpha) s.flags |= kSharp;
  return s;
}

// What leaves evenly leaves by the geometric normal: light paths see shading normals where camera paths see geometric
// ones, and the reverse [lights/light_paths.cpp]. By the shortest rotation.
static Vec3f turned(const Vec3f& direction, const Vec3f& from, const Vec3f& to) {
  if (from == to) return direction;
  const float c = dot(from, to);
  const Vec3f axis = cross(from, to);
  return direction * c + cross(axis, direction) + axis * (dot(axis, direction) / (1.0f + c));
}

std::optional<ScatterSample> Bsdf::scatter(Rng& rng) const {
  if (parameters_.model != LobeModel::ggx && !translucent() && !layers_[0].grooved()) return scatter_cosine(rng);
  const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float(), lobe = rng.next_float();
  const auto specular = sample_specular(lobe, u, v, Passage::straight_from_light);
  const float q_specular = specular ? std::min(1.0f, max_component(specular->weight)) : 0.0f;
  float reflected = 0.0f;
  for (const SurfacePoint& p : layers()) reflected += largest_albedo(p);
  const float q_layers = std::min(1.0f, reflected);
  const float survive = std::min(1.0f, q_specular + q_layers);
  if (!(choice < survive)) return {};
  const float p_specular = survive * q_specular / (q_specular + q_layers);
  if (choice < p_specular) {
    // Camera paths leave out that refraction changes radiance by the square of the indices' ratio; so that both kinds of
    // paths give one image, light paths carry it. [Veach 1997, 5.2]
    const bool refracted = (specular->flags & (kTransmitted | kStraight)) == kTransmitted;
    const float ratio = behind_ ? 1.0f / parameters_.ior : parameters_.ior;
    const float narrowed = refracted ? 1.0f / (ratio * ratio) : 1.0f;
    return ScatterSample{specular->direction, specular->weight, narrowed / p_specular, specular->flags};
  }
  const auto shares = layer_shares();
  const size_t layer = layer_count_ > 1 ? layer_at(shares, rng.next_float()) : 0;
  auto s = PointBsdf(layers_[layer]).sample(lobe, u, v);
  const uint32_t side = side_of(layer);
  if (s && (s->flags & kGlossy) == 0)
    s->direction = turned(s->direction, layers_[layer].normal, side == kTransmitted ? -side_ : side_);
  if (!s || (side == kTransmitted) != (dot(s->direction, side_) < 0.0f)) return {};
  return ScatterSample{s->direction, s->weight, 1.0f / ((survive - p_specular) * shares[layer]),
                       side | (s->flags & kGlossy)};
}

// Blinn's and Phong's surfaces, by the largest of kd and ks.
std::optional<ScatterSample> Bsdf::scatter_cosine(Rng& rng) const {
  const Rgb &kd = parameters_.diffuse, &ks = parameters_.specular;
  const float qd = std::min(1.0f, max_component(kd)), qs = std::min(1.0f, max_component(ks));
  const float survive = std::min(1.0f, qd + qs);
  const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float();
  if (!(choice < survive)) return {};
  const float p_diffuse = survive * qd / (qd + qs);
  ScatterSample s;
  s.flags = kReflected;
  if (choice < p_diffuse) {
    s.direction = sample_cosine_hemisphere(side_, u, v);  // as turned() says
    s.weight = kd, s.factor = 1.0f / p_diffuse;
  } else {
    const float n = parameters_.exponent;
    s.flags |= kGlossy;
    s.direction = CosineLobe::sample(layers_[0], u, v);
    // lobe·cosθ / pdf, with pdf = (n+1)/2π cosⁿβ
    const float scale =
        cosine_lobe_scale(parameters_.model == LobeModel::phong, n) * 2.0f * std::numbers::pi_v<float> / (n + 1.0f);
    s.weight = ks, s.factor = scale * std::max(0.0f, dot(s.direction, normal_)) / (survive - p_diffuse);
  }
  if (!(dot(s.direction, side_) > 0.0f)) return {};
  return s;
}

PathChoice Bsdf::choose(Rng& rng) const {
  PathChoice chosen;
  if (specular_) {
    const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float(), either = rng.next_float();
    auto s = sample_specular(choice, u, v, Passage::straight);
    // Half of the paths each way, where there are two.
    const float share = layer_count_ < 2 && PointBsdf(layers_[0]).black() ? 1.0f : 0.5f;
    if (either < share) {
      chosen.specular = std::move(s), chosen.probability = share;
      return chosen;
    }
    chosen.probability = 1.0f - share;
  }
  chosen.layer = layers_.data();
  if (layer_count_ < 2) return chosen;
  const auto shares = layer_shares();
  const size_t layer = layer_at(shares, rng.next_float());
  chosen.layer = &layers_[layer];
  chosen.probability *= shares[layer];
  return chosen;
}

}  // namespace lumicut
