#include "clustering/column_kernels.h"

#include "bsdf/shade_points.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "clustering/column_kernels.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h

#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kLanes>;
using V = hn::Vec<D>;

HWY_INLINE V LoadBfloat(D d, const uint16_t* p) {
  const hn::RebindToUnsigned<D> du;
  const hn::Rebind<uint16_t, D> d16;
  return hn::BitCast(d, hn::ShiftLeft<16>(hn::PromoteTo(du, hn::LoadU(d16, p))));
}

HWY_INLINE V DotColumn(D d, const uint16_t* column, const float* HWY_RESTRICT v, size_t stride) {
  V sum = hn::Zero(d);
  for (size_t r = 0; r < stride; r += hn::Lanes(d))
    sum = hn::MulAdd(LoadBfloat(d, column + r), hn::LoadU(d, v + r), sum);
  return sum;
}

// out[i] = Σ_r weights2[r] · column[r]², of columns [0, n).
void Norms2(const uint16_t* values, size_t stride, size_t n, const float* HWY_RESTRICT weights2,
            float* HWY_RESTRICT out) {
  const D d;
  for (size_t i = 0; i < n; ++i) {
    V sum = hn::Zero(d);
    for (size_t r = 0; r < stride; r += hn::Lanes(d)) {
      const V x = LoadBfloat(d, values + i * stride + r);
      sum = hn::MulAdd(hn::Mul(x, x), hn::LoadU(d, weights2 + r), sum);
    }
    out[i] = hn::GetLane(hn::SumOfLanes(d, sum));
  }
}

// out[i] = column(items[i]) · v.
void Project(const uint16_t* values, size_t stride, const uint32_t* HWY_RESTRICT items, size_t n,
             const float* HWY_RESTRICT v, float* HWY_RESTRICT out) {
  const D d;
  for (size_t i = 0; i < n; ++i)
    out[i] = hn::GetLane(hn::SumOfLanes(d, DotColumn(d, values + size_t{items[i]} * stride, v, stride)));
}

// sum += Σ_i factors[i] · column(items[i]).
void Accumulate(const uint16_t* values, size_t stride, const uint32_t* HWY_RESTRICT items, size_t n,
                const float* HWY_RESTRICT factors, float* HWY_RESTRICT sum) {
  const D d;
  for (size_t i = 0; i < n; ++i) {
    const V f = hn::Set(d, factors[i]);
    const uint16_t* column = values + size_t{items[i]} * stride;
    for (size_t r = 0; r < stride; r += hn::Lanes(d))
      hn::StoreU(hn::MulAdd(f, LoadBfloat(d, column + r), hn::LoadU(d, sum + r)), d, sum + r);
  }
}

// Index of the direction with the largest dot product, the first of equals. directions: [count][stride].
uint32_t MostSimilar(const uint16_t* column, size_t stride, const float* HWY_RESTRICT directions, size_t count,
                     float* HWY_RESTRICT scratch) {
  const D d;
  for (size_t r = 0; r < stride; r += hn::Lanes(d)) hn::StoreU(LoadBfloat(d, column + r), d, scratch + r);
  uint32_t best = 0;
  float largest = -1.0f;
  for (size_t c = 0; c < count; c += 4) {  // padded by the caller to a multiple of 4
    V s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0;
    const float* v = directions + c * stride;
    for (size_t r = 0; r < stride; r += hn::Lanes(d)) {
      const V x = hn::LoadU(d, scratch + r);
      s0 = hn::MulAdd(x, hn::LoadU(d, v + r), s0);
      s1 = hn::MulAdd(x, hn::LoadU(d, v + stride + r), s1);
      s2 = hn::MulAdd(x, hn::LoadU(d, v + 2 * stride + r), s2);
      s3 = hn::MulAdd(x, hn::LoadU(d, v + 3 * stride + r), s3);
    }
    const float dots[4] = {hn::GetLane(hn::SumOfLanes(d, s0)), hn::GetLane(hn::SumOfLanes(d, s1)),
                           hn::GetLane(hn::SumOfLanes(d, s2)), hn::GetLane(hn::SumOfLanes(d, s3))};
    for (uint32_t k = 0; k < 4; ++k)
      if (dots[k] > largest) largest = dots[k], best = static_cast<uint32_t>(c) + k;
  }
  return best;
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(Norms2);
HWY_EXPORT(Project);
HWY_EXPORT(Accumulate);
HWY_EXPORT(MostSimilar);

void column_norms2(const uint16_t* values, size_t stride, size_t n, const float* weights2, float* out) {
  HWY_DYNAMIC_DISPATCH(Norms2)(values, stride, n, weights2, out);
}

void project_columns(const uint16_t* values, size_t stride, const uint32_t* items, size_t n, const float* v,
                     float* out) {
  HWY_DYNAMIC_DISPATCH(Project)(values, stride, items, n, v, out);
}

void accumulate_columns(const uint16_t* values, size_t stride, const uint32_t* items, size_t n, const float* factors,
                        float* sum) {
  HWY_DYNAMIC_DISPATCH(Accumulate)(values, stride, items, n, factors, sum);
}

uint32_t most_similar_direction(const uint16_t* column, size_t stride, const float* directions, size_t count,
                                float* scratch) {
  return HWY_DYNAMIC_DISPATCH(MostSimilar)(column, stride, directions, count, scratch);
}

}  // namespace lumicut
#endif
