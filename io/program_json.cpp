#include "io/program_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <optional>

#include "io/binary_block.h"
#include "io/file_error.h"

namespace lumicut::io {

namespace {

struct Op {
  std::string name;
  uint32_t inputs, modes;
};

// In the order of LUMICUT_OP_...
const std::vector<Op> kOps = {
    {"uv", 0, 1},        {"attribute", 0, 2}, {"position", 0, 1},    {"normal", 0, 2},     {"to_viewer", 0, 1},
    {"behind", 0, 1},    {"camera", 0, 4},    {"transform", 1, 3},   {"math", 3, 41},      {"vector", 3, 27},
    {"grey", 1, 2},      {"separate", 1, 3},  {"combine", 3, 1},     {"clamp", 3, 2},      {"map_range", 6, 16},
    {"mapping", 4, 4},   {"rotate", 4, 10},   {"mix", 3, 19},        {"color", 4, 7},      {"ramp", 1, 2},
    {"curves", 2, 2},    {"fresnel", 2, 3},   {"bump", 5, 1},        {"normal_map", 2, 2}, {"noise", 8, 80},
    {"musgrave", 7, 20}, {"voronoi", 5, 320}, {"wave", 6, 24},       {"magic", 2, 11},     {"brick", 6, 1},
    {"checker", 1, 1},   {"gradient", 1, 7},  {"white_noise", 2, 8}, {"project", 1, 4},    {"image", 3, 8}};

std::vector<std::string> names_of_ops() {
  std::vector<std::string> names;
  for (const Op& op : kOps) names.push_back(op.name);
  return names;
}

constexpr double kLargest = 3e38;

class ProgramReader {
 public:
  ProgramReader(const std::function<uint32_t(const std::string&)>& attribute,
                const std::function<int32_t(const JsonValue&)>& image)
      : attribute_(attribute), image_(image) {}

  Program read(const JsonValue& value) {
    for (const auto& element : value.elements()) instruction(element);
    return std::move(program_);
  }

 private:
  void instruction(const JsonValue& value) {
    JsonObject object(value);
    lumicut_instruction out{};
    static const std::vector<std::string> names = names_of_ops();
    out.op = static_cast<uint32_t>(object.need("op").choice(names));
    const Op& op = kOps[out.op];
    out.mode = static_cast<uint32_t>(object.integer("mode", 0, 0, int64_t{op.modes} - 1));
    size_t given = 0;
    if (auto inputs = object.find("inputs")) {
      const auto elements = inputs->elements();
      if (elements.size() > op.inputs)
        inputs->fail_expected(fmt::format("an array of at most {}, the inputs of {}", op.inputs, op.name));
      for (const auto& element : elements) out.inputs[given++] = input(element);
    }
    while (given < op.inputs) out.inputs[given++] = constant({});
    if (auto table = object.find("table")) {
      out.data = static_cast<uint32_t>(program_.table.size());
      for (const auto& number : table->elements())
        program_.table.push_back(static_cast<float>(number.number(-kLargest, kLargest)));
      out.count = static_cast<uint32_t>(program_.table.size()) - out.data;
    }
    if (auto name = object.find("attribute")) {
      if (out.count != 0) name->fail("stands beside a \"table\"");
      out.data = attribute_(name->text());
    } else if (out.op == LUMICUT_OP_ATTRIBUTE) {
      object.need("attribute");
    }
    if (auto image = object.find("image")) {
      if (out.op != LUMICUT_OP_IMAGE) image->fail("stands in a step that is no image");
      out.data = static_cast<uint32_t>(image_(*image));
    }
    object.finish();
    program_.instructions.push_back(out);
  }

  // An integer is an earlier instruction, an array of one or three numbers a constant.
  int32_t input(const JsonValue& value) {
    if (!value.raw().is_array())
      return static_cast<int32_t>(value.integer(0, static_cast<int64_t>(program_.instructions.size()) - 1));
    const size_t n = value.raw().size();
    if (n != 1 && n != 3) value.fail_expected("an instruction's number, or an array of one number or three");
    const auto given = value.numbers(n, -kLargest, kLargest);
    return constant({static_cast<float>(given[0]), static_cast<float>(given[n == 1 ? 0 : 1]),
                     static_cast<float>(given[n == 1 ? 0 : 2])});
  }

  int32_t constant(const std::array<float, 3>& value) {
    program_.constants.insert(program_.constants.end(), value.begin(), value.end());
    return -static_cast<int32_t>(program_.constants.size() / 3);
  }

  const std::function<uint32_t(const std::string&)>& attribute_;
  const std::function<int32_t(const JsonValue&)>& image_;
  Program program_;
};

std::vector<float> floats_of(const std::string& path, const std::optional<uint64_t>& offset, uint64_t most) {
  const std::string bytes =
      offset ? read_part(path, *offset, most * sizeof(float)) : read_whole_file(path, most * sizeof(float));
  if (bytes.size() % sizeof(float) != 0)
    throw FileError(path, fmt::format("has {} bytes, no multiple of 4", bytes.size()));
  std::vector<float> out(bytes.size() / sizeof(float));
  static_assert(std::endian::native == std::endian::little);
  if (!out.empty()) std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}

}  // namespace

Program read_program(const JsonValue& value, const std::function<uint32_t(const std::string&)>& attribute,
                     const std::function<int32_t(const JsonValue&)>& image) {
  return ProgramReader(attribute, image).read(value);
}

nlohmann::ordered_json program_json(const Program& program, const std::function<std::string(uint32_t)>& attribute,
                                    const std::function<nlohmann::ordered_json(uint32_t)>& image) {
  using Json = nlohmann::ordered_json;
  Json steps = Json::array();
  for (const lumicut_instruction& from : program.instructions) {
    const Op& op = kOps.at(from.op);
    Json step{{"op", op.name}};
    if (from.mode != 0) step["mode"] = from.mode;
    for (size_t i = 0; i < op.inputs; ++i) {
      const int32_t input = from.inputs[i];
      if (input >= 0) {
        step["inputs"].push_back(input);
        continue;
      }
      const float* c = &program.constants.at(3 * static_cast<size_t>(-1 - input));
      step["inputs"].push_back(Json{double{c[0]}, double{c[1]}, double{c[2]}});
    }
    for (uint32_t i = 0; i < from.count; ++i) step["table"].push_back(double{program.table.at(from.data + i)});
    if (from.op == LUMICUT_OP_ATTRIBUTE || (from.op == LUMICUT_OP_TRANSFORM && from.count == 0) ||
        (from.op == LUMICUT_OP_NORMAL_MAP && from.mode == 1))
      step["attribute"] = attribute(from.data);
    if (from.op == LUMICUT_OP_IMAGE) step["image"] = image(from.data);
    steps.push_back(std::move(step));
  }
  return steps;
}

std::vector<Attribute> read_attributes(const JsonValue& value, const Mesh& mesh, size_t instances,
                                       const std::function<uint32_t(const std::string&)>& attribute,
                                       const std::function<std::string(const JsonValue&)>& resolve) {
  std::vector<Attribute> out;
  for (const auto& element : value.elements()) {
    JsonObject object(element);
    Attribute a;
    a.id = attribute(object.need("name").text());
    a.domain = static_cast<uint32_t>(object.need("domain").choice({"vertices", "triangles", "instances"}));
    a.components = static_cast<uint32_t>(object.need("components").integer(1, 12));
    const size_t places = a.domain == LUMICUT_OF_VERTICES    ? mesh.positions.size() / 3
                          : a.domain == LUMICUT_OF_TRIANGLES ? mesh.indices.size() / 3
                                                             : instances;
    const auto file = object.find("file");
    const auto values = file ? *file : object.need("values");
    if (file) {
      std::optional<uint64_t> offset;
      if (const auto given = object.find("offset")) offset = static_cast<uint64_t>(given->integer(0, int64_t{1} << 53));
      a.values = floats_of(resolve(*file), offset, uint64_t{places} * a.components);
    } else {
      for (const auto& number : values.elements())
        a.values.push_back(static_cast<float>(number.number(-kLargest, kLargest)));
    }
    if (a.values.size() != places * a.components)
      values.fail(fmt::format("holds {} numbers for {} {} of {} components", a.values.size(), places,
                              object.need("domain").text(), a.components));
    if (std::any_of(out.begin(), out.end(), [&](const Attribute& other) { return other.id == a.id; }))
      object.need("name").fail("stands here already");
    object.finish();
    out.push_back(std::move(a));
  }
  return out;
}

}  // namespace lumicut::io
