// The mean of independent passes over one film, and how far it may be from what they converge to: a confidence interval
// for each pixel by Student's t. [Student 1908; for many lights after Nabata et al. 2016]
#pragma once

#include <span>
#include <vector>

#include "film/film.h"
#include "film/residual_sums.h"

namespace lumicut {

// Half the width of the interval that holds the mean with `confidence`, in standard errors, from `n` >= 2 samples.
double student_t(double confidence, uint64_t n);

class IterationMean {
 public:
  // `denoised`: keeps what denoising goes by.
  IterationMean(const Rect& crop, double confidence, bool denoised);

  // What `pass` holds inside `rect` joins the mean; `passes`: with this one. Keeps `mean` up to date: depth and
  // position stay those of the first pass. Rectangles of one pass may be added concurrently.
  void add(const Film& pass, const Rect& rect, uint64_t passes, Film& mean);

  // Fills the channel `error` after a whole pass: t standard errors. The variance is the mean over
  // the pixel's 3x3 neighbourhood: a rare bright event that a pixel has not met yet, its neighbours have.
  void write_error(uint64_t passes, Film& mean) const;

  // So large a share of the pixels as the confidence have an interval whose half width is at most this share of their
  // luminance, or of a tenth of the image's mean where that is larger. Infinite before two passes.
  double error(const Film& mean, uint64_t passes) const;

  // Of a pixel's luminance, over `passes` >= 2.
  double variance(uint32_t x, uint32_t y, uint64_t passes) const {
    return sums_[index(x, y)].squares / static_cast<double>(passes - 1);
  }

  // Of each pixel, rows from the top; empty where it is not denoised.
  std::span<const ResidualSums> residuals() const { return residuals_; }

  // State after whole passes, and back: false where the size does not fit.
  void save(std::vector<uint8_t>& out) const;
  bool load(std::span<const uint8_t> bytes);

 private:
  struct Sums {
    double radiance[3] = {};
    double mean = 0.0, squares = 0.0;  // of luminance; squares of distances from the mean [Welford 1962]
  };

 public:
  // Of a pixel, also as saved.
  static constexpr size_t pixel_bytes(bool denoised) { return sizeof(Sums) + (denoised ? sizeof(ResidualSums) : 0); }

 private:
  size_t index(uint32_t x, uint32_t y) const { return size_t{y - crop_.y0} * crop_.width() + (x - crop_.x0); }

  Rect crop_;
  double confidence_;
  std::vector<Sums> sums_;
  std::vector<ResidualSums> residuals_;
};

}  // namespace lumicut
