// What tinygltf passes over in the JSON of a glTF file is found here first: values of a wrong type, numbers of elements
// that are not there, nodes of two parents, files that are pipes, nesting that its parser would end at.
#pragma once

#include <string>

namespace lumicut::io {

// `bytes` are the file `path`, text or binary. Throws FileError, which names the place: "nodes[3].mesh".
void check_gltf_document(const std::string& path, const std::string& bytes);

inline bool is_binary_gltf(const std::string& bytes) { return bytes.compare(0, 4, "glTF") == 0; }

// Where a file lies that a glTF in `folder` names.
std::string gltf_file(const std::string& folder, const std::string& uri);

}  // namespace lumicut::io
