#include "lights/light_profile.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <mutex>
#include <numbers>
#include <string>

#include "core/error.h"
#include "core/rng.h"
#include "lights/vpl.h"

namespace lumicut {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr size_t kMostProfiles = 4096, kSlots = 16384;

void check_rising(const std::vector<float>& angles, const char* name, double last) {
  for (size_t i = 0; i < angles.size(); ++i) {
    if (!(angles[i] >= -1e-6f && angles[i] <= last + 1e-4))
      fail_argument(std::string("profile ") + name + "[" + std::to_string(i) + "] = " + std::to_string(angles[i]) +
                    " is not in [0, " + std::to_string(last) + "]");
    if (i > 0 && !(angles[i] > angles[i - 1]))
      fail_argument(std::string("profile ") + name + "[" + std::to_string(i) + "] = " + std::to_string(angles[i]) +
                    " does not rise");
  }
}

// ∫ (linear from a to b) sinθ dθ over [t0, t1].
double ring(double a, double b, double t0, double t1) {
  const double slope = (b - a) / (t1 - t0);
  return a * std::cos(t0) - b * std::cos(t1) + slope * (std::sin(t1) - std::sin(t0));
}

// By name, with open addressing. Only a slot of the name that is looked for is read beyond its name, and who looks for
// one holds it: so it stays what it is meanwhile, and looking needs no lock.
struct Slot {
  std::atomic<uint32_t> id{0};
  std::atomic<const LightProfile*> profile{nullptr};
  std::weak_ptr<const LightProfile> held;  // under the mutex
};
constexpr uint32_t kFree = 0, kFreed = 2;  // names are odd

struct Registry {
  std::array<Slot, kSlots> slots;
  std::mutex mutex;
  size_t count = 0;
};
// Never destroyed: profiles go while static objects do.
Registry& registry() {
  static Registry& r = *new Registry;
  return r;
}

Slot* slot_of(uint32_t id) {
  Registry& r = registry();
  for (size_t i = hash64(id) % kSlots, n = 0; n < kSlots; i = (i + 1) % kSlots, ++n) {
    const uint32_t found = r.slots[i].id.load(std::memory_order_acquire);
    if (found == id) return &r.slots[i];
    if (found == kFree) break;
  }
  return nullptr;
}

// The last who held it has let it go; somebody else may have kept one of the same name since.
void forget(const LightProfile* profile) {
  Registry& r = registry();
  {
    const std::lock_guard lock(r.mutex);
    Slot* const slot = slot_of(profile->id());
    if (slot != nullptr && slot->profile.load(std::memory_order_relaxed) == profile) {
      slot->profile.store(nullptr, std::memory_order_relaxed);
      slot->held.reset();
      slot->id.store(kFreed, std::memory_order_release);
      --r.count;
    }
  }
  delete profile;
}

}  // namespace

LightProfile::LightProfile(std::vector<float> vertical, std::vector<float> horizontal, std::vector<float> values)
    : vertical_(std::move(vertical)), horizontal_(std::move(horizontal)), values_(std::move(values)) {
  if (vertical_.size() < 2 || vertical_.size() > 65536)
    fail_argument("profile has " + std::to_string(vertical_.size()) + " vertical angles, not 2 to 65536");
  if (horizontal_.empty() || horizontal_.size() > 65536)
    fail_argument("profile has " + std::to_string(horizontal_.size()) + " horizontal angles, not 1 to 65536");
  if (values_.size() != vertical_.size() * horizontal_.size())
    fail_argument("profile has " + std::to_string(values_.size()) + " values for " + std::to_string(vertical_.size()) +
                  " x " + std::to_string(horizontal_.size()) + " angles");
  check_rising(vertical_, "vertical", kPi);
  check_rising(horizontal_, "horizontal", 2 * kPi);
  if (horizontal_.size() > 1 && (horizontal_[0] > 1e-4f || horizontal_.back() < 2 * kPi - 1e-3))
    fail_argument("profile horizontal angles do not go from 0 to 2 pi");
  for (size_t i = 0; i < values_.size(); ++i)
    if (!(values_[i] >= 0.0f && std::isfinite(values_[i])))
      fail_argument("profile value[" + std::to_string(i) + "] = " + std::to_string(values_[i]) +
                    " is negative or not finite");
  largest_ = *std::max_element(values_.begin(), values_.end());
  if (!(largest_ > 0.0f)) fail_argument("profile values are all 0");
  for (float& v : values_) v /= largest_;

  uint64_t h = hash64(vertical_.size(), horizontal_.size());
  for (const auto* list : {&vertical_, &horizontal_, &values_})
    for (const float f : *list) h = hash64(h, std::bit_cast<uint32_t>(f + 0.0f));
  id_ = static_cast<uint32_t>(h >> 32) | 1u;

  size_t last = 0;  // vertical angle beyond which all is 0
  for (size_t column = 0; column < horizontal_.size(); ++column)
    for (size_t i = 0; i < vertical_.size(); ++i)
      if (value(column, i) > 0.0f) last = std::max(last, std::min(i + 1, vertical_.size() - 1));
  cos_outer_ = std::max(-1.0f, std::cos(vertical_[last]) - 1e-6f);

  cdf_.push_back(0);
  for (size_t column = 0; column < columns(); ++column) {
    const size_t other = horizontal_.size() == 1 ? 0 : column + 1;
    const double width = horizontal_.size() == 1 ? 2 * kPi : double{horizontal_[other]} - horizontal_[column];
    for (size_t i = 0; i + 1 < vertical_.size(); ++i)
      cdf_.push_back(cdf_.back() + width * std::max(0.0, ring(0.5 * (value(column, i) + value(other, i)),
                                                              0.5 * (value(column, i + 1) + value(other, i + 1)),
                                                              vertical_[i], vertical_[i + 1])));
  }
}

float LightProfile::operator()(float vertical, float horizontal) const {
  if (!(vertical >= vertical_.front() - 1e-5f && vertical <= vertical_.back() + 1e-5f)) return 0.0f;
  const auto place = [](const std::vector<float>& angles, float angle, float& t) {
    const auto above = std::upper_bound(angles.begin(), angles.end(), angle) - angles.begin();
    const auto i = static_cast<size_t>(std::clamp<std::ptrdiff_t>(above - 1, 0, std::ssize(angles) - 2));
    t = std::clamp((angle - angles[i]) / (angles[i + 1] - angles[i]), 0.0f, 1.0f);
    return i;
  };
  float tv, th;
  const size_t v = place(vertical_, vertical, tv);
  if (horizontal_.size() == 1) return value(0, v) * (1 - tv) + value(0, v + 1) * tv;
  const size_t h = place(horizontal_, horizontal, th);
  return (value(h, v) * (1 - tv) + value(h, v + 1) * tv) * (1 - th) +
         (value(h + 1, v) * (1 - tv) + value(h + 1, v + 1) * tv) * th;
}

void LightProfile::sample(double u, float v, float w, float& vertical, float& horizontal, float& pdf) const {
  const auto it = std::upper_bound(cdf_.begin() + 1, cdf_.end(), u * cdf_.back());
  size_t cell = std::min<size_t>(static_cast<size_t>(it - cdf_.begin()) - 1, cdf_.size() - 2);
  while (cell > 0 && cdf_[cell + 1] == cdf_[cell]) --cell;
  const size_t rings = vertical_.size() - 1, column = cell / rings, i = cell % rings;
  const float h0 = horizontal_.size() == 1 ? 0.0f : horizontal_[column];
  const float h1 = horizontal_.size() == 1 ? static_cast<float>(2 * kPi) : horizontal_[column + 1];
  // Uniform over the cell's solid angle: z = cosθ, as 1 − z = 2 sin²(θ/2) so that narrow rings keep their digits.
  const auto lid = [](double theta) { return 2 * std::sin(0.5 * theta) * std::sin(0.5 * theta); };
  const double z0 = lid(vertical_[i]), z1 = lid(vertical_[i + 1]);
  const double z = z0 + (z1 - z0) * v;
  vertical = static_cast<float>(2 * std::asin(std::sqrt(std::clamp(0.5 * z, 0.0, 1.0))));
  horizontal = h0 + (h1 - h0) * w;
  const double solid = (z1 - z0) * (double{h1} - h0);
  pdf = static_cast<float>((cdf_[cell + 1] - cdf_[cell]) / (cdf_.back() * solid));
}

ProfileRef keep_profile(LightProfile profile) {
  Registry& r = registry();
  const uint32_t id = profile.id();
  // Made before the lock is taken and freed after it is gone: what frees one takes it too.
  ProfileRef made(new LightProfile(std::move(profile)), forget);
  ProfileRef old;
  const std::lock_guard lock(r.mutex);
  Slot* slot = slot_of(id);
  if (slot != nullptr) {
    old = slot->held.lock();
    if (old != nullptr) {
      if (!(*old == *made)) throw Error(ErrorCode::unsupported, "two light profiles share one name by chance");
      return old;
    }
  } else {
    if (r.count >= kMostProfiles) throw Error(ErrorCode::unsupported, "more than 4096 different light profiles");
    ++r.count;
    size_t i = hash64(id) % kSlots;
    while ((r.slots[i].id.load(std::memory_order_relaxed) & 1u) != 0) i = (i + 1) % kSlots;
    slot = &r.slots[i];
  }
  slot->held = made;
  slot->profile.store(made.get(), std::memory_order_relaxed);
  slot->id.store(id, std::memory_order_release);
  return made;
}

ProfileRef hold_profile(uint32_t id) {
  Registry& r = registry();
  ProfileRef held;
  const std::lock_guard lock(r.mutex);
  if (Slot* const slot = id != 0 ? slot_of(id) : nullptr) held = slot->held.lock();
  return held;
}

float profile_share(const Vpl& v, const Vec3f& direction) {
  const LightProfile* profile = find_profile(v.profile);
  if (profile == nullptr) return 0.0f;
  const Vec3f tangent = v.tangent(), bitangent = cross(tangent, v.normal);
  const float vertical = std::acos(std::clamp(dot(direction, v.normal), -1.0f, 1.0f));
  const float horizontal = std::atan2(dot(direction, bitangent), dot(direction, tangent));
  return (*profile)(vertical, horizontal < 0.0f ? horizontal + static_cast<float>(2 * kPi) : horizontal);
}

const LightProfile* find_profile(uint32_t id) {
  const Slot* const slot = id != 0 ? slot_of(id) : nullptr;
  return slot != nullptr ? slot->profile.load(std::memory_order_acquire) : nullptr;
}

}  // namespace lumicut
