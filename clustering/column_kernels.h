// Arithmetic over columns of a light matrix: SIMD over rows, picked at run time. `values`: LightMatrix::values(), `stride`
// numbers a column.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/parallel.h"

namespace lumicut {

// out[i] = Σ_r weights2[r] · column[r]², of columns [0, n).
void column_norms2(const uint16_t* values, size_t stride, size_t n, const float* weights2, float* out);
// out[i] = column(items[i]) · v.
void project_columns(const uint16_t* values, size_t stride, const uint32_t* items, size_t n, const float* v,
                     float* out);
// sum += Σ_i factors[i] · column(items[i]).
void accumulate_columns(const uint16_t* values, size_t stride, const uint32_t* items, size_t n, const float* factors,
                        float* sum);
// Index of the direction with the largest dot product, the first of equals. directions: [count][stride], count a
// multiple of 4; scratch: `stride` long.
uint32_t most_similar_direction(const uint16_t* column, size_t stride, const float* directions, size_t count,
                                float* scratch);

// Columns of one partial sum: the same whatever the number of threads.
inline constexpr size_t kColumnChunk = 4096;

// fn(begin, end) for chunks of [0, n), over threads where they are many.
template <typename Fn>
void column_chunks(size_t n, Fn&& fn) {
  constexpr size_t kParallel = 16384;
  if (n >= kParallel) {
    parallel_chunks(n, kColumnChunk, fn);
  } else {
    for (size_t begin = 0; begin < n; begin += kColumnChunk) fn(begin, std::min(n, begin + kColumnChunk));
  }
}

}  // namespace lumicut
