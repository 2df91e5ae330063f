// How a description is tied to the member it is of. Included by params.h.
#pragma once

#include "core/number_text.h"
#include "integrators/params.h"

namespace lumicut {

namespace param_detail {

template <typename Pointer>
struct MemberOf;
template <typename S, typename T>
struct MemberOf<T S::*> {
  using Struct = S;
  using Type = T;
};
template <auto Member>
using StructOf = typename MemberOf<decltype(Member)>::Struct;
template <auto Member>
using TypeOf = typename MemberOf<decltype(Member)>::Type;

template <auto A, auto B>
consteval bool same() {
  if constexpr (std::is_same_v<decltype(A), decltype(B)>)
    return A == B;
  else
    return false;
}

// No member twice, all of one struct.
template <auto First, auto... Others>
consteval bool distinct() {
  if constexpr (sizeof...(Others) == 0)
    return true;
  else
    return !(same<First, Others>() || ...) && (std::is_same_v<StructOf<First>, StructOf<Others>> && ...) &&
           distinct<Others...>();
}

// How many members a struct has: as many as it can be initialised with.
struct Anything {
  template <typename T>
  constexpr operator T() const;
};
template <typename S, typename... Before>
consteval size_t member_count() {
  if constexpr (requires { S{Before{}..., Anything{}}; })
    return member_count<S, Before..., Anything>();
  else
    return sizeof...(Before);
}

std::string choice_text(const char* choices, size_t index);

template <auto Member>
std::string member_text(const ParamValues& values, const ParamInfo& info) {
  using T = TypeOf<Member>;
  const T& value = values.of<StructOf<Member>>().*Member;
  if constexpr (std::is_enum_v<T>)
    return choice_text(info.choices, static_cast<size_t>(value));
  else if constexpr (std::is_same_v<T, bool>)
    return value ? "1" : "0";
  else if constexpr (std::is_floating_point_v<T>)
    return number_text(value);
  else
    return number_text(uint64_t{value});
}

template <auto Member>
ParamOf<Member> param(const ParamInfo& info) {
  ParamOf<Member> p;
  static_cast<ParamInfo&>(p) = info;
  p.write = [](ParamValues& values, double value) {
    values.of<StructOf<Member>>().*Member = static_cast<TypeOf<Member>>(value);
  };
  p.text = member_text<Member>;
  return p;
}

}  // namespace param_detail

template <auto Member>
ParamOf<Member> number(const char* id, const char* label, const char* description, const char* unit, double minimum,
                       double maximum) {
  using T = param_detail::TypeOf<Member>;
  static_assert(std::is_floating_point_v<T> || (std::is_unsigned_v<T> && !std::is_same_v<T, bool>));
  constexpr ParamType kType = std::is_floating_point_v<T> ? ParamType::real : ParamType::integer;
  return param_detail::param<Member>({id, label, description, unit, kType, minimum, maximum});
}

template <auto Member>
ParamOf<Member> flag(const char* id, const char* label, const char* description, const char* unit) {
  static_assert(std::is_same_v<param_detail::TypeOf<Member>, bool>);
  return param_detail::param<Member>({id, label, description, unit, ParamType::boolean});
}

template <auto Member>
ParamOf<Member> choice(const char* id, const char* label, const char* description, const char* unit,
                       const char* choices) {
  static_assert(std::is_enum_v<param_detail::TypeOf<Member>>);
  return param_detail::param<Member>({id, label, description, unit, ParamType::choice, 0, 0, choices});
}

template <auto... Members>
ParamTable describe(const ParamOf<Members>&... params) {
  static_assert(param_detail::distinct<Members...>(), "a member is described twice, or is of another struct");
  using Struct = std::common_type_t<param_detail::StructOf<Members>...>;
  static_assert(sizeof...(Members) == param_detail::member_count<Struct>(), "a member has no description");
  ParamTable table{{params...}, Struct{}};
  ParamValues defaults;
  defaults.own = table.own;
  for (Param& p : table.params) p.default_text = p.text(defaults, p);
  return table;
}

}  // namespace lumicut
