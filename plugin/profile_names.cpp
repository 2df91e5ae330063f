#include "plugin/profile_names.h"

#include <algorithm>
#include <mutex>
#include <vector>

namespace lumicut {

namespace {

struct Names {
  std::mutex mutex;
  std::vector<std::weak_ptr<const LightProfile>> profiles;  // in the order they came
};

Names& names() {
  static Names& all = *new Names;  // never destroyed: a host's static objects may come later
  return all;
}

}  // namespace

ProfileRef shared_profile(LightProfile profile) {
  auto made = std::make_shared<const LightProfile>(std::move(profile));
  Names& all = names();
  const std::lock_guard lock(all.mutex);
  ProfileRef same;
  std::erase_if(all.profiles, [&](const auto& weak) {
    const ProfileRef other = weak.lock();
    if (other != nullptr && other->id() == made->id() && *other == *made) same = other;
    return other == nullptr;
  });
  if (same != nullptr) return same;
  all.profiles.push_back(made);
  return made;
}

ProfileRef named_profile(uint32_t id) {
  Names& all = names();
  const std::lock_guard lock(all.mutex);
  for (size_t i = all.profiles.size(); i-- > 0;)
    if (ProfileRef profile = all.profiles[i].lock(); profile != nullptr && profile->id() == id) return profile;
  return nullptr;
}

}  // namespace lumicut
