#include "failing_memory.h"

#include <malloc.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>

extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);
}

namespace {

constexpr long kNever = -1;
std::atomic<long> fails_at{kNever}, count{0}, failed{0}, live{0};
std::atomic<bool> fails_on{false}, in_scope{false};

bool fails() {
  const long at = fails_at.load(std::memory_order_relaxed);
  if (at == kNever || !in_scope.load(std::memory_order_relaxed)) return false;
  const long n = count.fetch_add(1, std::memory_order_relaxed);
  if (n != at && !(n > at && fails_on.load(std::memory_order_relaxed))) return false;
  failed.fetch_add(1, std::memory_order_relaxed);
  errno = ENOMEM;
  return true;
}

void* counted(void* block) {
  if (block != nullptr) live.fetch_add(1, std::memory_order_relaxed);
  return block;
}

}  // namespace

namespace failing_memory {

void arm(long n, bool all_after) {
  count = failed = 0, fails_on = all_after;
  fails_at = n;
}
long disarm() {
  fails_at = kNever;
  return failed;
}
long seen() { return count; }
Scope::Scope() { in_scope = true; }
Scope::~Scope() { in_scope = false; }
long live_blocks() { return live; }

}  // namespace failing_memory

#define EXPORTED __attribute__((visibility("default")))
extern "C" {

EXPORTED void* malloc(size_t n) noexcept { return fails() ? nullptr : counted(__libc_malloc(n)); }
EXPORTED void* calloc(size_t n, size_t each) noexcept { return fails() ? nullptr : counted(__libc_calloc(n, each)); }
EXPORTED void* realloc(void* old, size_t n) noexcept {
  if (fails()) return nullptr;
  return old == nullptr ? counted(__libc_malloc(n)) : __libc_realloc(old, n);
}
EXPORTED void* memalign(size_t alignment, size_t n) noexcept {
  return fails() ? nullptr : counted(__libc_memalign(alignment, n));
}
EXPORTED void* aligned_alloc(size_t alignment, size_t n) noexcept { return memalign(alignment, n); }
EXPORTED int posix_memalign(void** block, size_t alignment, size_t n) noexcept {
  void* const made = memalign(alignment, n);
  if (made == nullptr) return ENOMEM;
  *block = made;
  return 0;
}
EXPORTED void free(void* block) noexcept {
  if (block != nullptr) live.fetch_sub(1, std::memory_order_relaxed);
  __libc_free(block);
}

// What oneTBB takes from its own allocator, and takes from here where a program has these.
EXPORTED void* scalable_malloc(size_t n) noexcept { return malloc(n); }
EXPORTED void scalable_free(void* block) noexcept { free(block); }
EXPORTED void* scalable_aligned_malloc(size_t n, size_t alignment) noexcept { return memalign(alignment, n); }
EXPORTED void scalable_aligned_free(void* block) noexcept { free(block); }

EXPORTED void* mmap(void* at, size_t n, int protection, int flags, int file, off_t offset) noexcept {
  if (fails()) return MAP_FAILED;
  return reinterpret_cast<void*>(syscall(SYS_mmap, at, n, protection, flags, file, offset));
}
EXPORTED void* mmap64(void* at, size_t n, int protection, int flags, int file, off_t offset) noexcept {
  return mmap(at, n, protection, flags, file, offset);
}

}  // extern "C"
