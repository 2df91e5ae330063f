// More rays of compensation where iterations before were noisy: what they bring by chance, such as a lamp by way of the
// metal around it, falls on few pixels, which have most of an image's error.
#pragma once

#include <cstdint>
#include <vector>

#include "core/progress.h"
#include "film/film.h"
#include "film/iteration_mean.h"

namespace lumicut {

inline constexpr uint32_t kMostCompensationRays = 32;

// How many each point of a pixel of the next iteration is given, rows from the top: 1 to kMostCompensationRays, at most 3
// in the mean; 2 of the first iteration. By the noise of one iteration, around the pixel, over its light; so it depends on
// iterations before alone, and the next one's expectation stays what it is. Throws Error(cancelled).
std::vector<uint8_t> compensation_rays(const IterationMean& mean, const Film& film, uint64_t iterations,
                                       const Progress& progress);

}  // namespace lumicut
