#include "scene/followed.h"

#include "scene/bsdf.h"

namespace lumicut {

float fresnel_reflectance(float cosine, float ratio, float& refracted) {
  refracted = 0.0f;
  const float sine2 = (1.0f - cosine * cosine) / (ratio * ratio);
  if (sine2 >= 1.0f) return 1.0f;
  refracted = std::sqrt(1.0f - sine2);
  const float s = (cosine - ratio * refracted) / (cosine + ratio * refracted),
              p = (ratio * cosine - refracted) / (ratio * cosine + refracted);
  return 0.5f * (s * s + p * p);
}

std::optional<Followed> follow(const Scene& scene, const SurfaceHit& hit, const Vec3f& to_viewer, float choice, float u,
                               float v) {
  const Material& material = scene.materials()[hit.material];
  if (!material.followed()) return {};
  const float alpha = material.alpha(), a2 = alpha * alpha;
  constexpr float kSmooth = 1e-4f;  // turned by less than single precision tells
  const bool behind = dot(hit.geometric_normal, to_viewer) < 0.0f;
  const Vec3f side = behind ? -hit.geometric_normal : hit.geometric_normal;
  const Frame frame(behind ? -hit.normal : hit.normal);
  Vec3f view = frame.to_local(to_viewer);
  if (view.z < 1e-3f) view = normalize(Vec3f{view.x, view.y, 1e-3f});  // shading normals may turn from the viewer
  const Vec3f h = alpha < kSmooth ? Vec3f{0, 0, 1} : sample_visible_normal(view, alpha, u, v);
  const float cosine = std::min(1.0f, std::max(0.0f, dot(view, h)));

  const GgxColors c = scene.ggx_colors(hit.material, hit.uv);
  const float ratio = behind ? 1.0f / material.ior : material.ior;
  float refracted = 0.0f;
  const float border = fresnel_reflectance(cosine, ratio, refracted);
  Rgb reflected = Rgb{1, 1, 1} * (c.clear * border), passed{};
  if (alpha < kLeastAlpha) {
    const float p = schlick_share(cosine), edge = c.grazing * p;
    reflected += c.specular * (1.0f - p) + Rgb{edge, edge, edge};
  }
  // The base colour is that of two borders, as a closed body has them.
  const float through = c.clear * (1.0f - border);
  for (int k = 0; k < 3; ++k) passed[k] = through * std::sqrt(std::max(0.0f, c.base[k]));
  const float most_reflected = max_component(reflected), most_passed = max_component(passed);
  const float sum = most_reflected + most_passed;
  if (!(sum > 0.0f)) return {};

  Followed f;
  f.transmitted = choice * sum >= most_reflected;
  const Vec3f local = f.transmitted ? h * (cosine / ratio - refracted) - view * (1.0f / ratio) : reflect(view, h);
  const float nl = f.transmitted ? -local.z : local.z;
  if (!(nl > 0.0f)) return {};
  f.direction = normalize(frame.to_world(local));
  if (!f.transmitted && alpha < kSmooth && dot(f.direction, side) <= 0.0f) f.direction = reflect(to_viewer, side);
  const float away = dot(f.direction, side);
  if (f.transmitted ? !(away < 0.0f) : !(away > 0.0f)) return {};
  float masking = 1.0f;
  if (alpha >= kSmooth) {
    const float root_v = ggx_root(a2, view.z), root_l = ggx_root(a2, nl);
    masking = f.transmitted ? 2.0f * nl / (nl + root_l) : nl * (view.z + root_v) / (nl * root_v + view.z * root_l);
  }
  f.weight = f.transmitted ? passed * (masking * sum / most_passed) : reflected * (masking * sum / most_reflected);
  f.origin = hit.position + side * (f.transmitted ? -scene.epsilon() : scene.epsilon());
  return f;
}

}  // namespace lumicut
