// Large arrays in huge pages.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <string>
#include <type_traits>

#include "core/error.h"

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace lumicut {

// An array of fixed size, not initialised, in huge pages where possible: where memory is read at random, page walks cost
// as much as cache misses; and memory that threads write first is paid for by each of them.
template <typename T>
class HugeArray {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  HugeArray() = default;
  explicit HugeArray(size_t n) : size_(n) {
    if (n == 0) return;
    const size_t page = n * sizeof(T) >= (size_t{4} << 20) ? size_t{2} << 20 : 256;
    const size_t bytes = (n * sizeof(T) + page - 1) / page * page;
    data_.reset(static_cast<T*>(std::aligned_alloc(page, bytes)));
    if (!data_) throw Error(ErrorCode::out_of_memory, "no memory for an array of " + std::to_string(bytes) + " bytes");
#ifdef __linux__
    if (page > 256) madvise(data_.get(), bytes, MADV_HUGEPAGE);
#endif
  }
  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T& operator[](size_t i) { return data_.get()[i]; }
  const T& operator[](size_t i) const { return data_.get()[i]; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }

 private:
  struct Free {
    void operator()(T* p) const { std::free(p); }
  };
  std::unique_ptr<T, Free> data_;
  size_t size_ = 0;
};

}  // namespace lumicut
