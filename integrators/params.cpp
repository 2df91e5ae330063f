#include "integrators/params.h"

#include <charconv>
#include <cmath>
#include <string_view>

#include "core/error.h"

namespace lumicut {

namespace {

// The place of a value among "a|b|c"; false: it is none.
bool find_choice(std::string_view choices, std::string_view value, double& index) {
  for (size_t i = 0;; ++i) {
    const size_t end = choices.find('|');
    if (!value.empty() && choices.substr(0, end) == value) {
      index = static_cast<double>(i);
      return true;
    }
    if (end == std::string_view::npos) return false;
    choices.remove_prefix(end + 1);
  }
}

bool parse_number(const std::string& text, double& out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc{} && end == text.data() + text.size();
}

double parse(const ParamInfo& p, const std::string& value) {
  const auto fail = [&](const std::string& why) { fail_argument(std::string("parameter ") + p.id + ": " + why); };
  double number = 0;
  if (p.type == ParamType::choice) {
    if (!find_choice(p.choices, value, number)) fail("\"" + value + "\" is not one of " + p.choices);
  } else if (p.type == ParamType::boolean) {
    if (value == "true" || value == "1" || value == "on" || value == "yes")
      number = 1;
    else if (!(value == "false" || value == "0" || value == "off" || value == "no"))
      fail("\"" + value + "\" is neither true nor false");
  } else {
    if (!parse_number(value, number) || !std::isfinite(number)) fail("\"" + value + "\" is not a number");
    if (p.type == ParamType::integer && number != std::floor(number)) fail(value + " is not a whole number");
    if (number < p.minimum || number > p.maximum)
      fail(value + " is not in [" + number_text(p.minimum) + ", " + number_text(p.maximum) + "]");
  }
  return number;
}

}  // namespace

std::string param_detail::choice_text(const char* choices, size_t index) {
  std::string_view left = choices;
  for (; index > 0; --index) left.remove_prefix(left.find('|') + 1);
  return std::string(left.substr(0, left.find('|')));
}

Params::Params(const ParamTable& table) : table_(&table), values_{{}, table.own} {
  for (const Param& p : table.params) texts_.push_back(p.default_text);
}

size_t Params::index(const std::string& name) const {
  size_t i = 0;
  while (i < table().size() && name != table()[i].id) ++i;
  return i;
}

const ParamInfo* Params::find(const std::string& name) const {
  const size_t i = index(name);
  return i < table().size() ? &table()[i] : nullptr;
}

void Params::set(const std::string& name, const std::string& value) {
  const size_t i = index(name);
  if (i == table().size()) {
    std::string known;
    for (const Param& q : table()) known += (known.empty() ? "" : ", ") + std::string(q.id);
    fail_argument("no parameter \"" + name + "\"; there are: " + known);
  }
  const Param& p = table()[i];
  const double number = parse(p, value);
  texts_[i] = p.type != ParamType::boolean ? value : number != 0 ? "1" : "0";
  p.write(values_, number);
}

const std::string* Params::text(const std::string& name) const {
  const size_t i = index(name);
  return i < texts_.size() ? &texts_[i] : nullptr;
}

Params Params::with(const CommonParams& common) const {
  Params out = *this;
  out.values_.common = common;
  for (size_t i = 0; i < texts_.size(); ++i)
    if (std::string now = table()[i].text(out.values_, table()[i]); now != table()[i].text(values_, table()[i]))
      out.texts_[i] = std::move(now);
  return out;
}

std::string Params::all_texts() const {
  std::string out;
  for (size_t i = 0; i < texts_.size(); ++i) out += std::string(table()[i].id) + "=" + texts_[i] + "\n";
  return out;
}

}  // namespace lumicut
