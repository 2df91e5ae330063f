// One list of a struct's fields, for all that must not forget one: what a file was made for, and tests that change
// each.
#pragma once

#include <algorithm>
#include <concepts>
#include <string_view>
#include <type_traits>

namespace lumicut {

// Calls visit(name, field) for each; `names` as "a, b, c".
template <typename Visit, typename... Fields>
void visit_fields(Visit& visit, std::string_view names, Fields&... fields) {
  const auto next = [&] {
    const std::string_view name = names.substr(0, names.find(','));
    names.remove_prefix(std::min(names.size(), name.size() + 2));
    return name;
  };
  (visit(next(), fields), ...);
}

// In a struct or class: for_each_field(self, visit) calls visit(name, field) for each of its data members, as declared
// and in that order. One that is missing or too many does not compile.
#define LUMICUT_FIELDS(Type, ...)                                                             \
  _Pragma("GCC diagnostic push")                                                              \
      _Pragma("GCC diagnostic ignored \"-Wshadow\"") template <typename Self, typename Visit> \
  requires std::same_as<std::remove_const_t<Self>, Type>                                      \
  friend void for_each_field(Self& fields_of, Visit&& visit_each) {                           \
    auto& [__VA_ARGS__] = fields_of;                                                          \
    lumicut::visit_fields(visit_each, #__VA_ARGS__, __VA_ARGS__);                             \
  }                                                                                           \
  _Pragma("GCC diagnostic pop")

// Whether a type lists its fields.
template <typename T>
concept HasFields = requires(const T& value) {
  for_each_field(value, [](std::string_view, const auto&) {});
};

}  // namespace lumicut
