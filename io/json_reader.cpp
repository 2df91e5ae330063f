#include "io/json_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "io/file_error.h"
#include "io/text_lines.h"

namespace lumicut::io {

using nlohmann::json;

namespace {

constexpr size_t kMaxDepth = 64;

std::string shown(const json& value) {
  if (value.is_object()) return value.empty() ? "{}" : "an object";
  std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string range_text(double minimum, double maximum) {
  if (minimum == -kInfinity && maximum == kInfinity) return "a number";
  if (maximum == kInfinity) return fmt::format("a number of at least {}", minimum);
  if (minimum == -kInfinity) return fmt::format("a number of at most {}", maximum);
  return fmt::format("a number from {} to {}", minimum, maximum);
}

// Refuses keys that stand twice, and what would overflow the stack. A pass of its own: the parser with a callback looks at
// all of an array's elements once for each.
class Watch final : public nlohmann::json_sax<json> {
 public:
  explicit Watch(const std::string& file) : file_(file) {}
  bool null() override { return enter(); }
  bool boolean(bool) override { return enter(); }
  bool number_integer(number_integer_t) override { return enter(); }
  bool number_unsigned(number_unsigned_t) override { return enter(); }
  bool number_float(number_float_t, const string_t&) override { return enter(); }
  bool string(string_t&) override { return enter(); }
  bool binary(binary_t&) override { return enter(); }
  bool start_object(size_t) override { return open(); }
  bool end_object() override { return close(); }
  bool start_array(size_t) override { return open(); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    enter();
    if (!keys_.back().insert(name).second)
      throw FileError(file_, fmt::format("the key {} stands twice in one object", shown(json(name))));
    return true;
  }
  // The parser tells it.
  bool parse_error(size_t, const std::string&, const nlohmann::detail::exception&) override { return false; }

 private:
  bool enter() const {
    if (keys_.size() > kMaxDepth) throw FileError(file_, fmt::format("is nested deeper than {} levels", kMaxDepth));
    return true;
  }
  bool open() {
    enter();
    keys_.emplace_back();
    return true;
  }
  bool close() {
    keys_.pop_back();
    return true;
  }
  const std::string& file_;
  std::vector<std::set<std::string>> keys_;  // of the objects that are open; of arrays none
};

}  // namespace

std::string nearest_word(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  size_t best_distance = std::max<size_t>(2, word.size() / 3) + 1;
  if (word.size() > 100) return best;
  for (const auto& candidate : known) {
    const size_t distance = edit_distance(word, candidate);
    if (distance < best_distance) best_distance = distance, best = candidate;
  }
  return best;
}

template <typename Json>
Json parse_json(const std::string& text, const std::string& file) {
  const auto place = [&](size_t end) {
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
    const size_t line_start = end == 0 ? std::string::npos : text.rfind('\n', end - 1);
    return fmt::format("line {}, column {}", line, line_start == std::string::npos ? end + 1 : end - line_start);
  };
  refuse_utf16(text, file);
  if (const size_t zero = text.find('\0'); zero != std::string::npos)  // the parser would end there
    throw FileError(file, fmt::format("{}: not JSON: a zero byte", place(zero)));
  try {
    Watch watch(file);
    json::sax_parse(text, &watch);
    return Json::parse(text);
  } catch (const json::parse_error& error) {
    const size_t end = std::min(text.size(), error.byte > 0 ? error.byte - 1 : 0);
    std::string what = error.what();
    if (const size_t colon = what.find(": "); colon != std::string::npos) what = what.substr(colon + 2);
    throw FileError(file, fmt::format("{}: not JSON: {}", place(end), what));
  } catch (const json::exception& error) {  // such as a number beyond the range of double
    throw FileError(file, fmt::format("not readable as JSON: {}", error.what()));
  }
}
template json parse_json(const std::string&, const std::string&);
template nlohmann::ordered_json parse_json(const std::string&, const std::string&);

void JsonValue::fail(const std::string& text) const {
  throw FileError(file_, path_.empty() ? text : path_ + ": " + text);
}

void JsonValue::fail_expected(const std::string& expected) const {
  fail(fmt::format("is {}, but must be {}", shown(*value_), expected));
}

double JsonValue::number(double minimum, double maximum) const {
  if (!value_->is_number()) fail_expected(range_text(minimum, maximum));
  const double number = value_->get<double>();
  // Everything ends as float in the library.
  if (!std::isfinite(number) || std::abs(number) > 3.4e38 || number < minimum || number > maximum)
    fail_expected(range_text(minimum, maximum));
  return number;
}

int64_t JsonValue::integer(int64_t minimum, int64_t maximum) const {
  const std::string expected = fmt::format("a whole number from {} to {}", minimum, maximum);
  if (!value_->is_number_integer()) fail_expected(expected);
  if (value_->is_number_unsigned() && value_->get<uint64_t>() > static_cast<uint64_t>(INT64_MAX))
    fail_expected(expected);
  const auto number = value_->get<int64_t>();
  if (number < minimum || number > maximum) fail_expected(expected);
  return number;
}

bool JsonValue::boolean() const {
  if (!value_->is_boolean()) fail_expected("true or false");
  return value_->get<bool>();
}

std::string JsonValue::text() const {
  if (!value_->is_string()) fail_expected("a text");
  auto text = value_->get<std::string>();
  if (text.find('\0') != std::string::npos) fail("must not hold a zero byte");
  return text;
}

size_t JsonValue::choice(const std::vector<std::string>& choices) const {
  const std::string word = value_->is_string() ? value_->get<std::string>() : "";
  const auto at = std::find(choices.begin(), choices.end(), word);
  if (at == choices.end()) fail_expected(fmt::format("one of {}", fmt::join(choices, ", ")));
  return static_cast<size_t>(at - choices.begin());
}

std::vector<double> JsonValue::numbers(size_t count, double minimum, double maximum) const {
  if (!value_->is_array() || value_->size() != count) fail_expected(fmt::format("an array of {} numbers", count));
  std::vector<double> result;
  for (const auto& element : elements()) result.push_back(element.number(minimum, maximum));
  return result;
}

std::array<double, 3> JsonValue::vector3(double minimum, double maximum) const {
  const auto n = numbers(3, minimum, maximum);
  return {n[0], n[1], n[2]};
}

std::vector<JsonValue> JsonValue::elements() const {
  if (!value_->is_array()) fail_expected("an array");
  std::vector<JsonValue> result;
  result.reserve(value_->size());
  for (size_t i = 0; i < value_->size(); ++i) result.emplace_back((*value_)[i], file_, fmt::format("{}[{}]", path_, i));
  return result;
}

JsonObject::JsonObject(const JsonValue& value) : value_(value) {
  if (!value.raw().is_object()) value.fail_expected("an object { ... }");
}

std::optional<JsonValue> JsonObject::find(const std::string& key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  const auto at = value_.raw().find(key);
  if (at == value_.raw().end()) return std::nullopt;
  return JsonValue(*at, value_.file(), value_.path().empty() ? key : value_.path() + "." + key);
}

JsonValue JsonObject::need(const std::string& key) {
  auto found = find(key);
  if (!found) {
    // A misspelt key is more likely than a forgotten one.
    for (const auto& item : value_.raw().items())
      if (nearest_word(item.key(), {key}) == key && item.key() != key)
        value_.fail(fmt::format("needs the key \"{}\" (is \"{}\" misspelt?)", key, item.key()));
    value_.fail(fmt::format("needs the key \"{}\"", key));
  }
  return *found;
}

double JsonObject::number(const std::string& key, double otherwise, double minimum, double maximum) {
  const auto found = find(key);
  return found ? found->number(minimum, maximum) : otherwise;
}
int64_t JsonObject::integer(const std::string& key, int64_t otherwise, int64_t minimum, int64_t maximum) {
  const auto found = find(key);
  return found ? found->integer(minimum, maximum) : otherwise;
}
bool JsonObject::boolean(const std::string& key, bool otherwise) {
  const auto found = find(key);
  return found ? found->boolean() : otherwise;
}
std::string JsonObject::text(const std::string& key, const std::string& otherwise) {
  const auto found = find(key);
  return found ? found->text() : otherwise;
}
std::array<double, 3> JsonObject::vector3(const std::string& key, const std::array<double, 3>& otherwise,
                                          double minimum, double maximum) {
  const auto found = find(key);
  return found ? found->vector3(minimum, maximum) : otherwise;
}

void JsonObject::finish() const {
  for (const auto& item : value_.raw().items()) {
    if (std::find(known_.begin(), known_.end(), item.key()) != known_.end()) continue;
    const std::string near = nearest_word(item.key(), known_);
    value_.fail(fmt::format("unknown key {}{}", shown(json(item.key())),
                            near.empty() ? fmt::format("; known are {}", fmt::join(known_, ", "))
                                         : fmt::format("; did you mean \"{}\"?", near)));
  }
}

}  // namespace lumicut::io
