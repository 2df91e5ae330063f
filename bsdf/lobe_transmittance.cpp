#include "bsdf/lobe_transmittance.h"

#include <array>
#include <mutex>

#include "bsdf/facet_integral.h"

namespace lumicut {

namespace {

constexpr int kRoughness = 14, kRatios = 18, kCosines = 17;  // steps in √α, in F0's fourth root and in √cosine
constexpr float kLargestRoot = 0.85f;                        // of F0: an index of 12.3

// Directional albedo of a lobe, and its nearest straight + rise·(1 − c)⁴, of the same mean over even light.
struct Albedo {
  std::array<float, kCosines> at{};
  float straight = 0.0f, rise = 0.0f;

  // Of a lobe whose facets reflect `share(v·h)`.
  template <typename Share>
  static Albedo of(float alpha, const Share& share) {
    Albedo a;
    for (int i = 0; i < kCosines; ++i)
      a.at[i] = mean_over_facets<12>(alpha, cosine(i), [&](const Vec3f& view, const Vec3f& h) {
        return share(std::min(1.0f, std::max(0.0f, dot(view, h)))) * unmasked_reflection(alpha, view, h);
      });
    float mean = 0.0f, mean_edge = 0.0f, mixed = 0.0f, square = 0.0f;
    for (int i = 0; i < kCosines; ++i) {
      const float c = cosine(i), edge = 1.0f - diffuse_falloff(1.0f, c);
      // Of the cosine's projected solid angle, c dc, in steps of its root.
      const float weight = c * std::sqrt(c) * (i + 1 == kCosines ? 0.5f : 1.0f) * (4.0f / (kCosines - 1));
      mean += weight * a.at[i], mean_edge += weight * edge, mixed += weight * a.at[i] * edge;
      square += weight * edge * edge;
    }
    a.rise = (mixed - mean * mean_edge) / (square - mean_edge * mean_edge);
    a.straight = mean - a.rise * mean_edge;
    return a;
  }
  static float cosine(int i) {
    const float root = static_cast<float>(i) / (kCosines - 1);
    return std::max(1e-3f, root * root);
  }
};

// What is looked up of an Albedo, linear in it.
struct Seen {
  float albedo, straight, rise;
};
Seen between(const Seen& a, const Seen& b, float f) {
  return {a.albedo + (b.albedo - a.albedo) * f, a.straight + (b.straight - a.straight) * f,
          a.rise + (b.rise - a.rise) * f};
}

class RoughnessRow {
 public:
  template <typename Share>
  void fill(const Share& share) {
    for (int r = 0; r < kRoughness; ++r) {
      const float root = static_cast<float>(r) / (kRoughness - 1);
      of_[r] = Albedo::of(root * root, share);
    }
  }
  Seen seen(const TablePlace& r, const TablePlace& c) const {
    const auto one = [&](const Albedo& a) {
      return Seen{a.at[c.cell] + (a.at[c.cell + 1] - a.at[c.cell]) * c.rest, a.straight, a.rise};
    };
    return between(one(of_[r.cell]), one(of_[r.cell + 1]), r.rest);
  }

 private:
  std::array<Albedo, kRoughness> of_;
};

// Lobes that reflect Fresnel's share for indices above 1, or below. Rows are filled when they are asked for, as a scene has
// few indices.
class ShareTable {
 public:
  explicit ShareTable(bool thinner) : thinner_(thinner) {}
  Seen seen(const TablePlace& k, const TablePlace& r, const TablePlace& c) {
    return between(row(k.cell).seen(r, c), row(k.cell + 1).seen(r, c), k.rest);
  }

 private:
  const RoughnessRow& row(int k) {
    std::call_once(filled_[k], [&] {
      const float step = static_cast<float>(k) / (kRatios - 1), root = kLargestRoot * step * step;
      const float ior = thinner_ ? (1.0f - root) / (1.0f + root) : (1.0f + root) / (1.0f - root);
      rows_[k].fill([ior](float cosine) { return fresnel_share(cosine, ior); });
    });
    return rows_[k];
  }

  bool thinner_;
  std::array<std::once_flag, kRatios> filled_;
  std::array<RoughnessRow, kRatios> rows_;
};

ShareTable& shares_of(float ior) {
  if (ior < 1.0f) {
    static ShareTable thinner(true);
    return thinner;
  }
  static ShareTable denser(false);
  return denser;
}

const RoughnessRow& mirrors() {
  static const RoughnessRow row = [] {
    RoughnessRow all;
    all.fill([](float) { return 1.0f; });
    return all;
  }();
  return row;
}

}  // namespace

LobeTransmittance lobe_transmittance(float f0, float f90, float ior, float alpha, float cosine) {
  const TablePlace r = table_place(std::sqrt(std::max(0.0f, alpha)), kRoughness),
                   c = table_place(std::sqrt(std::max(0.0f, cosine)), kCosines),
                   k = table_place(std::sqrt(std::abs(ior - 1.0f) / (ior + 1.0f) / kLargestRoot), kRatios);
  const float rest = f90 - f0;
  Seen all = mirrors().seen(r, c), share{};
  if (rest != 0.0f) share = shares_of(ior).seen(k, r, c);
  // A mirror's are known: the table would blur the step where total reflection begins.
  if (alpha < kLeastAlpha) all.albedo = 1.0f, share.albedo = fresnel_share(cosine, ior);
  const float normal = 1.0f - f0 * all.straight - rest * share.straight;
  const float falloff = normal > 0.0f ? (f0 * all.rise + rest * share.rise) / normal : 0.0f;
  return {std::max(0.0f, 1.0f - f0 * all.albedo - rest * share.albedo), std::min(1.0f, std::max(0.0f, falloff))};
}

}  // namespace lumicut
