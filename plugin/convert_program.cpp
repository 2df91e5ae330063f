#include "plugin/convert_program.h"

#include <cmath>
#include <cstring>

#include "core/error.h"
#include "plugin/check.h"
#include "plugin/program_descriptors.h"

namespace lumicut {

namespace {

static_assert(LUMICUT_OP_UV == static_cast<uint32_t>(ProgramOp::uv) &&
              LUMICUT_OP_MAP_RANGE == static_cast<uint32_t>(ProgramOp::map_range) &&
              LUMICUT_OP_FRESNEL == static_cast<uint32_t>(ProgramOp::fresnel) &&
              LUMICUT_OP_NOISE == static_cast<uint32_t>(ProgramOp::noise) &&
              LUMICUT_OP_IMAGE == static_cast<uint32_t>(ProgramOp::image));

constexpr uint32_t kMostNumbers = 1u << 24;  // of constants or a table

}  // namespace

TextureProgram to_program(const lumicut_program* given, uint64_t texture) {
  const lumicut_program in = read(given);
  const std::string owner = "lumicut_texture[" + number_text(texture) + "].program";
  const auto array = [&](const char* name, const auto* values, uint64_t count) {
    using T = std::remove_cvref_t<decltype(*values)>;
    if (count > 0 && values == nullptr)
      fail_argument(owner + "." + name + ": is NULL, but its count is " + number_text(count));
    if (count > kMostNumbers) fail_argument(owner + "." + name + ": " + number_text(count) + " are too many");
    return std::vector<T>(values, values + count);
  };
  if (in.instruction_count > TextureProgram::kMostInstructions)
    fail_argument(owner + ".instruction_count: " + number_text(uint64_t{in.instruction_count}) + " is more than " +
                  number_text(uint64_t{TextureProgram::kMostInstructions}));
  std::vector<ProgramInstruction> instructions;
  for (const lumicut_instruction& i : array("instructions", in.instructions, in.instruction_count)) {
    ProgramInstruction out;
    out.op = i.op, out.mode = i.mode, out.data = i.data, out.count = i.count;
    std::memcpy(out.inputs, i.inputs, sizeof(out.inputs));
    if (i.op == LUMICUT_OP_IMAGE) {
      if (i.data == 0)
        fail_argument(owner + ".instructions[" + number_text(uint64_t{instructions.size()}) +
                      "].data: 0 is no texture; 1 is the first");
      --out.data;
    }
    instructions.push_back(out);
  }
  const auto numbers = array("constants", in.constants, uint64_t{3} * in.constant_count);
  std::vector<Vec3f> constants(in.constant_count);
  for (size_t i = 0; i < constants.size(); ++i) constants[i] = {numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]};
  try {
    return {std::move(instructions), std::move(constants), array("table", in.table, in.table_count)};
  } catch (const Error& error) {
    const std::string text = error.what();
    if (text.rfind(owner, 0) == 0) throw;
    throw Error(error.code(), owner + "." + text);
  }
}

std::vector<MeshAttribute> to_attributes(const lumicut_mesh& in) {
  std::vector<MeshAttribute> out;
  if (in.attribute_count == 0) return out;
  if (in.attributes == nullptr)
    fail_argument("lumicut_mesh.attributes: is NULL, but attribute_count is " + number_text(in.attribute_count));
  if (in.attribute_count > 256)
    fail_argument("lumicut_mesh.attribute_count: " + number_text(in.attribute_count) + " is more than 256");
  const auto all = read_array(in.attributes, in.attribute_count);
  for (size_t i = 0; i < all.size(); ++i) {
    const FieldValidator c("lumicut_attribute", i);
    c.integer("domain", all[i].domain, LUMICUT_OF_VERTICES, LUMICUT_OF_INSTANCES);
    if (all[i].components != 12 || all[i].domain != LUMICUT_OF_INSTANCES)
      c.integer("components", all[i].components, 1, 4);
    const uint64_t places = all[i].domain == LUMICUT_OF_VERTICES    ? in.vertex_count
                            : all[i].domain == LUMICUT_OF_TRIANGLES ? in.triangle_count
                                                                    : std::max<uint64_t>(1, in.transform_count);
    if (all[i].values == nullptr && places > 0) c.fail("values", "is NULL");
    for (const MeshAttribute& other : out)
      if (other.id == all[i].id) c.fail("id", number_text(uint64_t{all[i].id}) + " is that of an earlier one");
    MeshAttribute a;
    a.id = all[i].id, a.components = all[i].components, a.domain = static_cast<AttributeDomain>(all[i].domain);
    if (places > 0) a.values.assign(all[i].values, all[i].values + places * a.components);
    // What only shades is mended, as coordinates are.
    for (float& v : a.values)
      if (!std::isfinite(v)) v = 0.0f;
    out.push_back(std::move(a));
  }
  return out;
}

}  // namespace lumicut
