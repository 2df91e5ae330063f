#include "bsdf/bsdf.h"

#include "bsdf/ggx_transmission.h"

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
  if (parameters.model != LobeModel::ggx) {
    p.mirror = normalize(reflect(to_viewer_, p.normal));
    p.diffuse = parameters.diffuse * kInvPi;
    p.specular = parameters.specular * cosine_lobe_scale(parameters.model == LobeModel::phong, parameters.exponent);
    p.shape = parameters.exponent;
    diffuse_color_ = parameters.diffuse, specular_color_ = parameters.specular;
    return;
  }
  colors_ = ggx_colors(parameters);
  diffuse_color_ = parameters.diffuse * ((1.0f - parameters.metallic) * (1.0f - parameters.transmission));
  specular_color_ = colors_.specular;
  specular_ = smooth_coat(parameters.coat, parameters.coat_alpha) || colors_.is_specular();
  const float cosine = set_mirror(to_viewer_, p);
  const GgxDiffuse diffuse = ggx_diffuse(colors_, cosine);
  p.diffuse = diffuse.scale * kInvPi;
  p.falloff = diffuse.falloff;
  p.lobe = kLobe<GgxReflection>, p.shape = std::max(kLeastAlpha, colors_.alpha);
  if (colors_.alpha >= kLeastAlpha) p.specular = colors_.specular, p.grazing = colors_.grazing;
  if (!(parameters.coat > 0.0f)) return;
  const ClearCoat coat = clear_coat(parameters);
  dim_by_coat(coat, cosine, p);
  if (smooth_coat(parameters.coat, parameters.coat_alpha)) return;
  SurfacePoint& above = layers_[layer_count_++];
  above.position = p.position, above.normal = p.normal, above.mirror = p.mirror, above.pixel = p.pixel;
  above.lobe = kLobe<GgxReflection>, above.shape = coat.alpha;
  above.specular = Rgb{1, 1, 1} * coat.f0, above.grazing = Rgb{1, 1, 1} * coat.f90;
}

Rgb Bsdf::evaluate(const Vec3f& to_light) const {
  Rgb f{};
  for (const SurfacePoint& p : layers()) f += reflectance(p, to_light);
  return f;
}

// Chance to choose the layer above.
float Bsdf::coat_share() const {
  if (layer_count_ < 2) return 0.0f;
  const float above = largest_albedo(layers_[1]), beneath = largest_albedo(layers_[0]);
  return above / (above + beneath);
}

float Bsdf::pdf(const Vec3f& direction) const {
  const float share = coat_share(), beneath = PointBsdf(layers_[0]).pdf(direction);
  return share > 0.0f ? share * PointBsdf(layers_[1]).pdf(direction) + (1.0f - share) * beneath : beneath;
}

std::optional<BsdfSample> Bsdf::sample(float layer, float choice, float u, float v) const {
  auto s = PointBsdf(layers_[layer < coat_share() ? 1 : 0]).sample(choice, u, v);
  if (!s || layer_count_ < 2) return s;
  s->pdf = pdf(s->direction);
  s->weight = evaluate(s->direction) * (std::max(0.0f, dot(normal_, s->direction)) / s->pdf);
  return s;
}

Rgb Bsdf::lambertian_intensity(const Rgb& flux) const {
  if (parameters_.model != LobeModel::ggx) return flux * parameters_.diffuse * kInvPi;
  return flux * layers_[0].diffuse * mean_diffuse_falloff(layers_[0].falloff);
}

std::optional<BsdfSample> Bsdf::sample_specular(float choice, float u, float v) const {
  if (!specular_) return {};
  constexpr float kSmooth = 1e-4f;  // turned by less than single precision tells
  const GgxColors& c = colors_;
  const Frame frame(normal_);
  Vec3f view = frame.to_local(to_viewer_);
  if (view.z < 1e-3f) view = normalize(Vec3f{view.x, view.y, 1e-3f});  // shading normals may turn from the viewer
  const auto half_vector = [&](float alpha) {
    return alpha < kSmooth ? Vec3f{0, 0, 1} : sample_visible_normal(view, alpha, u, v);
  };

  float alpha = c.alpha;
  Vec3f h = half_vector(alpha);
  const float cosine = std::min(1.0f, std::max(0.0f, dot(view, h)));
  const float ratio = behind_ ? 1.0f / parameters_.ior : parameters_.ior;
  float refracted = 0.0f;
  Rgb reflected{}, passed{};
  if (c.clear > 0.0f) {
    const float border = fresnel_reflectance(cosine, ratio, refracted);
    const bool rough = !(alpha < kSmooth) && parameters_.glass != nullptr;
    const float clear = c.clear / (rough ? parameters_.glass->at(behind_, alpha, view.z) : 1.0f);
    reflected += Rgb{1, 1, 1} * (clear * border);
    // The base colour is that of two borders, as a closed body has them.
    for (int k = 0; k < 3; ++k) passed[k] = clear * (1.0f - border) * std::sqrt(std::max(0.0f, c.base[k]));
  }
  if (alpha < kLeastAlpha) {
    const float p = schlick_share(cosine);
    reflected += c.specular * (1.0f - p) + c.grazing * p;
  }
  float of_coat = 0.0f;
  if (parameters_.coat > 0.0f) {
    const ClearCoat coat = clear_coat(parameters_);
    const float shown = coat.transmittance.at(view.z);
    reflected *= shown, passed *= shown;
    if (smooth_coat(parameters_.coat, parameters_.coat_alpha))
      of_coat = coat_reflectance(coat, dot(view, half_vector(coat.alpha)));
  }
  const float most_reflected = max_component(reflected), most_passed = max_component(passed);
  const float sum = most_reflected + most_passed + of_coat;
  if (!(sum > 0.0f)) return {};

  BsdfSample s;
  const float place = choice * sum;
  const bool transmitted = most_passed > 0.0f && place >= most_reflected + of_coat;
  if (!transmitted && of_coat > 0.0f && place >= most_reflected) {
    alpha = parameters_.coat_alpha;
    h = half_vector(alpha);
    s.weight = Rgb{sum, sum, sum};
  } else {
    s.weight = transmitted ? passed * (sum / most_passed) : reflected * (sum / std::max(most_reflected, 1e-30f));
  }
  const Vec3f local = transmitted ? refract(view, h, cosine, ratio, refracted) : reflect(view, h);
  const float nl = transmitted ? -local.z : local.z;
  if (!(nl > 0.0f)) return {};
  s.direction = normalize(frame.to_world(local));
  if (!transmitted && alpha < kSmooth && dot(s.direction, side_) <= 0.0f) s.direction = reflect(to_viewer_, side_);
  const float away = dot(s.direction, side_);
  if (transmitted ? !(away < 0.0f) : !(away > 0.0f)) return {};
  if (alpha >= kSmooth)
    s.weight *= transmitted ? masking_transmitted(alpha * alpha, nl) : masking_reflected(alpha * alpha, view.z, nl);
  s.flags = kSpecular | (transmitted ? kTransmitted : kReflected);
  return s;
}

std::optional<ScatterSample> Bsdf::scatter(Rng& rng) const {
  if (parameters_.model != LobeModel::ggx) return scatter_cosine(rng);
  const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float(), lobe = rng.next_float();
  const auto specular = sample_specular(lobe, u, v);
  const float q_specular = specular ? std::min(1.0f, max_component(specular->weight)) : 0.0f;
  const bool two = layer_count_ > 1;
  const float beneath = largest_albedo(layers_[0]), above = two ? largest_albedo(layers_[1]) : 0.0f;
  const float q_layers = std::min(1.0f, beneath + above);
  const float survive = std::min(1.0f, q_specular + q_layers);
  if (!(choice < survive)) return {};
  const float p_specular = survive * q_specular / (q_specular + q_layers);
  if (choice < p_specular) {
    // Camera paths leave out that refraction changes radiance by the square of the indices' ratio; so that both kinds of
    // paths give one image, light paths carry it. [Veach 1997, 5.2]
    const bool refracted = (specular->flags & kTransmitted) != 0;
    const float ratio = behind_ ? 1.0f / parameters_.ior : parameters_.ior;
    const float narrowed = refracted ? 1.0f / (ratio * ratio) : 1.0f;
    return ScatterSample{specular->direction, specular->weight, narrowed / p_specular, specular->flags};
  }
  const float share = two ? above / (above + beneath) : 0.0f;
  const bool coat = two && rng.next_float() < share;
  const auto s = PointBsdf(layers_[coat ? 1 : 0]).sample(lobe, u, v);
  if (!s || dot(s->direction, side_) < 0.0f) return {};
  return ScatterSample{s->direction, s->weight, 1.0f / ((survive - p_specular) * (coat ? share : 1.0f - share)),
                       s->flags};
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
    s.direction = sample_cosine_hemisphere(normal_, u, v);
    s.weight = kd, s.factor = 1.0f / p_diffuse;
  } else {
    const float n = parameters_.exponent;
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
    auto s = sample_specular(choice, u, v);
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
  const float share = coat_share();
  const bool above = rng.next_float() < share;
  if (above) chosen.layer = &layers_[1];
  chosen.probability *= above ? share : 1.0f - share;
  return chosen;
}

}  // namespace lumicut
