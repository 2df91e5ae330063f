// Texture programs in scene files, and what meshes bring for them. [docs/scene_format.md]
#pragma once

#include <functional>

#include "io/json_reader.h"
#include "io/scene_data.h"

namespace lumicut::io {

// `value`: the list of its steps. `attribute`: number of an attribute's name; `image`: 1 + index of an image that an instruction names.
Program read_program(const JsonValue& value, const std::function<uint32_t(const std::string&)>& attribute,
                     const std::function<int32_t(const JsonValue&)>& image);

// The list of steps that is read as `program`.
nlohmann::ordered_json program_json(const Program& program, const std::function<std::string(uint32_t)>& attribute,
                                    const std::function<nlohmann::ordered_json(uint32_t)>& image);

// `resolve`: the path of a file that the value names.
std::vector<Attribute> read_attributes(const JsonValue& value, const Mesh& mesh, size_t instances,
                                       const std::function<uint32_t(const std::string&)>& attribute,
                                       const std::function<std::string(const JsonValue&)>& resolve);

}  // namespace lumicut::io
