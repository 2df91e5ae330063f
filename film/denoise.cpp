#include "film/denoise.h"

#include <array>
#include <atomic>
#include <vector>

#include "core/parallel.h"
#include "film/atrous.h"
#include "film/coarse_plane.h"
#include "film/iteration_mean.h"

namespace lumicut {

namespace {

constexpr size_t kLevels = 7;  // steps 1 ... 64: the widest reaches 127 pixels
constexpr size_t kRows = 8;    // of a chunk of work

// Deviations of normals and albedos inside one surface.
constexpr float kNormalDeviation = 0.15f, kAlbedoDeviation = 0.3f;
constexpr float kLeastAlbedo = 0.02f;  // what is darker is not divided by less
// Pixels on edges are a little like either side, and like no neighbour: without that they would keep their noise.
constexpr float kLoosening = 3.0f, kEnoughSupport = 0.25f;
// A pass is a firefly where it alone brings more than this share of what its surroundings show.
constexpr float kVisibleDot = 0.5f;
// Fireflies are spread so widely that this many of them overlap: a caustic that many have met keeps its shape.
constexpr float kOverlap = 32.0f;

// Levels are weighted by estimates of their error, so those that chance made small count most, and the mean is too small.
// By so much, as test_denoise and the scenes in docs/progressive.md measure it.
constexpr double kOfChoice = 1.5;

// Planes that are filtered: both halves' common part; of what fireflies bring to the mean the luminance and its square.
enum Filtered : size_t { kOdd = 0, kEven = 3, kRare = 6, kRareSquare = 7 };
static_assert(kFiltered == 8);

Rgb over(const Rgb& a, const Rgb& b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }

class Denoiser {
 public:
  Denoiser(const DenoiseOptions& options, std::span<const ResidualSums> sums, const Progress& progress, Film& film)
      : options_(options),
        sums_(sums),
        progress_(progress),
        film_(film),
        width_(film.crop().width()),
        height_(film.crop().height()),
        guide_(Guide::kPlanes, width_, height_, Guide::kFar),
        from_(kFiltered, width_, height_),
        to_(kFiltered, width_, height_),
        albedo_(3, width_, height_),
        rare_(3, width_, height_),
        spread_(width_ * height_, 0),
        result_(kResults, width_, height_),
        wrong_(width_, height_),
        varies_(width_, height_) {}

  void run() {
    make_guide();
    split();
    weigh_level();
    for (size_t level = 0; level < kLevels; ++level) {
      rows([&](size_t begin, size_t end) { atrous_rows(guide_, from_, size_t{1} << level, begin, end, to_); });
      std::swap(from_, to_);
      weigh_level();
      if (any_fireflies_) choose_spread(level);
    }
    spread_rare();
    write();
  }

 private:
  // Sums over levels, weighted: of the filtered residual (over its albedo), of the squared error, of the weights. Then
  // what the halves' luminance and the squared error were before.
  enum Results : size_t {
    kSum = 0,
    kError = 3,
    kWeight = 4,
    kOddBefore = 5,
    kEvenBefore = 6,
    kErrorBefore = 7,
    kResults = 8,
    kRareWidely = kOddBefore  // once levels are weighed: of fireflies the luminance, spread as widely as anything
  };

  template <typename Fn>
  void rows(Fn&& fn) const {
    parallel_chunks(height_, kRows, [&](size_t begin, size_t end) {
      if (!progress_.cancelled()) fn(begin, end);
    });
    progress_.check();
  }
  template <typename Fn>
  void pixels(Fn&& fn) const {
    rows([&](size_t begin, size_t end) {
      for (size_t y = begin; y < end; ++y)
        for (size_t x = 0; x < width_; ++x) fn(x, y);
    });
  }
  Rgb color(Channel channel, size_t x, size_t y) const {
    const float* p =
        film_.pixel(channel, film_.crop().x0 + static_cast<uint32_t>(x), film_.crop().y0 + static_cast<uint32_t>(y));
    return {p[0], p[1], p[2]};
  }
  void set(Channel channel, size_t x, size_t y, const auto& value) {
    film_.set(channel, film_.crop().x0 + static_cast<uint32_t>(x), film_.crop().y0 + static_cast<uint32_t>(y), value);
  }
  static Rgb read(const PaddedPlanes& planes, size_t first, size_t x, size_t y) {
    return {planes.row(first, y)[x], planes.row(first + 1, y)[x], planes.row(first + 2, y)[x]};
  }
  static void store(PaddedPlanes& planes, size_t first, size_t x, size_t y, const Rgb& value) {
    for (int k = 0; k < 3; ++k) planes.row(first + static_cast<size_t>(k), y)[x] = value[k];
  }
  Rgb albedo(size_t x, size_t y) const { return read(albedo_, 0, x, y); }

  void make_guide() {
    pixels([&](size_t x, size_t y) {
      const Rgb seen = color(Channel::denoising_albedo, x, y);
      store(albedo_, 0, x, y, max(seen, Rgb{kLeastAlbedo, kLeastAlbedo, kLeastAlbedo}));
      constexpr float kRootHalf = 0.70710678f;
      store(guide_, 0, x, y, color(Channel::denoising_normal, x, y) * (kRootHalf / kNormalDeviation));
      store(guide_, 3, x, y, seen * (kRootHalf / kAlbedoDeviation));
      const float depth = *film_.pixel(Channel::denoising_depth, film_.crop().x0 + static_cast<uint32_t>(x),
                                       film_.crop().y0 + static_cast<uint32_t>(y));
      guide_.row(Guide::kInverseDepth, y)[x] = depth > 0.0f ? 1.0f / depth : 0.0f;
      guide_.row(Guide::kLoosened, y)[x] = 1.0f;
    });
    // Of two neighbours the one on the same surface changes less.
    const auto slope = [](float before, float here, float after) {
      return std::abs(after - here) < std::abs(here - before) ? after - here : here - before;
    };
    pixels([&](size_t x, size_t y) {
      const auto at = [&](size_t u, size_t v) { return guide_.row(Guide::kInverseDepth, v)[u]; };
      const float here = at(x, y);
      const auto along = [&](bool first, bool last, float before, float after) {
        return first && last ? 0.0f : first ? after - here : last ? here - before : slope(before, here, after);
      };
      guide_.row(Guide::kAlongX, y)[x] =
          along(x == 0, x + 1 == width_, x > 0 ? at(x - 1, y) : 0.0f, x + 1 < width_ ? at(x + 1, y) : 0.0f);
      guide_.row(Guide::kAlongY, y)[x] =
          along(y == 0, y + 1 == height_, y > 0 ? at(x, y - 1) : 0.0f, y + 1 < height_ ? at(x, y + 1) : 0.0f);
    });
    rows([&](size_t begin, size_t end) { support_rows(guide_, begin, end, to_); });
    pixels([&](size_t x, size_t y) {
      const float missing = std::max(0.0f, 1.0f - to_.row(0, y)[x] / kEnoughSupport);
      const float loosened = 1.0f + kLoosening * missing;
      guide_.row(Guide::kLoosened, y)[x] = loosened * loosened;
    });
  }

  // The halves' means without fireflies, over the albedo, and what those bring.
  void split() {
    const auto n = static_cast<float>(options_.passes);
    const auto even = static_cast<float>(options_.passes / 2), odd = n - even;
    CoarsePlane shown(width_, height_);
    if (!options_.keep_fireflies) {
      shown.fill(progress_,
                 [&](size_t x, size_t y) { return luminance(over(color(Channel::residual, x, y), albedo(x, y))); });
      shown.blur(6);
    }
    pixels([&](size_t x, size_t y) {
      const ResidualSums& s = sums_[y * width_ + x];
      const Rgb a = albedo(x, y), all = color(Channel::residual, x, y) * n;
      Rgb halves[2] = {s.odd, all - s.odd}, rare{};
      if (!options_.keep_fireflies) {
        const float most = kVisibleDot * n * (std::max(0.0f, s.mean) + shown.at(x, y) * luminance(a));
        for (int half = 0; half < 2; ++half)
          for (const Rgb& bright : s.brightest[half]) {
            const float l = luminance(bright);
            if (!(l > most)) continue;
            const Rgb excess = bright * (1.0f - most / l);
            halves[half] -= excess, rare += excess;
            any_fireflies_.store(true, std::memory_order_relaxed);
          }
      }
      const auto mean = [&](const Rgb& sum, float count) { return over(max(sum, Rgb{}), a) * (1.0f / count); };
      store(from_, kOdd, x, y, mean(halves[0], odd)), store(from_, kEven, x, y, mean(halves[1], even));
      const Rgb over_albedo = mean(rare, n);
      store(rare_, 0, x, y, over_albedo);
      const float l = luminance(over_albedo);
      from_.row(kRare, y)[x] = l, from_.row(kRareSquare, y)[x] = l * l;
      result_.row(kOddBefore, y)[x] = luminance(read(from_, kOdd, x, y) * a);
      result_.row(kEvenBefore, y)[x] = luminance(read(from_, kEven, x, y) * a);
      set(Channel::denoising_color, x, y, color(Channel::radiance, x, y) - rare * (1.0f / n));
    });
  }

  // How many fireflies overlap where `level` and those before it spread them: (sum of light)² / sum of light², over the
  // kernel's area, which is that of a pyramid.
  void choose_spread(size_t level) {
    const float area = 2.25f * static_cast<float>(size_t{1} << (2 * level + 2));
    pixels([&](size_t x, size_t y) {
      uint8_t& chosen = spread_[y * width_ + x];
      if (chosen != 0 || !(max_component(read(rare_, 0, x, y)) > 0.0f)) return;
      const float light = from_.row(kRare, y)[x];
      if (level + 1 == kLevels || area * light * light > kOverlap * from_.row(kRareSquare, y)[x])
        chosen = static_cast<uint8_t>(level + 1);
    });
  }

  // What fireflies bring, each spread by as many levels as it needs: from the widest on, since levels follow each other in
  // any order, so that each joins where its own begin. Into the first planes of from_.
  void spread_rare() {
    pixels([&](size_t x, size_t y) {
      result_.row(kRareWidely, y)[x] = from_.row(kRare, y)[x];
      store(from_, 0, x, y, Rgb{});
    });
    if (!any_fireflies_) return;
    for (size_t level = kLevels; level-- > 0;) {
      pixels([&](size_t x, size_t y) {
        if (spread_[y * width_ + x] == level + 1) store(from_, 0, x, y, read(from_, 0, x, y) + read(rare_, 0, x, y));
      });
      rows([&](size_t begin, size_t end) { atrous_first_rows(guide_, from_, size_t{1} << level, begin, end, to_); });
      std::swap(from_, to_);
    }
  }

  // Adds what the halves are now to the sums, by how far from the truth they seem to be.
  void weigh_level() {
    // With halves A, B of variance v each, before, and A', B', of variance w each, filtered:
    // E[(A' − B)² + (B' − A)²]/2 = bias² + w + v, E[(A − B)²]/2 = v, E[(A' − B')²]/4 = w/2.
    const auto halves = [&](size_t x, size_t y) {
      const Rgb a = albedo(x, y);
      return std::array{luminance(read(from_, kOdd, x, y) * a), luminance(read(from_, kEven, x, y) * a),
                        result_.row(kOddBefore, y)[x], result_.row(kEvenBefore, y)[x]};
    };
    const auto square = [](float v) { return v * v; };
    varies_.fill(progress_, [&](size_t x, size_t y) {
      const auto [odd, even, odd_before, even_before] = halves(x, y);
      return 0.25f * square(odd - even);
    });
    wrong_.fill(progress_, [&](size_t x, size_t y) {
      const auto [odd, even, odd_before, even_before] = halves(x, y);
      return 0.5f * (square(odd - even_before) + square(even - odd_before) - square(odd_before - even_before) -
                     square(odd - even));
    });
    varies_.blur(2), wrong_.blur(2);
    pixels([&](size_t x, size_t y) {
      const float error = std::max(0.0f, wrong_.at(x, y)) + varies_.at(x, y);
      if (first_) result_.row(kErrorBefore, y)[x] = error;
      // Relative to the unfiltered error, so that no scale of light overflows.
      const float relative = error / std::max(result_.row(kErrorBefore, y)[x], 1e-30f) + 1e-6f;
      const float weight = 1.0f / square(relative);
      const Rgb filtered = (read(from_, kOdd, x, y) + read(from_, kEven, x, y)) * 0.5f;
      for (size_t k = 0; k < 3; ++k) result_.row(kSum + k, y)[x] += weight * filtered[static_cast<int>(k)];
      result_.row(kError, y)[x] += weight * error;
      result_.row(kWeight, y)[x] += weight;
    });
    first_ = false;
  }

  void write() {
    const auto n = static_cast<double>(options_.passes);
    const double t = student_t(options_.confidence, options_.passes);
    pixels([&](size_t x, size_t y) {
      const Rgb a = albedo(x, y), rare = read(from_, 0, x, y) * a;
      const float per_weight = 1.0f / result_.row(kWeight, y)[x];
      const Rgb radiance = color(Channel::radiance, x, y), residual = color(Channel::residual, x, y);
      set(Channel::denoised, x, y, radiance - residual + read(result_, kSum, x, y) * per_weight * a + rare);
      set(Channel::denoising_color, x, y, color(Channel::denoising_color, x, y) + rare);
      // Of the rest as the channel `error` has it: the mean over 3x3 pixels.
      double squares = 0.0;
      int count = 0;
      for (size_t v = y > 0 ? y - 1 : 0; v < std::min(height_, y + 2); ++v)
        for (size_t u = x > 0 ? x - 1 : 0; u < std::min(width_, x + 2); ++u, ++count)
          squares += static_cast<double>(sums_[v * width_ + u].squares);
      const double rest = squares / count / (n * (n - 1.0));
      const double filtered = static_cast<double>(result_.row(kError, y)[x] * per_weight);
      // Where none was met in this pixel's surroundings, one may have been missed.
      const double spread =
          static_cast<double>(std::max(luminance(rare), result_.row(kRareWidely, y)[x] * luminance(a)));
      set(Channel::denoised_error, x, y,
          static_cast<float>(t * std::sqrt(rest + kOfChoice * filtered + spread * spread)));
    });
  }

  const DenoiseOptions& options_;
  const std::span<const ResidualSums> sums_;
  const Progress& progress_;
  Film& film_;
  const size_t width_, height_;
  PaddedPlanes guide_, from_, to_, albedo_, rare_;
  std::vector<uint8_t> spread_;  // by how many levels the pixel's fireflies are; 0: it has none
  PaddedPlanes result_;
  CoarsePlane wrong_, varies_;
  bool first_ = true;
  std::atomic<bool> any_fireflies_{false};
};

}  // namespace

uint64_t denoising_pixel_bytes() { return (Guide::kPlanes + 2 * kFiltered + 3 + 3 + 8) * sizeof(float) + 2; }

void denoise(const DenoiseOptions& options, std::span<const ResidualSums> sums, const Progress& progress, Film& film) {
  if (options.passes >= 2) Denoiser(options, sums, progress, film).run();
}

}  // namespace lumicut
