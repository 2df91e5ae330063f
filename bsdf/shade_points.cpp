#include "bsdf/shade_points.h"

#include <algorithm>

namespace lumicut {

namespace {
// Every array of the structure, so that no member function can forget one.
template <typename Points, typename Fn>
void for_each_array(Points& p, Fn fn) {
  for (int k = 0; k < 3; ++k)
    fn(p.position[k]), fn(p.normal[k]), fn(p.mirror[k]), fn(p.diffuse[k]), fn(p.specular[k]), fn(p.grazing[k]),
        fn(p.smooth[k]);
  fn(p.shape), fn(p.ior), fn(p.falloff), fn(p.retro), fn(p.dim), fn(p.slope), fn(p.again), fn(p.lobe), fn(p.pixel),
      fn(p.not_lit_by);
}
}  // namespace

void ShadePoints::clear() {
  for_each_array(*this, [](auto& a) { a.clear(); });
  size_ = 0;
  lobes_ = Lobes::none;
  bent_ = grooved_ = false;
}

void ShadePoints::reserve(size_t n) {
  n = round_up_to_lanes(n);
  for_each_array(*this, [n](auto& a) { a.reserve(n); });
}

void ShadePoints::push(const SurfacePoint& p) {
  for (int k = 0; k < 3; ++k) {
    position[k].push_back(p.position[k]);
    normal[k].push_back(p.normal[k]);
    mirror[k].push_back(p.mirror[k]);
    diffuse[k].push_back(p.diffuse[k]);
    specular[k].push_back(p.specular[k]);
    grazing[k].push_back(p.grazing[k]);
    smooth[k].push_back(p.smooth[k]);
  }
  shape.push_back(p.shape), ior.push_back(p.ior);
  falloff.push_back(p.falloff), retro.push_back(p.retro), dim.push_back(p.dim);
  slope.push_back(p.slope), again.push_back(p.again);
  lobe.push_back(p.lobe), pixel.push_back(p.pixel), not_lit_by.push_back(p.not_lit_by);
  lobes_ = std::max(lobes_, p.lobes());
  bent_ |= p.bent();
  grooved_ |= p.grooved();
  ++size_;
}

void ShadePoints::finish() {
  if (size_ == 0) return;
  const size_t padded = round_up_to_lanes(size_);
  for_each_array(*this, [&](auto& a) { a.resize(padded, a[size_ - 1]); });
}

SurfacePoint ShadePoints::get(size_t i) const {
  const auto at = [i](const std::vector<float>(&a)[3]) { return Vec3f{a[0][i], a[1][i], a[2][i]}; };
  return {at(position), at(normal), at(mirror), at(diffuse), at(specular), at(grazing),
          shape[i],     ior[i],     lobe[i],    falloff[i],  retro[i],     dim[i],
          slope[i],     again[i],   pixel[i],   at(smooth),  not_lit_by[i]};
}

}  // namespace lumicut
