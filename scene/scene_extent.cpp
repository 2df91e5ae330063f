#include "scene/scene_extent.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace lumicut {

namespace {

// The typical radius is that within which the nearest three tenths lie, and a half more: a plain room's whole one.
constexpr float kTypicalQuantile = 0.3f, kTypicalScale = 1.5f;

struct Range {
  size_t begin, end;
  Aabb bounds;
  bool whole = false;  // cannot be split
};

// The value at which the weights of those below reach `share` of all.
float weighted_quantile(std::vector<std::pair<float, float>> values, float share) {
  std::sort(values.begin(), values.end());
  float sum = 0.0f;
  for (const auto& [value, weight] : values)
    if ((sum += weight) >= share) return value;
  return values.back().first;
}

Aabb bounds_of(std::span<const Aabb> boxes) {
  Aabb all;
  for (const Aabb& b : boxes) all.extend(b);
  return all;
}

// Splits in the middle of the longest axis of the boxes' centres. False where they share one centre.
bool split(std::vector<Aabb>& boxes, Range& range, Range& second) {
  Aabb centres;
  for (size_t i = range.begin; i < range.end; ++i) centres.extend(boxes[i].center());
  const int axis = centres.longest_axis();
  const float middle = centres.center()[axis];
  const auto begin = boxes.begin() + static_cast<std::ptrdiff_t>(range.begin),
             end = boxes.begin() + static_cast<std::ptrdiff_t>(range.end);
  const auto at = std::partition(begin, end, [&](const Aabb& b) { return b.center()[axis] <= middle; });
  if (at == begin || at == end) return false;
  const auto cut = static_cast<size_t>(at - boxes.begin());
  second = {cut, range.end, bounds_of(std::span(boxes).subspan(cut, range.end - cut))};
  range = {range.begin, cut, bounds_of(std::span(boxes).subspan(range.begin, cut - range.begin))};
  return true;
}

// Factors of four.
int size_class(const Aabb& box) { return std::ilogb(std::max(box.diagonal(), 1e-30f)) / 2; }

}  // namespace

void SceneExtent::add_parts(std::vector<Aabb> boxes, size_t most) {
  std::vector<Range> ranges{{0, boxes.size(), bounds_of(boxes)}};
  while (ranges.size() < most) {
    Range* largest = nullptr;
    for (Range& r : ranges)
      if (!r.whole && (largest == nullptr || r.bounds.diagonal2() > largest->bounds.diagonal2())) largest = &r;
    if (largest == nullptr) break;
    Range second;
    if (split(boxes, *largest, second))
      ranges.push_back(second);
    else
      largest->whole = true;
  }
  for (const Range& r : ranges) {
    const Vec3f far = max(max(r.bounds.hi, -r.bounds.lo), Vec3f{});
    // A lone point has the size of its coordinates' rounding.
    const float radius = std::max({0.5f * r.bounds.diagonal(), 1e-6f * max_component(far), 1e-12f});
    parts_.push_back({r.bounds.center(), radius, 0.0f});
  }
}

SceneExtent::SceneExtent(std::vector<Aabb> boxes) {
  std::erase_if(boxes, [](const Aabb& b) { return b.empty(); });
  if (boxes.empty()) return;
  // Things of one size at a time: the triangles of a dome are not mixed with those of the room within.
  std::map<int, std::vector<Aabb>> of_size;
  for (const Aabb& b : boxes) of_size[size_class(b)].push_back(b);
  const size_t most = std::max<size_t>(1, kMostParts / of_size.size());
  for (auto& [size, of_class] : of_size) add_parts(std::move(of_class), most);
  for (Part& p : parts_) p.share = 1.0f / static_cast<float>(parts_.size());

  // The part that is nearest to all.
  double least = std::numeric_limits<double>::infinity();
  for (const Part& at : parts_) {
    double sum = 0.0;
    for (const Part& p : parts_)
      sum += static_cast<double>(p.share) * static_cast<double>(length(p.center - at.center));
    if (sum < least) least = sum, center_ = at.center;
  }
  std::vector<std::pair<float, float>> values(parts_.size());
  for (size_t i = 0; i < parts_.size(); ++i)
    values[i] = {length(parts_[i].center - center_) + parts_[i].radius, parts_[i].share};
  radius_ = kTypicalScale * weighted_quantile(values, kTypicalQuantile);
  add_surroundings();
}

// A ground of a few triangles that reaches far beyond all else has one part, whose lights lie so far apart that none lies
// beside what stands on it, where its light comes from. Parts around the centre, each kGrowth times the one within, make
// the lights' density fall like the squared distance.
void SceneExtent::add_surroundings() {
  constexpr float kGrowth = 3.0f, kShare = 1.0f / 3.0f;
  float largest = 0.0f;
  for (const Part& p : parts_)
    if (length(p.center - center_) < p.radius) largest = std::max(largest, p.radius);
  if (!(radius_ > 0.0f && kGrowth * kGrowth * radius_ < largest)) return;
  std::vector<Part> around;
  for (float r = kGrowth * radius_; r < largest && around.size() < kMostParts; r *= kGrowth)
    around.push_back({center_, r, 0.0f});
  for (Part& p : parts_) p.share *= 1.0f - kShare;
  for (Part& p : around) p.share = kShare / static_cast<float>(around.size());
  parts_.insert(parts_.end(), around.begin(), around.end());
}

}  // namespace lumicut
