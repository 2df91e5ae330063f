// Counts of PLY files, held against the file before assimp takes memory by them or reads on beyond a row.
#pragma once

#include <string>
#include <string_view>

namespace lumicut::io {

// Throws FileError, which names the element and its row, when `bytes` of the file `path` hold fewer rows or numbers than the
// header and the lists promise.
void check_ply(const std::string& path, std::string_view bytes);

}  // namespace lumicut::io
