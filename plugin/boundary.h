// The border of the library: nothing thrown inside passes it, and nothing a host hands over is trusted before it did.
//   guard          exceptions → code and this thread's text
//   Object, Ref    counted handles that know their kind
//   AccessGuard           who may use an object now, and why not
//   read, write    descriptors of any struct_size (the growth rule in lumicut.h)
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "plugin/include/lumicut/lumicut.h"

namespace lumicut {

// ---- Errors --------------------------------------------------------------------------------------------------------

// This thread's text, freed when the thread ends. Where there is no memory for it, it says so.
void set_last_error(const char* text) noexcept;
const char* last_error() noexcept;

// Sets this thread's text to that of the exception being handled, and gives its code.
lumicut_result report_exception() noexcept;

template <typename Fn>
lumicut_result guard(Fn&& fn) noexcept {
  try {
    fn();
    return LUMICUT_OK;
  } catch (...) {
    return report_exception();
  }
}

[[noreturn]] inline void fail_unsupported(const std::string& text) { throw Error(ErrorCode::unsupported, text); }

// ---- Handles -------------------------------------------------------------------------------------------------------

enum class HandleKind : uint32_t { device, accel, scene, integrator, render };
const char* handle_name(HandleKind kind);

// What every handle points to. Not virtual: the magic number must lie first, whatever the compiler.
struct Object {
  static constexpr uint32_t kMagic = 0x7443754cu, kDead = 0xdeadcu;
  std::atomic<uint32_t> magic{kMagic};
  const HandleKind kind;
  std::atomic<uint32_t> references{1};
  void (*const destroy)(Object*) noexcept;

  Object(HandleKind k, void (*d)(Object*) noexcept) : kind(k), destroy(d) {}
  Object(const Object&) = delete;
  Object& operator=(const Object&) = delete;
};

// T: kKind, and Object as its first base.
template <typename T>
struct ObjectOf : Object {
  ObjectOf() : Object(T::kKind, [](Object* o) noexcept { delete static_cast<T*>(o); }) {}
};

// Throws Error where `handle` is NULL, no handle, or one that was released (as far as its memory still tells).
Object& any_object(void* handle, const char* expected);
[[noreturn]] void fail_handle_kind(HandleKind is, HandleKind expected);

template <typename T>
T& object(T* handle) {
  Object& o = any_object(handle, handle_name(T::kKind));
  if (o.kind != T::kKind) fail_handle_kind(o.kind, T::kKind);
  return static_cast<T&>(o);
}

inline void retain(Object& o) { o.references.fetch_add(1, std::memory_order_relaxed); }
inline void release(Object& o) {
  if (o.references.fetch_sub(1, std::memory_order_acq_rel) != 1) return;
  o.magic.store(Object::kDead, std::memory_order_relaxed);
  o.destroy(&o);
}

// Keeps an object alive.
template <typename T>
class Ref {
 public:
  Ref() = default;
  explicit Ref(T& o) : object_(&o) { retain(o); }
  Ref(const Ref& o) : object_(o.object_) {
    if (object_ != nullptr) retain(*object_);
  }
  Ref(Ref&& o) noexcept : object_(std::exchange(o.object_, nullptr)) {}
  Ref& operator=(Ref o) noexcept {
    std::swap(object_, o.object_);
    return *this;
  }
  ~Ref() {
    if (object_ != nullptr) release(*object_);
  }
  T* operator->() const { return object_; }
  T& operator*() const { return *object_; }
  T* get() const { return object_; }

 private:
  T* object_ = nullptr;
};

// ---- Who may use an object now -------------------------------------------------------------------------------------

// Many readers or one writer. Never waits: what does not fit now is refused with the reason, so that a host's mistake
// in ordering its calls is an error, not a race.
class AccessGuard {
 public:
  explicit AccessGuard(HandleKind kind) : kind_(kind) {}

  class Hold {
   public:
    Hold() = default;
    Hold(Hold&& o) noexcept : gate_(std::exchange(o.gate_, nullptr)), by_(o.by_) {}
    Hold& operator=(Hold&& o) noexcept {
      std::swap(gate_, o.gate_);
      std::swap(by_, o.by_);
      return *this;
    }
    ~Hold() { drop(); }
    void drop() {
      if (gate_ != nullptr) std::exchange(gate_, nullptr)->users_.fetch_sub(by_, std::memory_order_release);
    }

   private:
    friend class AccessGuard;
    Hold(AccessGuard* gate, int64_t by) : gate_(gate), by_(by) {}
    AccessGuard* gate_ = nullptr;
    int64_t by_ = 0;
  };

  // `user` is a string literal for the others' error texts. Throw Error(invalid_state).
  Hold read(const char* user);
  Hold change(const char* user);

 private:
  static constexpr int64_t kWriter = int64_t{1} << 32;
  [[noreturn]] void refuse() const;

  const HandleKind kind_;
  std::atomic<int64_t> users_{0};
  std::atomic<const char*> last_user_{""};
};

// ---- Descriptors ---------------------------------------------------------------------------------------------------

struct FieldSpan {
  size_t offset, size;
};

// name, fields[]: all of T's fields in order (plugin/descriptors.h).
template <typename T>
struct Descriptor;

// Bytes of the fields that end within `struct_size`: a field cut in the middle is not there.
template <typename T>
constexpr size_t covered_bytes(size_t struct_size) {
  size_t covered = 0;
  for (const FieldSpan& f : Descriptor<T>::fields)
    if (f.offset + f.size <= struct_size) covered = f.offset + f.size;
  return covered;
}

// Throws Error. `struct_size` of an existing structure: at least its own four bytes, at most kLargestDescriptor.
inline constexpr uint32_t kLargestDescriptor = 4096;
void check_struct_size(const std::string& name, uint32_t struct_size);
// UNSUPPORTED where a byte in [known, struct_size) is not 0.
void check_tail(const std::string& name, const void* descriptor, size_t known, size_t struct_size);

template <typename T>
T read_at(const void* in, uint32_t struct_size, const std::string& name) {
  check_tail(name, in, sizeof(T), struct_size);
  T out{};
  std::memcpy(static_cast<void*>(&out), in, covered_bytes<T>(struct_size));
  return out;
}

// A whole descriptor; what the host's version lacks is 0.
template <typename T>
T read(const T* in) {
  const std::string name = Descriptor<T>::name;
  if (in == nullptr) fail_argument(name + ": is NULL");
  uint32_t size = 0;
  std::memcpy(&size, in, sizeof(size));
  check_struct_size(name, size);
  return read_at<T>(in, size, name);
}

// An array strided by the first element's struct_size.
template <typename T>
std::vector<T> read_array(const T* in, uint64_t count) {
  const std::string name = Descriptor<T>::name;
  std::vector<T> out;
  if (count == 0) return out;
  if (in == nullptr) fail_argument(name + "s: NULL, but count is " + std::to_string(count));
  if (count > 0xffffffffu) fail_argument(name + "s: count " + std::to_string(count) + " is more than 4294967295");
  uint32_t stride = 0;
  std::memcpy(&stride, in, sizeof(stride));
  check_struct_size(name + "[0]", stride);
  out.reserve(count);
  const auto* bytes = reinterpret_cast<const unsigned char*>(in);
  for (uint64_t i = 0; i < count; ++i, bytes += stride) {
    const auto element = [&] { return name + "[" + std::to_string(i) + "]"; };
    uint32_t size = 0;
    std::memcpy(&size, bytes, sizeof(size));
    if (size != stride)
      fail_argument(element() + ".struct_size: " + std::to_string(size) + " differs from that of the first, " +
                    std::to_string(stride));
    T value{};
    if (stride > sizeof(T)) check_tail(element(), bytes, sizeof(T), stride);
    std::memcpy(static_cast<void*>(&value), bytes, covered_bytes<T>(stride));
    out.push_back(value);
  }
  return out;
}

// Writes the fields that fit, zeroes a tail that this version does not know, and keeps the host's struct_size.
template <typename T>
void write(T* out, const T& value) {
  const std::string name = Descriptor<T>::name;
  if (out == nullptr) fail_argument(name + ": is NULL");
  uint32_t size = 0;
  std::memcpy(&size, out, sizeof(size));
  check_struct_size(name, size);
  auto* bytes = reinterpret_cast<unsigned char*>(out);
  const size_t covered = covered_bytes<T>(size);
  std::memcpy(bytes + sizeof(size), reinterpret_cast<const unsigned char*>(&value) + sizeof(size),
              covered - sizeof(size));
  if (size > sizeof(T)) std::memset(bytes + sizeof(T), 0, size - sizeof(T));
}

}  // namespace lumicut
