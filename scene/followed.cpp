#include "scene/followed.h"

#include "scene/bsdf.h"

namespace lumicut {

std::optional<Followed> follow(const Scene& scene, const SurfaceHit& hit, const Vec3f& to_viewer, float choice, float u,
                               float v) {
  const Material& material = scene.materials()[hit.material];
  if (!material.followed()) return {};
  const GgxColors c = scene.ggx_colors(hit.material, hit.uv);
  if (!c.followed() && !material.smooth_coat()) return {};
  constexpr float kSmooth = 1e-4f;  // turned by less than single precision tells
  const bool behind = dot(hit.geometric_normal, to_viewer) < 0.0f;
  const Vec3f side = behind ? -hit.geometric_normal : hit.geometric_normal;
  const Frame frame(behind ? -hit.normal : hit.normal);
  Vec3f view = frame.to_local(to_viewer);
  if (view.z < 1e-3f) view = normalize(Vec3f{view.x, view.y, 1e-3f});  // shading normals may turn from the viewer
  const auto half_vector = [&](float alpha) {
    return alpha < kSmooth ? Vec3f{0, 0, 1} : sample_visible_normal(view, alpha, u, v);
  };

  float alpha = c.alpha;
  Vec3f h = half_vector(alpha);
  float cosine = std::min(1.0f, std::max(0.0f, dot(view, h)));
  const float ratio = behind ? 1.0f / material.ior : material.ior;
  float refracted = 0.0f;
  Rgb reflected{}, passed{};
  if (c.clear > 0.0f) {
    const float border = fresnel_reflectance(cosine, ratio, refracted);
    const float clear = c.clear / (alpha < kSmooth ? 1.0f : scene.glass_albedo(hit.material, behind, alpha, view.z));
    reflected += Rgb{1, 1, 1} * (clear * border);
    // The base colour is that of two borders, as a closed body has them.
    for (int k = 0; k < 3; ++k) passed[k] = clear * (1.0f - border) * std::sqrt(std::max(0.0f, c.base[k]));
  }
  if (alpha < kLeastAlpha) {
    const float p = schlick_share(cosine);
    reflected += c.specular * (1.0f - p) + c.grazing * p;
  }
  float coat = 0.0f;
  if (material.coat > 0.0f) {
    const ClearCoat clear = clear_coat(material);
    const float shown = clear.rest.at(view.z);
    reflected *= shown, passed *= shown;
    if (material.smooth_coat()) {
      const float p = schlick_share(dot(view, half_vector(material.coat_alpha())));
      coat = clear.f0 * (1.0f - p) + clear.f90 * p;
    }
  }
  const float most_reflected = max_component(reflected), most_passed = max_component(passed);
  const float sum = most_reflected + most_passed + coat;
  if (!(sum > 0.0f)) return {};

  Followed f;
  const float place = choice * sum;
  f.transmitted = most_passed > 0.0f && place >= most_reflected + coat;
  if (!f.transmitted && coat > 0.0f && place >= most_reflected) {
    alpha = material.coat_alpha();
    h = half_vector(alpha);
    f.weight = Rgb{sum, sum, sum};
  } else {
    f.weight = f.transmitted ? passed * (sum / most_passed) : reflected * (sum / std::max(most_reflected, 1e-30f));
  }
  const Vec3f local = f.transmitted ? h * (cosine / ratio - refracted) - view * (1.0f / ratio) : reflect(view, h);
  const float nl = f.transmitted ? -local.z : local.z;
  if (!(nl > 0.0f)) return {};
  f.direction = normalize(frame.to_world(local));
  if (!f.transmitted && alpha < kSmooth && dot(f.direction, side) <= 0.0f) f.direction = reflect(to_viewer, side);
  const float away = dot(f.direction, side);
  if (f.transmitted ? !(away < 0.0f) : !(away > 0.0f)) return {};
  if (alpha >= kSmooth)
    f.weight *= f.transmitted ? masking_transmitted(alpha * alpha, nl) : masking_reflected(alpha * alpha, view.z, nl);
  f.origin = hit.position + side * (f.transmitted ? -scene.epsilon() : scene.epsilon());
  return f;
}

}  // namespace lumicut
