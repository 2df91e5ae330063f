// The SIMD form of each lobe against its scalar form, on random input.
#include <gtest/gtest.h>

#include "bsdf/point_bsdf.h"
#include "core/rng.h"
#include "tests/support/test_scenes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/bsdf/test_lanes.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "bsdf/reflectance-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void ReflectanceOf(const ShadePoints& points, size_t p, const Vec3f& to_light, float* rgb) {
  const D d;
  const V3 normal = Load3(d, points.normal, p), light = Set3(d, to_light);
  const Lobes lobes = points.lobes();
  const V3 f = lobes == Lobes::all      ? Reflectance<Lobes::all>(d, points, p, normal, light)
               : lobes == Lobes::cosine ? Reflectance<Lobes::cosine>(d, points, p, normal, light)
                                        : Reflectance<Lobes::none>(d, points, p, normal, light);
  rgb[0] = hn::GetLane(f.x), rgb[1] = hn::GetLane(f.y), rgb[2] = hn::GetLane(f.z);
}

void FresnelShareOf(float cosine, float low, float ratio, float high, float* out) {
  const D d;
  out[0] = hn::GetLane(FresnelShare(d, hn::Set(d, cosine), hn::Set(d, ratio)));
  out[1] = hn::GetLane(BoundOfFresnelShare(d, hn::Set(d, cosine), hn::Set(d, low), hn::Set(d, high)));
}

void DiffuseFalloffOf(float falloff, float cosine, float* out) {
  const D d;
  out[0] = hn::GetLane(DiffuseFalloff(d, hn::Set(d, falloff), hn::Set(d, cosine)));
  out[1] = hn::GetLane(BoundOfDiffuseFalloff(d, hn::Set(d, falloff), hn::Set(d, cosine)));
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(ReflectanceOf);
HWY_EXPORT(DiffuseFalloffOf);
HWY_EXPORT(FresnelShareOf);

namespace {

SurfacePoint random_point(Rng& rng, int kind) {
  const auto color = [&] { return Rgb{rng.next_float(), rng.next_float(), rng.next_float()}; };
  SurfacePoint p;
  p.normal = test::random_direction(rng);
  Vec3f view = test::random_direction(rng);
  if (dot(view, p.normal) < 0.0f) view = -view;
  p.mirror = reflect(view, p.normal);
  p.diffuse = color();
  if (kind == 0) return p;
  p.specular = color();
  if (kind == 1) {
    p.shape = std::pow(1000.0f, rng.next_float());
  } else {
    p.lobe = kLobe<GgxReflection>, p.shape = std::pow(kLeastAlpha, rng.next_float());
    p.grazing = color(), p.falloff = rng.next_float(), p.ior = 0.5f + 4.0f * rng.next_float();
    if (rng.next_below(2) == 0) p.retro = 2.0f * rng.next_float(), p.dim = 0.5f;
    if (rng.next_below(2) == 0) p.slope = rng.next_float(), p.again = rng.next_float();
  }
  return p;
}

// Sharp lobes magnify rounding: GGX divides by α²·(n·v + n·l)² + side², where α² is 1e-4 at the least and side² comes from a
// difference of squares with an error of 1e-7: up to 1e-3 of the value. An exponent of 1000 makes 1e-4 of a last bit.
TEST(Lanes, EachLobeIsItsScalarForm) {
  Rng rng(21, Stage::test);
  for (int kind = 0; kind < 3; ++kind)
    for (int i = 0; i < 20000; ++i) {
      const SurfacePoint p = random_point(rng, kind);
      ShadePoints points;
      points.push(p);
      points.finish();
      Vec3f to_light = test::random_direction(rng);
      if (i % 2 == 0) to_light = normalize(p.mirror + to_light * 0.05f);  // within the lobe
      if (dot(to_light, p.normal) < 1e-3f) continue;
      float rgb[3];
      HWY_DYNAMIC_DISPATCH(ReflectanceOf)(points, 0, to_light, rgb);
      const Rgb expected = reflectance(p, to_light);
      for (int k = 0; k < 3; ++k)
        ASSERT_NEAR(rgb[k], expected[k], (kind == 2 ? 1e-3f : 1e-4f) * (1.0f + expected[k])) << kind << " " << i;
    }
}

// From the two amplitudes, in double precision. [Fresnel; Snell]
double fresnel(double cosine, double ratio) {
  const double sine2 = (1 - cosine * cosine) / (ratio * ratio);
  if (sine2 >= 1) return 1;
  const double beyond = std::sqrt(1 - sine2);
  const double s = (cosine - ratio * beyond) / (cosine + ratio * beyond),
               p = (ratio * cosine - beyond) / (ratio * cosine + beyond);
  return 0.5 * (s * s + p * p);
}

TEST(Lanes, FresnelsShareIsTheExactReflectanceAndBoundedOverIndicesAndCosines) {
  Rng rng(23, Stage::test);
  for (int i = 0; i < 200000; ++i) {
    const float ratio = i % 10 == 0 ? 0.4f + 0.55f * rng.next_float() : 1.01f + 9.0f * std::pow(rng.next_float(), 3.0f);
    const float low = std::max(i % 10 == 0 ? 0.3f : 1.01f, ratio - rng.next_float()), high = ratio + rng.next_float();
    const float cosine = 1e-3f + 0.999f * rng.next_float(), least = cosine * rng.next_float();
    const double f0 = fresnel(1, ratio), exact = std::max(0.0, (fresnel(cosine, ratio) - f0) / (1 - f0));
    // g cancels where total reflection begins: the root of 1e-7 is what is left of it.
    const double error = ratio < 1 ? 4e-3 : 2e-5;
    ASSERT_NEAR(fresnel_share(cosine, ratio), exact, error) << cosine << " " << ratio;
    float out[2];
    HWY_DYNAMIC_DISPATCH(FresnelShareOf)(cosine, ratio, ratio, ratio, out);
    ASSERT_NEAR(out[0], exact, error) << cosine << " " << ratio;
    ASSERT_GE(out[1], exact - 1e-6);
    ASSERT_LE(out[1], ratio < 1 ? 1 : exact + 3e-4);
    HWY_DYNAMIC_DISPATCH(FresnelShareOf)(least, low, ratio, high, out);
    ASSERT_GE(out[1], exact - 1e-6) << cosine << " over " << least << ", " << ratio << " in " << low << " " << high;
  }
}

TEST(Lanes, FalloffIsItsScalarFormAndItsOwnBound) {
  Rng rng(22, Stage::test);
  for (int i = 0; i < 1000; ++i) {
    const float falloff = rng.next_float(), cosine = rng.next_float();
    float out[2];
    HWY_DYNAMIC_DISPATCH(DiffuseFalloffOf)(falloff, cosine, out);
    EXPECT_NEAR(out[0], diffuse_falloff(falloff, cosine), 1e-6f);
    EXPECT_NEAR(out[1], diffuse_falloff(falloff, cosine), 1e-6f) << "it grows with the cosine";
  }
}

}  // namespace
}  // namespace lumicut
#endif
