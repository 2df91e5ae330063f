// Parameters: an integrator declares a struct of them, and describes each member once. A host's texts are parsed and
// checked as they are set; the integrator gets the struct.
#pragma once

#include <any>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "integrators/common_params.h"

namespace lumicut {

enum class ParamType : uint32_t { real = 0, integer = 1, boolean = 2, choice = 3 };

// What hosts are shown.
struct ParamInfo {
  const char *id = "", *label = "", *description = "", *unit = "";
  ParamType type = ParamType::real;
  double minimum = 0, maximum = 0;  // of numbers
  const char* choices = "";         // "a|b|c"
  bool of_virtual_lights = false;   // without effect on a method that uses none
  std::string default_text = "";    // of the member's default
};

// The structs that parameters are members of.
struct ParamValues {
  CommonParams common;
  std::any own;  // the integrator's

  template <typename Struct>
  Struct& of() {
    if constexpr (std::is_same_v<Struct, CommonParams>)
      return common;
    else
      return std::any_cast<Struct&>(own);
  }
  template <typename Struct>
  const Struct& of() const {
    if constexpr (std::is_same_v<Struct, CommonParams>)
      return common;
    else
      return std::any_cast<const Struct&>(own);
  }
};

// A parameter and the member that it sets.
struct Param : ParamInfo {
  void (*write)(ParamValues& values, double value) = nullptr;  // a number; 0 or 1; which of the choices
  std::string (*text)(const ParamValues& values, const ParamInfo& info) = nullptr;
};

// An integrator's parameters, and its struct with its defaults.
struct ParamTable {
  std::vector<Param> params;
  std::any own;
};

// Values of one integrator's parameters. The table outlives them.
class Params {
 public:
  explicit Params(const ParamTable& table);
  std::span<const Param> table() const { return table_->params; }
  // Throws Error naming parameter, value and what is allowed; then nothing has changed.
  void set(const std::string& name, const std::string& value);
  // As it was set. nullptr: no such parameter.
  const std::string* text(const std::string& name) const;
  // nullptr: no such parameter.
  const ParamInfo* find(const std::string& name) const;

  const ParamValues& values() const { return values_; }
  const CommonParams& common() const { return values_.common; }
  // The integrator's struct.
  template <typename Own>
  const Own& own() const {
    return values_.of<Own>();
  }
  // The same with other common ones.
  Params with(const CommonParams& common) const;
  // All, "name=value" a line.
  std::string all_texts() const;

 private:
  size_t index(const std::string& name) const;  // table().size(): none

  const ParamTable* table_;
  ParamValues values_;
  std::vector<std::string> texts_;
};

// Description of the member that a pointer to it names: number<&LightcutsParams::error>("error", ...).
template <auto Member>
struct ParamOf : Param {};

template <auto Member>
ParamOf<Member> number(const char* id, const char* label, const char* description, const char* unit, double minimum,
                       double maximum);
template <auto Member>
ParamOf<Member> flag(const char* id, const char* label, const char* description, const char* unit = "");
// `choices`: "a|b|c", in the order of the enumerators.
template <auto Member>
ParamOf<Member> choice(const char* id, const char* label, const char* description, const char* unit,
                       const char* choices);

// Table of a struct, whose members it describes: each once, or it does not compile.
template <auto... Members>
ParamTable describe(const ParamOf<Members>&... params);

}  // namespace lumicut

#include "integrators/params-inl.h"
