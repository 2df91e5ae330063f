#include "scene/light_profile.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <string>

#include "core/error.h"
#include "core/rng.h"

namespace lumicut {

namespace {

constexpr double kPi = std::numbers::pi;

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

namespace {
template <typename Tables>
auto place_of(Tables& tables, uint32_t id) {
  return std::lower_bound(tables.begin(), tables.end(), id,
                          [](const ProfileRef& p, uint32_t name) { return p->id() < name; });
}
}  // namespace

void LightProfiles::add(const ProfileRef& profile) {
  const auto at = place_of(tables_, profile->id());
  if (at == tables_.end() || (*at)->id() != profile->id())
    tables_.insert(at, profile);
  else if (!(**at == *profile))
    throw Error(ErrorCode::unsupported, "two light profiles share one name by chance");
}

const ProfileRef& LightProfiles::hold(uint32_t id) const {
  static const ProfileRef kNone;
  const auto at = place_of(tables_, id);
  return at != tables_.end() && (*at)->id() == id ? *at : kNone;
}

void LightProfiles::prefer(const LightProfiles& other) {
  for (const ProfileRef& profile : other.tables_) {
    const auto at = place_of(tables_, profile->id());
    if (at != tables_.end() && (*at)->id() == profile->id())
      *at = profile;
    else
      tables_.insert(at, profile);
  }
}

}  // namespace lumicut
