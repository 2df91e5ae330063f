// ThreadSanitizer and oneTBB (the tsan preset alone finds this folder). The distribution's library is not instrumented:
// how it orders the threads' memory is not seen, and all that a body reads of its caller would be reported. Here it is
// said once: what stands before a parallel call comes before its bodies, and these before what follows the call. Bodies
// have no order among each other: races between them are found.
#pragma once

#include <utility>

extern "C" {
void __tsan_acquire(void* address);
void __tsan_release(void* address);
}

namespace lumicut::tsan {

class Ordered {
 public:
  Ordered() { __tsan_release(&before_); }
  ~Ordered() { __tsan_acquire(&after_); }
  Ordered(const Ordered&) = delete;
  Ordered& operator=(const Ordered&) = delete;

  template <typename Fn>
  auto body(Fn& fn) {
    // The closure itself lies where the library put it: it is read before the order is known.
    return [ this, &fn ](auto&&... arguments) __attribute__((no_sanitize("thread"))) {
      __tsan_acquire(&before_);
      // Also when the body throws.
      struct Left {
        char* after;
        ~Left() { __tsan_release(after); }
      } const left{&after_};
      return fn(std::forward<decltype(arguments)>(arguments)...);
    };
  }

 private:
  char before_ = 0, after_ = 0;
};

}  // namespace lumicut::tsan
