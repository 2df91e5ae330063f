#include "bsdf/facet_albedo.h"

#include <array>

#include "bsdf/facet_integral.h"
#include "bsdf/ggx_transmission.h"

namespace lumicut {

namespace {

constexpr int kRoughness = 14, kCosines = 16;  // steps in √α and √cosine

// One row of cosines for each roughness.
template <typename Entry>
void fill(float* table, const Entry& entry) {
  // Without tasks: the table of mirrors is made where whoever asks first stands, and that may be a task.
  for (int i = 0; i < kRoughness * kCosines; ++i) {
    const auto c = static_cast<float>(i % kCosines) / (kCosines - 1),
               r = static_cast<float>(i / kCosines) / (kRoughness - 1);
    table[i] = entry(r * r, std::max(1e-3f, c * c));
  }
}

float look_up(const float* table, float alpha, float cosine) {
  const TablePlace r = table_place(std::sqrt(std::max(0.0f, alpha)), kRoughness),
                   c = table_place(std::sqrt(std::max(0.0f, cosine)), kCosines);
  const float* row = table + r.cell * kCosines + c.cell;
  const float low = row[0] + (row[1] - row[0]) * c.rest,
              high = row[kCosines] + (row[kCosines + 1] - row[kCosines]) * c.rest;
  return low + (high - low) * r.rest;
}

struct MirrorLoss {
  MirrorLoss() {
    fill(of.data(), [](float alpha, float cosine) {
      return 1.0f - mean_over_facets(alpha, cosine,
                                     [&](const Vec3f& v, const Vec3f& h) { return unmasked_reflection(alpha, v, h); });
    });
    // In c² all directions of even light count alike.
    constexpr int kSteps = 64;
    for (int r = 0; r < kRoughness; ++r) {
      const float root = static_cast<float>(r) / (kRoughness - 1);
      float sum = 0.0f;
      for (int i = 0; i < kSteps; ++i)
        sum += look_up(of.data(), root * root, std::sqrt((static_cast<float>(i) + 0.5f) / kSteps));
      std::fill_n(mean.data() + r * kCosines, kCosines, sum / kSteps);
    }
  }
  std::array<float, kRoughness * kCosines> of{}, mean{};
};

const MirrorLoss& mirror_loss() {
  static const MirrorLoss loss;
  return loss;
}

}  // namespace

float facet_loss(float alpha, float cosine) { return look_up(mirror_loss().of.data(), alpha, cosine); }
float mean_facet_loss(float alpha) { return look_up(mirror_loss().mean.data(), alpha, 1.0f); }

GlassAlbedo::GlassAlbedo(float ior) : ior_(ior), table_(2 * kRoughness * kCosines) {
  for (const bool inside : {false, true}) {
    const float ratio = inside ? 1.0f / ior : ior;
    fill(table_.data() + (inside ? kRoughness * kCosines : 0), [&](float alpha, float cosine_to_viewer) {
      float all = 0.0f, through = 0.0f;
      const float kept = mean_over_facets(alpha, cosine_to_viewer, [&](const Vec3f& view, const Vec3f& h) {
        const float cosine = std::min(1.0f, std::max(0.0f, dot(view, h)));
        float refracted = 0.0f;
        const float border = fresnel_reflectance(cosine, ratio, refracted);
        const float down = view.z / ratio - h.z * (cosine / ratio - refracted);
        const float refracted_on = down > 0.0f ? (1.0f - border) * masking_transmitted(alpha * alpha, down) : 0.0f;
        const float share = border * unmasked_reflection(alpha, view, h) + refracted_on;
        through += refracted_on, all += share;
        return share;
      });
      if (!inside) passed_.push_back(all > 0.0f ? through / all : 0.0f);
      return kept;
    });
  }
}

float GlassAlbedo::at(bool inside, float alpha, float cosine) const {
  return look_up(table_.data() + (inside ? kRoughness * kCosines : 0), alpha, cosine);
}

float GlassAlbedo::passed(float alpha, float cosine) const { return look_up(passed_.data(), alpha, cosine); }

}  // namespace lumicut
