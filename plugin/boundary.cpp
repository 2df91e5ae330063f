#include "plugin/boundary.h"

#include <pthread.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <stdexcept>
#include <system_error>

namespace lumicut {

namespace {

// Not thread_local: in a library that a host loads while it runs, the C library makes a thread's variables at their
// first use, and aborts where memory is out.
class ErrorTexts {
 public:
  ErrorTexts() : made_(pthread_key_create(&key_, [](void* text) { release(text); }) == 0) {}

  void set(const char* text) noexcept {
    if (!made_) return;
    auto* mine = static_cast<char*>(pthread_getspecific(key_));
    if (mine == nullptr || mine == kNoMemory) {
      mine = static_cast<char*>(std::malloc(kBytes));
      if (pthread_setspecific(key_, mine != nullptr ? mine : kNoMemory) != 0) release(mine), mine = nullptr;
    }
    if (mine != nullptr) std::snprintf(mine, kBytes, "%s", text);
  }
  const char* get() const noexcept {
    const void* const mine = made_ ? pthread_getspecific(key_) : nullptr;
    return mine != nullptr ? static_cast<const char*>(mine) : "";
  }

 private:
  static constexpr size_t kBytes = 1024;
  static inline char kNoMemory[] = "out of memory (there is none for the text of the error either)";
  static void release(void* text) {
    if (text != kNoMemory) std::free(text);
  }

  pthread_key_t key_{};
  const bool made_;
} error_texts;

}  // namespace

void set_last_error(const char* text) noexcept { error_texts.set(text); }
const char* last_error() noexcept { return error_texts.get(); }

lumicut_result report_exception() noexcept {
  try {
    throw;
  } catch (const Error& e) {
    set_last_error(e.what());
    return static_cast<lumicut_result>(e.code());
  } catch (const std::bad_alloc&) {
    set_last_error("out of memory");
    return LUMICUT_OUT_OF_MEMORY;
  } catch (const std::length_error&) {  // a container's own limit
    set_last_error("out of memory: a count is beyond what any memory holds");
    return LUMICUT_OUT_OF_MEMORY;
  } catch (const std::system_error& e) {  // of a thread that could not be started
    set_last_error(e.what());
    return e.code() == std::errc::resource_unavailable_try_again || e.code() == std::errc::not_enough_memory
               ? LUMICUT_OUT_OF_MEMORY
               : LUMICUT_INTERNAL;
  } catch (const std::exception& e) {
    set_last_error(e.what());
    return LUMICUT_INTERNAL;
  } catch (...) {
    set_last_error("an exception of unknown type");
    return LUMICUT_INTERNAL;
  }
}

const char* handle_name(HandleKind kind) {
  switch (kind) {
    case HandleKind::device:
      return "lumicut_device";
    case HandleKind::accel:
      return "lumicut_accel";
    case HandleKind::scene:
      return "lumicut_scene";
    case HandleKind::integrator:
      return "lumicut_integrator";
    case HandleKind::render:
      return "lumicut_render";
  }
  return "lumicut handle";
}

Object& any_object(void* handle, const char* expected) {
  if (handle == nullptr) fail_argument(std::string(expected) + ": is NULL");
  auto* const o = static_cast<Object*>(handle);
  if (reinterpret_cast<uintptr_t>(handle) % alignof(Object) != 0 ||
      o->magic.load(std::memory_order_relaxed) != Object::kMagic)
    fail_argument(std::string(expected) + ": the pointer is no handle of Lumicut's, or was released");
  return *o;
}

void fail_handle_kind(HandleKind is, HandleKind expected) {
  fail_argument(std::string(handle_name(expected)) + ": the handle is a " + handle_name(is));
}

AccessGuard::Hold AccessGuard::read(const char* user) {
  int64_t users = users_.load(std::memory_order_relaxed);
  do {
    if (users >= kWriter) refuse();
  } while (!users_.compare_exchange_weak(users, users + 1, std::memory_order_acquire, std::memory_order_relaxed));
  last_user_.store(user, std::memory_order_relaxed);
  return {this, 1};
}

AccessGuard::Hold AccessGuard::change(const char* user) {
  int64_t nobody = 0;
  if (!users_.compare_exchange_strong(nobody, kWriter, std::memory_order_acquire, std::memory_order_relaxed)) refuse();
  last_user_.store(user, std::memory_order_relaxed);
  return {this, kWriter};
}

void AccessGuard::refuse() const {
  fail_state(std::string(handle_name(kind_)) + ": in use by " + last_user_.load(std::memory_order_relaxed) +
             ", which must end first");
}

void check_struct_size(const std::string& name, uint32_t struct_size) {
  if (struct_size < sizeof(uint32_t) || struct_size > kLargestDescriptor)
    fail_argument(name + ".struct_size: " + std::to_string(struct_size) + " is not in [4, " +
                  std::to_string(kLargestDescriptor) + "]");
}

void check_tail(const std::string& name, const void* descriptor, size_t known, size_t struct_size) {
  const auto* const bytes = static_cast<const unsigned char*>(descriptor);
  for (size_t i = known; i < struct_size; ++i)
    if (bytes[i] != 0)
      fail_unsupported(name + ": a field at byte " + std::to_string(i) + " is set that Lumicut " +
                       lumicut_version(nullptr, nullptr) + " does not know (struct_size is " +
                       std::to_string(struct_size) + ", known are " + std::to_string(known) + ")");
}

}  // namespace lumicut
