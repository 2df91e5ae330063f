#include "clustering/bounds.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clustering/bounds.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "clustering/bounds-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void LightNodeBounds(const LightNode& node, const PointBlock& block, float* bounds) { NodeBounds(node, block, bounds); }

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(LightNodeBounds);

void light_node_bounds(const LightNode& node, const PointBlock& block, float* bounds) {
  HWY_DYNAMIC_DISPATCH(LightNodeBounds)(node, block, bounds);
}

void PointBlock::load(const ShadePoints& points, size_t first) {
  lobes = Lobes::none;
  any_bent = points.bent(), any_grooved = points.grooved();
  for (size_t i = 0; i < kLanes; ++i) {
    const SurfacePoint p = points.get(first + i);
    const Frame n(p.normal), m(p.mirror);
    for (int k = 0; k < 3; ++k) {
      position[k][i] = p.position[k];
      normal[k][i] = p.normal[k], tangent[k][i] = n.t[k], bitangent[k][i] = n.b[k];
      mirror[k][i] = p.mirror[k], mirror_tangent[k][i] = m.t[k], mirror_bitangent[k][i] = m.b[k];
      diffuse[k][i] = p.diffuse[k], specular[k][i] = p.specular[k], grazing[k][i] = p.grazing[k];
    }
    if (any_bent)
      for (int k = 0; k < 3; ++k) smooth[k][i] = p.smooth[k];
    shape[i] = p.shape, ior[i] = p.ior, lobe[i] = p.lobe;
    falloff[i] = p.falloff, retro[i] = p.retro, dim[i] = p.dim;
    slope[i] = p.slope, again[i] = p.again;
    lobes = std::max(lobes, p.lobes());
  }
}

}  // namespace lumicut
#endif
