#include "film/iteration_mean.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cstring>
#include <limits>

#include "core/parallel.h"

namespace lumicut {

double student_t(double confidence, uint64_t n) {
  const boost::math::students_t_distribution<double> t(static_cast<double>(n - 1));
  return boost::math::quantile(t, 0.5 + 0.5 * confidence);
}

IterationMean::IterationMean(const Rect& crop, double confidence, bool denoised)
    : crop_(crop),
      confidence_(confidence),
      sums_(size_t{crop.width()} * crop.height()),
      residuals_(denoised ? sums_.size() : 0) {}

void IterationMean::add(const Film& pass, const Rect& rect, uint64_t passes, Film& mean) {
  const auto n = static_cast<double>(passes);
  const auto share = static_cast<float>(1.0 / n);
  for (uint32_t y = rect.y0; y < rect.y1; ++y)
    for (uint32_t x = rect.x0; x < rect.x1; ++x) {
      Sums& s = sums_[index(x, y)];
      const float* radiance = pass.pixel(Channel::radiance, x, y);
      const double value = luminance(Rgb{radiance[0], radiance[1], radiance[2]});
      const double away = value - s.mean;
      s.mean += away / n;
      s.squares += away * (value - s.mean);
      for (int k = 0; k < 3; ++k) s.radiance[k] += radiance[k];
      if (!residuals_.empty()) {
        const float* residual = pass.pixel(Channel::residual, x, y);
        residuals_[index(x, y)].add({residual[0], residual[1], residual[2]}, {radiance[0], radiance[1], radiance[2]},
                                    passes);
      }
      for (size_t g = 0; g < mean.groups().size(); ++g) {
        const float* in = pass.group_pixel(g, x, y);
        float* out = mean.group_pixel(g, x, y);
        for (int k = 0; k < 3; ++k) out[k] += (in[k] - out[k]) * share;
      }
      for (const ChannelInfo& c : channel_table()) {
        if (!mean.has(c.channel)) continue;
        float* out = mean.pixel(c.channel, x, y);
        if (c.channel == Channel::radiance) {
          for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(s.radiance[k] / n);
        } else if (c.channel == Channel::denoised || c.channel == Channel::denoising_color) {
          for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(s.radiance[k] / n);  // until the end
        } else if (c.channel != Channel::error && c.channel != Channel::denoised_error) {
          const bool first = c.channel == Channel::depth || c.channel == Channel::position;
          const float* in = pass.pixel(c.channel, x, y);
          for (uint32_t k = 0; k < c.components; ++k)
            if (passes == 1 || !first) out[k] += (in[k] - out[k]) * share;
        }
      }
    }
}

void IterationMean::write_error(uint64_t passes, Film& mean) const {
  if (passes < 2) return;
  const auto n = static_cast<double>(passes);
  const double t = student_t(confidence_, passes);
  constexpr size_t kRows = 16;
  parallel_chunks(crop_.height(), kRows, [&](size_t begin, size_t end) {
    for (uint32_t y = crop_.y0 + begin; y < crop_.y0 + end; ++y)
      for (uint32_t x = crop_.x0; x < crop_.x1; ++x) {
        double sum = 0.0;
        int count = 0;
        for (uint32_t v = std::max(crop_.y0 + 1, y) - 1; v < std::min(crop_.y1, y + 2); ++v)
          for (uint32_t u = std::max(crop_.x0 + 1, x) - 1; u < std::min(crop_.x1, x + 2); ++u, ++count)
            sum += sums_[index(u, v)].squares;
        const double variance = std::max(0.0, sum / count) / (n * (n - 1.0));
        mean.set(Channel::error, x, y, static_cast<float>(t * std::sqrt(variance)));
      }
  });
}

double IterationMean::error(const Film& mean, uint64_t passes) const {
  if (passes < 2) return std::numeric_limits<double>::infinity();
  double total = 0.0;
  for (const Sums& s : sums_) total += s.mean;
  const double least = 0.1 * total / static_cast<double>(sums_.size());
  std::vector<double> shares;
  shares.reserve(sums_.size());
  for (uint32_t y = crop_.y0; y < crop_.y1; ++y)
    for (uint32_t x = crop_.x0; x < crop_.x1; ++x) {
      const double half = *mean.pixel(Channel::error, x, y), level = std::max(sums_[index(x, y)].mean, least);
      shares.push_back(half > 0.0 ? half / level : 0.0);
    }
  const auto at = std::min(shares.size() - 1, static_cast<size_t>(confidence_ * static_cast<double>(shares.size())));
  std::nth_element(shares.begin(), shares.begin() + static_cast<ptrdiff_t>(at), shares.end());
  return shares[at];
}

void IterationMean::save(std::vector<uint8_t>& out) const {
  const auto add = [&](const auto& values) {
    const auto* bytes = reinterpret_cast<const uint8_t*>(values.data());
    out.insert(out.end(), bytes, bytes + values.size() * sizeof(values[0]));
  };
  add(sums_), add(residuals_);
}

bool IterationMean::load(std::span<const uint8_t> bytes) {
  const size_t of_sums = sums_.size() * sizeof(Sums), of_residuals = residuals_.size() * sizeof(ResidualSums);
  if (bytes.size() != of_sums + of_residuals) return false;
  std::memcpy(sums_.data(), bytes.data(), of_sums);
  if (of_residuals > 0) std::memcpy(residuals_.data(), bytes.data() + of_sums, of_residuals);
  return true;
}

}  // namespace lumicut
