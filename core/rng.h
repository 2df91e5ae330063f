// Random numbers named by what they are for, never by the thread that asks: the same seed gives the same image on any
// number of threads.
#pragma once

#include <cstdint>

namespace lumicut {

// 64-bit finaliser. [Stafford's variant 13 of MurmurHash3]
constexpr uint64_t hash64(uint64_t x) {
  x ^= x >> 30;
  x *= 0xbf58476d1ce4e5b9ull;
  x ^= x >> 27;
  x *= 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}
constexpr uint64_t hash64(uint64_t a, uint64_t b) { return hash64(a * 0x9e3779b97f4a7c15ull + hash64(b)); }

// What a stream of random numbers is for; part of its identity.
enum class Stage : uint32_t {
  camera,
  light_path,
  light_tree,
  point_tree,
  representative,
  visibility,
  reference,
  test,
  octree_shift,
  compensation,
  path,
  nearby_lights,
  importance
};

// PCG32 (XSH-RR). [O'Neill 2014]
class Rng {
 public:
  Rng(uint64_t seed, Stage stage, uint64_t a = 0, uint64_t b = 0)
      : state_(hash64(hash64(seed, static_cast<uint64_t>(stage)), hash64(a, b))), inc_(hash64(b, a) | 1u) {}

  uint32_t next_u32() {
    const uint64_t old = state_;
    state_ = old * 6364136223846793005ull + inc_;
    const auto xorshifted = static_cast<uint32_t>(((old >> 18u) ^ old) >> 27u);
    const auto rot = static_cast<uint32_t>(old >> 59u);
    return (xorshifted >> rot) | (xorshifted << ((32u - rot) & 31u));
  }
  // Uniform in [0, 1).
  float next_float() { return static_cast<float>(next_u32() >> 8) * 0x1p-24f; }
  // Uniform in [0, n); n > 0. [Lemire 2019, without the rejection: bias below 2^-32·n]
  uint32_t next_below(uint32_t n) { return static_cast<uint32_t>((static_cast<uint64_t>(next_u32()) * n) >> 32); }

 private:
  uint64_t state_, inc_;
};

}  // namespace lumicut
