// Takes away noise that is each pixel's own, by what the passes tell of it. docs/decisions/0021-denoising.md
//
// The light of virtual lights is smooth already, and stays as it is, texture and shadows too. What is filtered is the
// channel `residual` alone, over its albedo: by passes of a wide kernel that stops at edges of surfaces [Dammertz et al.
// 2010]. How wide, each place decides by the error of the one half of the passes filtered against the other as it is, an
// unbiased estimate of bias and variance together. [Rousselle et al. 2011, 2012; the halves as in Bitterli et al. 2016]
//
// A pass that is so bright in a pixel that it would show as a dot is spread until many of them overlap. No light is lost by
// that; what is spread becomes less with the number of passes, as each counts for less.
#pragma once

#include <span>

#include "core/progress.h"
#include "film/film.h"
#include "film/residual_sums.h"

namespace lumicut {

struct DenoiseOptions {
  uint64_t passes = 0;
  double confidence = 0.95;
  bool keep_fireflies = false;
};

// From the film's mean over the passes, and what is known of each pixel (rows from the top of the crop), the channels that
// denoising makes. With fewer than two passes nothing is known of noise, and they stay the plain radiance. The same bits
// on any number of threads. Throws Error(cancelled).
void denoise(const DenoiseOptions& options, std::span<const ResidualSums> sums, const Progress& progress, Film& film);

// Memory that it takes, for each pixel. Its margins come on top.
uint64_t denoising_pixel_bytes();

}  // namespace lumicut
