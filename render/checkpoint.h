// The state of a progressive render as bytes, which another render goes on from.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "film/film.h"
#include "film/iteration_mean.h"
#include "render/frame.h"
#include "render/iterations.h"

namespace lumicut {

// The state after `done` whole iterations, as bytes, and back. `key`: what it was made for; another one, and bytes that are
// damaged, throw Error(invalid_argument).
std::vector<uint8_t> save_checkpoint(const std::string& key, uint32_t done, const IterationMean& mean,
                                     const Film& film);
uint32_t load_checkpoint(const std::vector<uint8_t>& bytes, const std::string& key, IterationMean& mean, Film& film);

// Of all that decides the image beside the number of iterations [render/identity.h]. `host_lights`: null where they are
// traced.
std::string checkpoint_key(const Scene& scene, const std::string& integrator, const Params& params,
                           const VplSet* host_lights, const FrameOptions& frame, const IterationOptions& options);

}  // namespace lumicut
