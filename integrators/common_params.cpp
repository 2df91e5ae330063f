#include "integrators/common_params.h"

#include "integrators/integrator.h"

namespace lumicut {

namespace {

template <auto Member>
ParamOf<Member> of_virtual_lights(ParamOf<Member> param) {
  param.of_virtual_lights = true;
  return param;
}

}  // namespace

ParamTable common_params() {
  using P = CommonParams;
  return describe(
      of_virtual_lights(number<&P::vpls>(
          "vpls", "Virtual lights", "How many virtual point lights stand for the scene's light", "lights", 1, 1e8)),
      number<&P::seed>("seed", "Seed", "Same seed, same image", "", 0, 4294967295.0),
      number<&P::max_depth>("max_depth", "Bounces", "Surfaces that a light path may meet; 0: direct light alone", "", 0,
                            1024),
      of_virtual_lights(number<&P::direct_share>(
          "direct_share", "Direct share",
          "Share of the virtual lights that is spent on the direct light of emitters with extent", "", 0.01, 1)),
      of_virtual_lights(number<&P::environment_vpls>(
          "environment_vpls", "Environment lights",
          "How many of the virtual lights stand for the environment; 0: its share of the power among those for direct "
          "light",
          "lights", 0, 1e8)),
      of_virtual_lights(number<&P::clamp_lights>(
          "clamp_lights", "Clamp",
          "No virtual light is taken to be nearer than the distance within which about so many of ten thousand lie (of "
          "others, as the 2/3 power of their number): more, and corners lose light; fewer, and bright dots show. 0: no "
          "clamp",
          "lights", 0, 1e6)),
      of_virtual_lights(number<&P::clamp_relative>(
          "clamp_relative", "Clamp (relative)",
          "No virtual light is taken to be nearer than this share of the scene's radius, wherever it is; 0: as many "
          "lights as above. For comparisons with other programs",
          "of the scene's radius", 0, 1)),
      of_virtual_lights(number<&P::clamp_distance>(
          "clamp_distance", "Clamp distance",
          "No virtual light is taken to be nearer than this, wherever it is; 0: as above. For comparisons with other "
          "programs",
          "scene units", 0, 1e30)),
      of_virtual_lights(choice<&P::virtual_lights>(
          "virtual_lights", "Virtual lights are",
          "points, which leave bright dots on glossy surfaces and in corners; or spheres as wide as they lie apart: no "
          "dots and nothing clamped, at the price of a slight blur and slower shading",
          "", "points|spheres")),
      of_virtual_lights(number<&P::sphere_scale>("sphere_scale", "Sphere size", "Radius of the spheres",
                                                 "of the distance to the tenth nearest", 0.001, 10)),
      of_virtual_lights(flag<&P::compensate>(
          "compensate", "Compensate",
          "Rays bring back the light that the clamp takes away, and what glossy surfaces throw on others: no energy is "
          "lost, at the price of noise that passes average out")),
      of_virtual_lights(flag<&P::trace_gloss>(
          "trace_gloss", "Trace gloss",
          "With Compensate: what surfaces of little roughness (below .35) mirror of bounced light and of the sky is "
          "found "
          "by rays instead of virtual lights: fine noise, which denoising takes away, in place of blots on worktops, "
          "water and metal")),
      of_virtual_lights(flag<&P::importance>(
          "importance", "Importance",
          "Virtual lights are put where the camera sees their light, and few elsewhere: for buildings of many rooms, "
          "streets, many lamps. The mean over seeds stays the same. In renders alone: what is prepared for points "
          "anywhere has lights everywhere")));
}

float clamp_distance(const CommonParams& params, const Scene& scene) {
  const double absolute = params.clamp_distance;
  return static_cast<float>(absolute > 0.0 ? absolute : params.clamp_relative * scene.radius());
}

float sphere_scale(const CommonParams& params) {
  return params.virtual_lights == VirtualLights::spheres ? params.sphere_scale : 0.0f;
}

VplOptions vpl_options(const CommonParams& params) {
  VplOptions o;
  o.count = params.vpls;
  o.direct_share = params.direct_share;
  o.environment_count = params.environment_vpls;
  o.max_depth = params.max_depth;
  o.seed = params.seed;
  o.sphere_scale = sphere_scale(params);
  return o;
}

}  // namespace lumicut
