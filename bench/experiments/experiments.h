// The experiments; each prints its table. False: what it needs is not there.
#pragma once

namespace lumicut::bench {

bool records(const char* scene);
bool separation(const char* scene);
bool face_leaves(const char* mesh);

}  // namespace lumicut::bench
