#include "film/atrous.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "film/atrous.cpp"
#include "hwy/foreach_target.h"  // compiles this file once a target; before highway.h
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace lumicut::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;

// Relative tolerances of the inverse depth: of itself, and of how much it changes on the way.
constexpr float kOfDepth = 0.02f, kOfSlope = 0.2f;
constexpr float kOfEight = 0.125f;  // distances end at 8

// Neighbouring pixels, and their weights of others. What does not depend on the neighbour is computed once.
struct Pixels {
  V feature[Guide::kFeatures], inverse_depth, along_x, along_y, per_depth, per_loosened;

  HWY_INLINE Pixels(D d, const PaddedPlanes& guide, size_t x, size_t y, float step) {
    for (size_t k = 0; k < Guide::kFeatures; ++k) feature[k] = hn::LoadU(d, guide.row(k, y) + x);
    inverse_depth = hn::LoadU(d, guide.row(Guide::kInverseDepth, y) + x);
    along_x = hn::LoadU(d, guide.row(Guide::kAlongX, y) + x), along_y = hn::LoadU(d, guide.row(Guide::kAlongY, y) + x);
    const V slope = hn::Mul(hn::Set(d, kOfSlope * step), hn::Add(hn::Abs(along_x), hn::Abs(along_y)));
    const V tolerance = hn::MulAdd(hn::Set(d, kOfDepth), inverse_depth, hn::Add(slope, hn::Set(d, 1e-20f)));
    per_depth = hn::Div(hn::Set(d, 0.70710678f), tolerance);
    per_loosened = hn::Div(hn::Set(d, kOfEight), hn::LoadU(d, guide.row(Guide::kLoosened, y) + x));
  }

  // About exp(−distance): (1 − distance/8)⁸, which ends at 8. `kEither`: the looser of both pixels decides.
  template <bool kEither = false>
  HWY_INLINE V Weight(D d, const PaddedPlanes& guide, ptrdiff_t x, size_t y, float dx, float dy) const {
    const V plane = hn::MulAdd(along_x, hn::Set(d, dx), hn::MulAdd(along_y, hn::Set(d, dy), inverse_depth));
    const V depth = hn::Mul(hn::Sub(plane, hn::LoadU(d, guide.row(Guide::kInverseDepth, y) + x)), per_depth);
    V unlike = hn::Mul(depth, depth);
    for (size_t k = 0; k < Guide::kFeatures; ++k) {
      const V away = hn::Sub(feature[k], hn::LoadU(d, guide.row(k, y) + x));
      unlike = hn::MulAdd(away, away, unlike);
    }
    V per = per_loosened;
    if constexpr (kEither)
      per = hn::Min(per, hn::Div(hn::Set(d, kOfEight), hn::LoadU(d, guide.row(Guide::kLoosened, y) + x)));
    V w = hn::Max(hn::Zero(d), hn::NegMulAdd(unlike, per, hn::Set(d, 1.0f)));
    w = hn::Mul(w, w), w = hn::Mul(w, w);
    return hn::Mul(w, w);
  }
};

template <size_t kPlanes, bool kEither>
HWY_INLINE void FilterRows(const PaddedPlanes& guide, const PaddedPlanes& in, size_t step, size_t begin, size_t end,
                           PaddedPlanes& out) {
  const D d;
  const auto s = static_cast<ptrdiff_t>(step);
  for (size_t y = begin; y < end; ++y)
    for (size_t x = 0; x < in.width(); x += hn::Lanes(d)) {
      const Pixels pixels(d, guide, x, y, static_cast<float>(step));
      V sum[kPlanes], weights = hn::Set(d, 4.0f);
      for (size_t k = 0; k < kPlanes; ++k) sum[k] = hn::Mul(weights, hn::LoadU(d, in.row(k, y) + x));
      for (ptrdiff_t i = -1; i <= 1; ++i) {
        const ptrdiff_t v = static_cast<ptrdiff_t>(y) + i * s;
        if (v < 0 || v >= static_cast<ptrdiff_t>(in.height())) continue;
        for (ptrdiff_t j = -1; j <= 1; ++j) {
          if (i == 0 && j == 0) continue;
          const float binomial = i != 0 && j != 0 ? 1.0f : 2.0f;
          const auto row = static_cast<size_t>(v);
          const ptrdiff_t column = static_cast<ptrdiff_t>(x) + j * s;  // below 0 in the margin
          const V w = hn::Mul(
              hn::Set(d, binomial),
              pixels.Weight<kEither>(d, guide, column, row, static_cast<float>(j * s), static_cast<float>(i * s)));
          weights = hn::Add(weights, w);
          for (size_t k = 0; k < kPlanes; ++k) sum[k] = hn::MulAdd(w, hn::LoadU(d, in.row(k, row) + column), sum[k]);
        }
      }
      const V scale = hn::Div(hn::Set(d, 1.0f), weights);
      for (size_t k = 0; k < kPlanes; ++k) hn::StoreU(hn::Mul(sum[k], scale), d, out.row(k, y) + x);
    }
}

void AtrousRows(const PaddedPlanes& guide, const PaddedPlanes& in, size_t step, size_t begin, size_t end,
                PaddedPlanes& out) {
  FilterRows<kFiltered, false>(guide, in, step, begin, end, out);
}
void AtrousFirstRows(const PaddedPlanes& guide, const PaddedPlanes& in, size_t step, size_t begin, size_t end,
                     PaddedPlanes& out) {
  FilterRows<kFirstFiltered, true>(guide, in, step, begin, end, out);
}

void SupportRows(const PaddedPlanes& guide, size_t begin, size_t end, PaddedPlanes& out) {
  const D d;
  for (size_t y = begin; y < end; ++y)
    for (size_t x = 0; x < guide.width(); x += hn::Lanes(d)) {
      const Pixels pixels(d, guide, x, y, 1.0f);
      V weights = hn::Zero(d);
      for (ptrdiff_t i = -1; i <= 1; ++i) {
        const ptrdiff_t v = static_cast<ptrdiff_t>(y) + i;
        if (v < 0 || v >= static_cast<ptrdiff_t>(guide.height())) continue;
        for (ptrdiff_t j = -1; j <= 1; ++j)
          if (i != 0 || j != 0)
            weights = hn::Add(weights, pixels.Weight(d, guide, static_cast<ptrdiff_t>(x) + j, static_cast<size_t>(v),
                                                     static_cast<float>(j), static_cast<float>(i)));
      }
      hn::StoreU(hn::Mul(weights, hn::Set(d, 0.125f)), d, out.row(0, y) + x);
    }
}

}  // namespace lumicut::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(AtrousRows);
HWY_EXPORT(AtrousFirstRows);
HWY_EXPORT(SupportRows);

void atrous_rows(const PaddedPlanes& guide, const PaddedPlanes& in, size_t step, size_t begin, size_t end,
                 PaddedPlanes& out) {
  HWY_DYNAMIC_DISPATCH(AtrousRows)(guide, in, step, begin, end, out);
}
void atrous_first_rows(const PaddedPlanes& guide, const PaddedPlanes& in, size_t step, size_t begin, size_t end,
                       PaddedPlanes& out) {
  HWY_DYNAMIC_DISPATCH(AtrousFirstRows)(guide, in, step, begin, end, out);
}
void support_rows(const PaddedPlanes& guide, size_t begin, size_t end, PaddedPlanes& out) {
  HWY_DYNAMIC_DISPATCH(SupportRows)(guide, begin, end, out);
}

}  // namespace lumicut
#endif
