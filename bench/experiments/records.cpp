// Where records of light go: rows of LightSlice, and records of an irradiance cache. Placed by what the renderer has
// (halving by position and normal), a jittered grid, dart throwing (Poisson disks) and hitting sets.
//
// Darts and hitting sets solve one instance: around each pixel (one at random of each 2 x 2 or 4 x 4) a disk in the
// image, whose radius is the same everywhere, or follows the harmonic mean distance to what the point sees [Ward 1988];
// every disk shall hold a record. Darts take pixels in random order, each unless its disk holds a record already.
// Records are compared at equal radius by number, and at equal number (the radius found by bisection) by error.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "bench/experiments/experiment_scene.h"
#include "bench/experiments/experiments.h"
#include "bench/geometry/bench_util.h"
#include "clusters/column_clusters.h"
#include "clusters/light_matrix.h"
#include "clusters/light_sum.h"
#include "clusters/slices.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "geometry/hitting_set.h"
#include "integrators/integrator.h"

namespace lumicut::bench {
namespace {

using Records = std::vector<uint32_t>;  // points

constexpr size_t kColumns = 128, kGroup = 32;
constexpr uint64_t kSeeds = 3;

struct Instance {
  std::vector<uint32_t> point;  // of each candidate
  std::vector<Point2> at;       // in pixels
  std::vector<double> radius;   // before the common factor
};

// Harmonic mean distance to what 32 rays meet, cosine-weighted; rays that meet nothing count as the scene's radius.
std::vector<float> harmonic_distances(const ExperimentScene& s) {
  std::vector<float> out(s.points.size());
  parallel_chunks(out.size(), 256, [&](size_t begin, size_t end) {
    std::vector<RayHit> rays(32);
    for (size_t i = begin; i < end; ++i) {
      Rng rng(1, Stage::test, i);
      const Vec3f n = s.points.normal_at(i);
      for (RayHit& r : rays) {
        const float z = 2 * rng.next_float() - 1, phi = 6.2831853f * rng.next_float(), q = std::sqrt(1 - z * z);
        const Vec3f d = n * 1.0001f + Vec3f{q * std::cos(phi), q * std::sin(phi), z};
        r = RayHit{};
        r.ray.org = s.points.position_at(i), r.ray.dir = normalize(d);
      }
      s.scene->accel().intersect(rays);
      double sum = 0;
      for (const RayHit& r : rays)
        sum += 1.0 / std::max(1e-3f * s.scene->radius(), r.hit.geom == kNoId ? s.scene->radius() : r.ray.tfar);
      out[i] = static_cast<float>(32.0 / sum);
    }
  });
  return out;
}

Instance make_instance(const ExperimentScene& s, const std::vector<float>& harmonic, uint32_t step, bool uniform) {
  Instance in;
  for (uint32_t i = 0; i < s.points.size(); ++i) {
    const uint32_t x = s.points.pixel[i] % s.side, y = s.points.pixel[i] / s.side;
    // A pixel of each cell at random: on a grid the number of records would leap with the radius.
    Rng rng(1, Stage::test, x / step, y / step);
    if (x % step != rng.next_below(step) || y % step != rng.next_below(step)) continue;
    in.point.push_back(i);
    in.at.push_back({static_cast<double>(x), static_cast<double>(y)});
    in.radius.push_back(uniform ? 1.0 : static_cast<double>(harmonic[i] * s.spread[i]));
  }
  // Radii differ by no more than 8 about their median.
  std::vector<double> sorted = in.radius;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  const double median = sorted[sorted.size() / 2];
  for (double& r : in.radius) r = std::clamp(r / median, 1 / 8.0, 8.0);
  return in;
}

std::vector<Disk> disks(const Instance& in, double factor) {
  std::vector<Disk> out;
  for (size_t i = 0; i < in.at.size(); ++i) out.push_back({in.at[i], in.radius[i] * factor});
  return out;
}

Records darts(const Instance& in, double factor, uint64_t seed) {
  std::vector<uint32_t> order(in.at.size());
  std::iota(order.begin(), order.end(), 0u);
  Rng rng(seed, Stage::test, 77);
  for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[rng.next_below(static_cast<uint32_t>(i))]);
  const std::vector<Disk> all = disks(in, factor);
  Records chosen;
  std::vector<Point2> at;
  for (const uint32_t i : order) {
    if (std::any_of(at.begin(), at.end(), [&](const Point2& p) { return hits(p, all[i]); })) continue;
    chosen.push_back(in.point[i]);
    at.push_back(in.at[i]);
  }
  return chosen;
}

struct Hit {
  Records records;
  size_t bound;
};
Hit hitting(const Instance& in, double factor, bool quick = false) {
  const HittingSet set =
      solve_hitting_set(in.at, disks(in, factor), {.local_search = !quick, .bound_iterations = quick ? 10 : 60});
  Hit h{{}, set.lower_bound};
  for (const uint32_t p : set.points) h.records.push_back(in.point[p]);
  return h;
}

// One pixel at random of each cell of a grid of about `count` cells.
Records jittered(const ExperimentScene& s, size_t count, uint64_t seed) {
  const auto cells = static_cast<uint32_t>(std::lround(std::sqrt(static_cast<double>(count))));
  std::vector<uint32_t> chosen(size_t{cells} * cells, 0xffffffffu), seen(chosen.size(), 0);
  Rng rng(seed, Stage::test, 78);
  for (uint32_t i = 0; i < s.points.size(); ++i) {
    const uint32_t x = s.points.pixel[i] % s.side, y = s.points.pixel[i] / s.side;
    const size_t c = size_t{y * cells / s.side} * cells + x * cells / s.side;
    if (rng.next_below(++seen[c]) == 0) chosen[c] = i;
  }
  std::erase(chosen, 0xffffffffu);
  return chosen;
}

// Common factor of the radii at which `place` gives `count` records, as nearly as bisection finds it.
double factor_for(size_t count, const std::function<size_t(double)>& place) {
  double lo = 3, hi = 48, best = lo;
  size_t off = ~size_t{0};
  for (int step = 0; step < 7; ++step) {
    const double mid = std::sqrt(lo * hi);
    const size_t n = place(mid);
    const size_t d = n > count ? n - count : count - n;
    if (d < off) off = d, best = mid;
    if (d * 100 <= count) break;
    (n > count ? lo : hi) = mid;
  }
  return best;
}

// Slices around records: each point goes to the nearest in position and normal. Records follow each other as they lie
// in `order`, so that groups of slices are neighbours.
Slices slices_around(const ExperimentScene& s, Records records, const std::vector<uint32_t>& order) {
  std::vector<uint32_t> rank(order.size());
  for (uint32_t i = 0; i < order.size(); ++i) rank[order[i]] = i;
  std::sort(records.begin(), records.end(), [&](uint32_t a, uint32_t b) { return rank[a] < rank[b]; });
  std::vector<PointFeature> features(s.points.size());
  for (size_t i = 0; i < features.size(); ++i) features[i] = point_feature(s.points, i, s.scene->radius());
  std::vector<uint32_t> nearest(features.size());
  parallel_chunks(features.size(), 256, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (uint32_t r = 1; r < records.size(); ++r)
        if (distance2(features[i], features[records[r]]) < distance2(features[i], features[records[nearest[i]]]))
          nearest[i] = r;
  });
  Slices slices;
  std::vector<std::vector<uint32_t>> members(records.size());
  for (uint32_t i = 0; i < nearest.size(); ++i) members[nearest[i]].push_back(i);
  for (size_t r = 0; r < records.size(); ++r) {
    if (members[r].empty()) continue;
    slices.begins.push_back(static_cast<uint32_t>(slices.order.size()));
    slices.order.insert(slices.order.end(), members[r].begin(), members[r].end());
    slices.representatives.push_back(records[r]);
  }
  slices.begins.push_back(static_cast<uint32_t>(slices.order.size()));
  return slices;
}

// integrators/light_slice.cpp with given slices: the same steps in the same order.
std::vector<Rgb> light_slice(const ExperimentScene& s, const Slices& slices, uint64_t seed, uint64_t& rays) {
  const std::vector<Vpl> lights = order_lights(s.lights.lights);
  const std::vector<float> times = race_times(lights.size(), seed, 0);
  std::vector<PointFeature> features;
  std::vector<Rgb> out(s.points.size());
  Progress progress;
  rays = 0;
  for (size_t begin = 0; begin < slices.size(); begin += kGroup) {
    const size_t end = std::min(slices.size(), begin + kGroup);
    ShadePoints rows;
    features.clear();
    for (size_t i = begin; i < end; ++i) {
      SurfacePoint p = s.points.get(slices.representatives[i]);
      p.diffuse = Rgb{1, 1, 1} * std::max(luminance(p.diffuse), 1e-6f);
      rows.push(p);
      features.push_back(point_feature(s.points, slices.representatives[i], s.scene->radius()));
    }
    rows.finish();
    const LightMatrix matrix = LightMatrix::build(*s.scene, lights, rows, s.clamp2, 0.07f, progress);
    rays += matrix.rays();
    std::vector<float> normalise(end - begin);
    for (size_t r = 0; r < normalise.size(); ++r)
      normalise[r] = matrix.row_sums()[r] > 0 ? static_cast<float>(1.0 / matrix.row_sums()[r]) : 0.0f;
    ColumnClusters initial(matrix, normalise);
    initial.split(kColumns / 2, progress);
    std::vector<uint64_t> own_rays(normalise.size());
    parallel_chunks(normalise.size(), 1, [&](size_t own, size_t) {
      std::vector<float> weights(normalise.size()), d;
      for (size_t r = 0; r < normalise.size(); ++r)
        if (r != own) d.push_back(distance2(features[own], features[r]));
      if (d.empty()) d.push_back(1.0f);
      const size_t k = std::min<size_t>(3, d.size() - 1);
      std::nth_element(d.begin(), d.begin() + static_cast<std::ptrdiff_t>(k), d.end());
      const float unit = std::max(d[k], 1e-20f);
      for (size_t r = 0; r < weights.size(); ++r)
        weights[r] =
            normalise[r] * (r == own ? 1.0f : 0.01f + 0.5f * std::exp(-distance2(features[own], features[r]) / unit));
      ColumnClusters clusters(initial, weights);
      clusters.split(kColumns, progress);
      std::vector<ScaledLight> list;
      for (const auto& c : clusters.clusters()) {
        const ColumnRepresentative r = representative(clusters, c, lights, times);
        list.push_back({&lights[r.column], r.intensity});
      }
      ShadePoints points;
      const size_t slice = begin + own;
      for (uint32_t i = slices.begins[slice]; i < slices.begins[slice + 1]; ++i)
        points.push(s.points.get(slices.order[i]));
      points.finish();
      const auto lit = std::make_unique<LitPoints>();
      std::vector<Rgb> sums(kMaxLit);
      std::vector<uint32_t> counts(kMaxLit);
      for (size_t first = 0; first < points.size(); first += kMaxLit) {
        const size_t n = std::min(kMaxLit, points.size() - first);
        sum_lights(s.scene->accel(), list, s.clamp2, points, first, n, progress, *lit, sums.data(), counts.data());
        for (size_t i = 0; i < n; ++i) {
          out[slices.order[slices.begins[slice] + first + i]] = sums[i];
          own_rays[own] += counts[i];
        }
      }
    });
    rays += std::accumulate(own_rays.begin(), own_rays.end(), uint64_t{0});
  }
  return out;
}

// Indirect light by an irradiance cache whose records know the exact value, weights of Ward 1988, the 8 weightiest.
std::vector<Rgb> cache(const ExperimentScene& s, const std::vector<float>& harmonic, const Records& records) {
  std::vector<Rgb> out(s.points.size());
  parallel_chunks(out.size(), 256, [&](size_t begin, size_t end) {
    std::vector<std::pair<float, uint32_t>> weights;
    for (size_t i = begin; i < end; ++i) {
      weights.clear();
      for (const uint32_t r : records) {
        const float cosine = dot(s.points.normal_at(i), s.points.normal_at(r));
        const float e = length(s.points.position_at(i) - s.points.position_at(r)) / harmonic[r] +
                        std::sqrt(std::max(0.0f, 1.0f - cosine));
        weights.emplace_back(1.0f / std::max(e, 1e-4f), r);
      }
      const size_t n = std::min<size_t>(8, weights.size());
      std::partial_sort(weights.begin(), weights.begin() + static_cast<std::ptrdiff_t>(n), weights.end(),
                        [](const auto& a, const auto& b) { return a > b; });
      Rgb sum{};
      float total = 0;
      for (size_t k = 0; k < n; ++k) {
        const float w = weights[k].first * weights[k].first;  // nearer ones count more
        sum += s.reference_indirect[weights[k].second] * w, total += w;
      }
      out[i] = sum * (1.0f / total);
    }
  });
  return out;
}

struct Score {
  double sum = 0, lo = 1e30, hi = 0;
  int n = 0;
  void add(double v) { sum += v, lo = std::min(lo, v), hi = std::max(hi, v), ++n; }
};

}  // namespace

bool records(const char* name) {
  const auto s = make_room(name, sized(128u, 24u), sized(1500u, 100u), sized(4500u, 300u));
  if (!s) return false;
  std::printf("\n## records, %s: %ux%u, %zu lights, %zu columns, %llu seeds: mean (least..greatest)\n", name, s->side,
              s->side, s->lights.lights.size(), kColumns, static_cast<unsigned long long>(kSeeds));
  double harmonic_time = 0;
  std::vector<float> harmonic;
  harmonic_time = time_of([&] { harmonic = harmonic_distances(*s); });
  const Instance every_second[] = {make_instance(*s, harmonic, 2, true), make_instance(*s, harmonic, 2, false)},
                 every_fourth[] = {make_instance(*s, harmonic, 4, true), make_instance(*s, harmonic, 4, false)};
  std::printf("harmonic mean distances: %.2f s; instances: %zu points and disks; for 64 records %zu\n", harmonic_time,
              every_second[0].at.size(), every_fourth[0].at.size());
  {  // the copy of LightSlice above is LightSlice
    Params params(all_params(*find_integrator("light_slice")));
    params.set("slices", "64");
    params.set("columns", std::to_string(kColumns));
    const auto integrator = find_integrator("light_slice")->create();
    Progress progress;
    Stats stats;
    integrator->prepare(*s->scene, s->lights, params, {progress, stats});
    std::vector<Rgb> image(s->points.size());
    integrator->shade(s->points, image, {}, {progress, stats});
    uint64_t rays;
    const auto copy = light_slice(*s, build_slices(s->points, 64, 16, s->scene->radius()), 1, rays);
    std::printf("light_slice, 64 slices: RMSE %.4f, %llu rays; the bench's own: %.4f, %llu\n",
                rmse(image, s->reference), static_cast<unsigned long long>(stats.counters().rays),
                rmse(copy, s->reference), static_cast<unsigned long long>(rays));
  }
  std::printf("equal radius: factor | darts (of %llu) | hitting set | lower bound | darts / set\n",
              static_cast<unsigned long long>(kSeeds));
  for (const auto& [label, in] : {std::pair{"uniform", &every_second[0]}, {"harmonic", &every_second[1]}})
    for (const double factor : {6.0, 10.0}) {
      double mean = 0;
      for (uint64_t seed = 1; seed <= kSeeds; ++seed)
        mean += static_cast<double>(darts(*in, factor, seed).size()) / static_cast<double>(kSeeds);
      const Hit h = hitting(*in, factor);
      std::printf("  %-9s %4.0f pixels | %7.1f | %5zu | %5zu | %.3f\n", label, factor, mean, h.records.size(), h.bound,
                  mean / static_cast<double>(h.records.size()));
    }
  for (const size_t count : {64, 256}) {
    std::printf("%zu records:\n  %-31s %7s | %-23s | %9s | %-23s | %6s | %s\n", count, "placement", "records",
                "LightSlice RMSE", "its mean", "cache RMSE", "M rays", "placing / rendering, CPU");
    const Slices ours = build_slices(s->points, count, 16, s->scene->radius());
    const auto row = [&](const char* label, const std::function<Records(uint64_t)>& place, bool own_slices) {
      Score slice_error, slice_mean, cache_error, number;
      double placing = 0, rendering = 0;
      uint64_t rays = 0;
      for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
        Records r;
        const double time = time_of([&] { r = place(seed); });
        if (seed == 1) placing = time * kSeeds;
        const Slices slices = own_slices ? ours : slices_around(*s, r, ours.order);
        std::vector<Rgb> image;
        rendering += time_of([&] { image = light_slice(*s, slices, seed, rays); });
        slice_error.add(rmse(image, s->reference));
        slice_mean.add(100 * mean_error(image, s->reference));
        cache_error.add(rmse(cache(*s, harmonic, r), s->reference_indirect));
        number.add(static_cast<double>(r.size()));
      }
      std::printf("  %-31s %7.1f | %.4f (%.4f..%.4f) | %7.2f %% | %.4f (%.4f..%.4f) | %6.2f | %.3f\n", label,
                  number.sum / number.n, slice_error.sum / slice_error.n, slice_error.lo, slice_error.hi,
                  slice_mean.sum / slice_mean.n, cache_error.sum / cache_error.n, cache_error.lo, cache_error.hi,
                  static_cast<double>(rays) / 1e6, placing / rendering);
      std::fflush(stdout);
    };
    row(
        "halving (the renderer's)",
        [&](uint64_t) { return build_slices(s->points, count, 16, s->scene->radius()).representatives; }, true);
    row(
        "the same, points to the nearest", [&](uint64_t) { return ours.representatives; }, false);
    row(
        "jittered grid", [&](uint64_t seed) { return jittered(*s, count, seed); }, false);
    const Instance* instances = count < 128 ? every_fourth : every_second;
    for (const auto& [label, in] : {std::pair{"uniform", instances}, {"harmonic", instances + 1}}) {
      const double dart = factor_for(count, [&](double f) { return darts(*in, f, 1).size(); });
      row((std::string("darts, ") + label + " radius").c_str(), [&](uint64_t seed) { return darts(*in, dart, seed); },
          false);
      const double hit = factor_for(count, [&](double f) { return hitting(*in, f, true).records.size(); });
      Records set;  // it does not depend on the seed
      row((std::string("hitting set, ") + label + " radius").c_str(),
          [&](uint64_t seed) { return seed == 1 ? set = hitting(*in, hit).records : set; }, false);
    }
  }
  return true;
}

}  // namespace lumicut::bench
