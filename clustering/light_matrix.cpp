#include "clustering/light_matrix.h"

#include <numeric>

#include "clustering/light_kernel.h"
#include "core/parallel.h"

namespace lumicut {

namespace {

constexpr size_t kTile = 256;  // lights of one task

// Spreads 10 bits to every third place.
uint32_t spread3(uint32_t x) {
  x = (x | x << 16) & 0x030000ffu;
  x = (x | x << 8) & 0x0300f00fu;
  x = (x | x << 4) & 0x030c30c3u;
  return (x | x << 2) & 0x09249249u;
}

uint32_t morton(const Vec3f& p, const Aabb& box) {
  const Vec3f e = box.extent();
  const auto cell = [](float v, float extent) {
    return extent > 0.0f ? static_cast<uint32_t>(std::min(1023.0f, std::max(0.0f, v / extent * 1024.0f))) : 0u;
  };
  const Vec3f v = p - box.lo;
  return spread3(cell(v.x, e.x)) | spread3(cell(v.y, e.y)) << 1 | spread3(cell(v.z, e.z)) << 2;
}

// One task: kTile lights against all rows.
struct Tile {
  LitPoints lit;
  std::vector<float> values;  // [row][light of the tile]
  alignas(64) float x[kTile], y[kTile], z[kTile];
  uint32_t index[kTile];
  uint8_t occluded[kTile];
  std::vector<uint32_t> masks;  // of the rays to its lights

  uint64_t fill(const Scene& scene, const Vpl* lights, size_t count, const ShadePoints& rows, Falloff falloff,
                float shadowed_share, const Progress& progress) {
    uint64_t rays = 0;
    values.assign(rows.size() * kTile, 0.0f);
    masks.clear();
    for (size_t l = 0; l < count; ++l)
      if (std::find(masks.begin(), masks.end(), lights[l].ray_mask) == masks.end()) masks.push_back(lights[l].ray_mask);
    for (size_t l = 0; l < count; ++l) {
      if (l % 16 == 0 && progress.cancelled()) return rays;
      for (size_t first = 0; first < rows.size(); first += kMaxLit) {
        light_points(lights[l], lights[l].intensity, falloff, rows, first, std::min(kMaxLit, rows.size() - first), lit);
        if (lights[l].kind == VplKind::directional) {
          trace_lit(scene.accel(), lights[l], lit);
          rays += lit.count;
        } else {
          std::fill(lit.occluded, lit.occluded + lit.count, uint8_t{0});
        }
        for (size_t i = 0; i < lit.count; ++i)
          values[(first + lit.index[i]) * kTile + l] =
              luminance({lit.r[i], lit.g[i], lit.b[i]}) * (lit.occluded[i] ? shadowed_share : 1.0f);
      }
    }
    for (size_t r = 0; r < rows.size(); ++r) {
      if (r % 16 == 0 && progress.cancelled()) return rays;
      float* row = values.data() + r * kTile;
      for (const uint32_t mask : masks) {
        size_t n = 0;
        for (size_t l = 0; l < count; ++l) {
          const Vpl& v = lights[l];
          if (row[l] == 0.0f || v.kind == VplKind::directional || v.ray_mask != mask) continue;
          const Vec3f place = shadow_origin(v, rows.position_at(r)).light;
          x[n] = place.x, y[n] = place.y, z[n] = place.z;
          index[n++] = static_cast<uint32_t>(l);
        }
        if (n == 0) continue;
        scene.accel().occluded_from_point({rows.position_at(r), false, mask, true}, x, y, z, n, occluded);
        for (size_t i = 0; i < n; ++i)
          if (occluded[i]) row[index[i]] *= shadowed_share;
        rays += n;
      }
    }
    return rays;
  }
};

}  // namespace

std::vector<Vpl> order_lights(const std::vector<Vpl>& lights, const Progress* progress) {
  Aabb box;
  for (const Vpl& v : lights)
    if (v.kind != VplKind::directional) box.extend(v.position);
  struct Key {
    uint32_t kind, code, index;
  };
  std::vector<Key> keys;
  const Aabb directions{{-1, -1, -1}, {1, 1, 1}};
  for (uint32_t i = 0; i < lights.size(); ++i) {
    check_now_and_then(progress, i);
    const Vpl& v = lights[i];
    if (!(max_component(v.intensity) > 0.0f)) continue;
    const uint32_t code = v.kind == VplKind::directional ? morton(v.normal, directions) : morton(v.position, box);
    keys.push_back({static_cast<uint32_t>(v.kind), code, i});
  }
  std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
    return std::tie(a.kind, a.code, a.index) < std::tie(b.kind, b.code, b.index);
  });
  std::vector<Vpl> ordered;
  ordered.reserve(keys.size());
  check_now_and_then(progress, 0);
  for (const Key& k : keys) ordered.push_back(lights[k.index]);
  return ordered;
}

LightMatrix LightMatrix::build(const Scene& scene, const std::vector<Vpl>& lights, const ShadePoints& rows,
                               Falloff falloff, float shadowed_share, const Progress& progress) {
  LightMatrix m;
  m.rows_ = rows.size();
  m.stride_ = round_up_to_lanes(rows.size());
  m.values_.resize(lights.size() * m.stride_);
  m.row_sums_.assign(m.stride_, 0.0);
  const size_t tiles = (lights.size() + kTile - 1) / kTile;
  std::vector<uint64_t> rays(tiles);
  std::vector<double> sums(tiles * m.rows_);
  parallel_chunks(lights.size(), kTile, [&](size_t begin, size_t end) {
    if (progress.cancelled()) return;
    const auto tile = std::make_unique<Tile>();
    const size_t at = begin / kTile;
    rays[at] = tile->fill(scene, lights.data() + begin, end - begin, rows, falloff, shadowed_share, progress);
    for (size_t l = begin; l < end; ++l) {
      uint16_t* column = m.values_.data() + l * m.stride_;
      for (size_t r = 0; r < m.rows_; ++r) {
        column[r] = to_bfloat(tile->values[r * kTile + l - begin]);
        sums[at * m.rows_ + r] += from_bfloat(column[r]);
      }
    }
  });
  progress.check();
  m.rays_ = std::accumulate(rays.begin(), rays.end(), uint64_t{0});
  for (size_t t = 0; t < tiles; ++t)
    for (size_t r = 0; r < m.rows_; ++r) m.row_sums_[r] += sums[t * m.rows_ + r];
  return m;
}

}  // namespace lumicut
