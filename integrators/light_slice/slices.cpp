#include "integrators/light_slice/slices.h"

#include <algorithm>
#include <numeric>
#include <queue>

#include "bsdf/point_bsdf.h"

namespace lumicut {

namespace {

// A turn of a normal by one radian counts as this share of the scene's radius.
constexpr float kNormalScale = 0.3f, kMirrorScale = 0.2f;

struct Group {
  uint32_t begin, end;
  PointFeature mean;
  double spread = 0;  // sum of squared distances from the mean
  int axis = 0;       // of largest variance
  int child = -1;     // first of two
};

Group measure(const std::vector<PointFeature>& features, const std::vector<uint32_t>& order, uint32_t begin,
              uint32_t end) {
  double sum[9] = {}, sum2[9] = {};
  for (uint32_t i = begin; i < end; ++i)
    for (int k = 0; k < 9; ++k) {
      const double v = features[order[i]].v[k];
      sum[k] += v, sum2[k] += v * v;
    }
  Group g{begin, end, {}, 0, 0, -1};
  const double n = end - begin;
  double largest = -1;
  for (int k = 0; k < 9; ++k) {
    g.mean.v[k] = static_cast<float>(sum[k] / n);
    const double spread = std::max(0.0, sum2[k] - sum[k] * sum[k] / n);
    g.spread += spread;
    if (spread > largest) largest = spread, g.axis = k;
  }
  return g;
}

}  // namespace

PointFeature point_feature(const ShadePoints& points, size_t i, float length) {
  const SurfacePoint p = points.get(i);
  const Vec3f at = p.position / length, n = p.normal * kNormalScale;
  // How much of the light comes by the mirror: a share of the reflected light, for sharp lobes.
  const float gloss = p.lobe != kCosineLobe ? luminance(specular_albedo(p))
                      : p.shape > 0.0f      ? luminance(p.specular) * 6.2831853f / (p.shape + 2.0f)
                                            : 0.0f;
  const float diffuse = luminance(p.diffuse) * 3.1415927f;
  const float share = gloss > 0.0f ? gloss / (gloss + diffuse) : 0.0f;
  const Vec3f m = p.mirror * (kMirrorScale * share);
  return {{at.x, at.y, at.z, n.x, n.y, n.z, m.x, m.y, m.z}};
}

Slices build_slices(const ShadePoints& points, size_t count, size_t least, float length, const Progress* progress) {
  Slices slices;
  const auto n = static_cast<uint32_t>(points.size());
  if (n == 0) return slices;
  std::vector<PointFeature> features(n);
  for (uint32_t i = 0; i < n; ++i) features[i] = point_feature(points, i, length);
  slices.order.resize(n);
  std::iota(slices.order.begin(), slices.order.end(), 0u);
  std::vector<Group> groups{measure(features, slices.order, 0, n)};
  const auto tighter = [&](int a, int b) {
    return groups[a].spread < groups[b].spread || (groups[a].spread == groups[b].spread && a > b);
  };
  std::priority_queue<int, std::vector<int>, decltype(tighter)> queue(tighter);
  queue.push(0);
  size_t leaves = 1;
  while (leaves < count && !queue.empty()) {
    const int index = queue.top();
    queue.pop();
    const Group g = groups[index];
    if (progress != nullptr) progress->check();
    if (g.end - g.begin < 2 * least) continue;
    const auto first = slices.order.begin() + g.begin, last = slices.order.begin() + g.end;
    const float cut = g.mean.v[g.axis];
    auto mid = std::stable_partition(first, last, [&](uint32_t i) { return features[i].v[g.axis] < cut; });
    if (mid - first < static_cast<std::ptrdiff_t>(least) || last - mid < static_cast<std::ptrdiff_t>(least)) {
      // A few points far away: halve by count instead.
      mid = first + (last - first) / 2;
      std::nth_element(first, mid, last, [&](uint32_t a, uint32_t b) {
        return features[a].v[g.axis] < features[b].v[g.axis] ||
               (features[a].v[g.axis] == features[b].v[g.axis] && a < b);
      });
      std::sort(first, mid), std::sort(mid, last);
    }
    const auto at = static_cast<uint32_t>(mid - slices.order.begin());
    groups[index].child = static_cast<int>(groups.size());
    groups.push_back(measure(features, slices.order, g.begin, at));
    groups.push_back(measure(features, slices.order, at, g.end));
    queue.push(groups[index].child);
    queue.push(groups[index].child + 1);
    ++leaves;
  }
  std::vector<int> stack{0};
  while (!stack.empty()) {
    const Group& g = groups[stack.back()];
    stack.pop_back();
    if (g.child >= 0) {
      stack.push_back(g.child + 1);
      stack.push_back(g.child);
      continue;
    }
    slices.begins.push_back(g.begin);
    uint32_t nearest = slices.order[g.begin];
    for (uint32_t i = g.begin; i < g.end; ++i)
      if (distance2(features[slices.order[i]], g.mean) < distance2(features[nearest], g.mean))
        nearest = slices.order[i];
    slices.representatives.push_back(nearest);
  }
  slices.begins.push_back(n);
  return slices;
}

}  // namespace lumicut
