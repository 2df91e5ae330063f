#include "bsdf/shade_points.h"

namespace lumicut {

namespace {
// Every float array of the structure, so that no member function can forget one.
template <typename Points, typename Fn>
void for_each_array(Points& p, Fn fn) {
  for (int k = 0; k < 3; ++k)
    fn(p.position[k]), fn(p.normal[k]), fn(p.mirror[k]), fn(p.diffuse[k]), fn(p.specular[k]), fn(p.grazing[k]);
  fn(p.exponent), fn(p.falloff), fn(p.alpha);
}
}  // namespace

void ShadePoints::clear() {
  for_each_array(*this, [](auto& a) { a.clear(); });
  pixel.clear();
  size_ = 0;
  glossy_ = ggx_ = false;
}

void ShadePoints::reserve(size_t n) {
  n = round_up_to_lanes(n);
  for_each_array(*this, [n](auto& a) { a.reserve(n); });
  pixel.reserve(n);
}

void ShadePoints::push(const SurfacePoint& p) {
  for (int k = 0; k < 3; ++k) {
    position[k].push_back(p.position[k]);
    normal[k].push_back(p.normal[k]);
    mirror[k].push_back(p.mirror[k]);
    diffuse[k].push_back(p.diffuse[k]);
    specular[k].push_back(p.specular[k]);
    grazing[k].push_back(p.grazing[k]);
  }
  exponent.push_back(p.exponent), falloff.push_back(p.falloff), alpha.push_back(p.alpha);
  pixel.push_back(p.pixel);
  ggx_ = ggx_ || p.ggx();
  glossy_ = glossy_ || p.ggx() || max_component(p.specular) > 0.0f;
  ++size_;
}

void ShadePoints::finish() {
  if (size_ == 0) return;
  const size_t padded = round_up_to_lanes(size_);
  for_each_array(*this, [&](auto& a) { a.resize(padded, a[size_ - 1]); });
  pixel.resize(padded, pixel[size_ - 1]);
}

SurfacePoint ShadePoints::get(size_t i) const {
  const auto at = [i](const std::vector<float>(&a)[3]) { return Vec3f{a[0][i], a[1][i], a[2][i]}; };
  return {at(position), at(normal), at(mirror),  at(diffuse), at(specular),
          exponent[i],  pixel[i],   at(grazing), falloff[i],  alpha[i]};
}

}  // namespace lumicut
