// The fields of the descriptors in lumicut_programs.h, as plugin/descriptors.h has those of lumicut.h.
#pragma once

#include "plugin/boundary.h"
#include "plugin/include/lumicut/lumicut_programs.h"

namespace lumicut {

// NOLINTBEGIN(bugprone-sizeof-expression): the sizes of the pointers are meant
template <>
struct Descriptor<lumicut_program> {
  using S = lumicut_program;
  static constexpr const char* name = "lumicut_program";
  static constexpr FieldSpan fields[] = {{offsetof(S, struct_size), sizeof(S::struct_size)},
                                         {offsetof(S, instruction_count), sizeof(S::instruction_count)},
                                         {offsetof(S, constant_count), sizeof(S::constant_count)},
                                         {offsetof(S, table_count), sizeof(S::table_count)},
                                         {offsetof(S, instructions), sizeof(S::instructions)},
                                         {offsetof(S, constants), sizeof(S::constants)},
                                         {offsetof(S, table), sizeof(S::table)}};
};

template <>
struct Descriptor<lumicut_attribute> {
  using S = lumicut_attribute;
  static constexpr const char* name = "lumicut_attribute";
  static constexpr FieldSpan fields[] = {{offsetof(S, struct_size), sizeof(S::struct_size)},
                                         {offsetof(S, id), sizeof(S::id)},
                                         {offsetof(S, components), sizeof(S::components)},
                                         {offsetof(S, domain), sizeof(S::domain)},
                                         {offsetof(S, values), sizeof(S::values)}};
};
// NOLINTEND(bugprone-sizeof-expression)

static_assert(sizeof(lumicut_program) == 40 && sizeof(lumicut_attribute) == 24 && sizeof(lumicut_instruction) == 48);

}  // namespace lumicut
