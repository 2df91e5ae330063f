// Work of libraries that cannot be trusted with wrong files, in a process of its own: what breaks there is an error here.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace lumicut::io {

// What `work` returns, run in a child process that has the memory of this one as it is, at most `bytes` more, and at most
// `seconds` of the processor. FileErrors of the work are thrown here; a child that ends otherwise is a FileError about `file`, in which
// `reader` names who broke.
std::string isolated(const std::string& file, const std::string& reader, double seconds, uint64_t bytes,
                     const std::function<std::string()>& work);

}  // namespace lumicut::io
