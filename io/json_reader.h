// Strict reading of JSON: what is missing, of a wrong type, out of range or unknown is an error that names the file,
// the path of the key (lights[3].color) and the value.
#pragma once

#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace lumicut::io {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Parses `text`; syntax errors name the line and column. Duplicate keys and nesting beyond 64 levels are errors.
template <typename Json = nlohmann::json>
Json parse_json(const std::string& text, const std::string& file);
extern template nlohmann::json parse_json(const std::string&, const std::string&);
extern template nlohmann::ordered_json parse_json(const std::string&, const std::string&);

// The text of `json`; bytes that are no UTF-8, which paths may hold, come out as U+FFFD.
template <typename Json>
std::string json_text(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

// A value that knows where it stands.
class JsonValue {
 public:
  JsonValue(const nlohmann::json& value, std::string file, std::string path)
      : value_(&value), file_(std::move(file)), path_(std::move(path)) {}

  const nlohmann::json& raw() const { return *value_; }
  const std::string& path() const { return path_; }
  const std::string& file() const { return file_; }
  // Throws FileError("file: path: text").
  [[noreturn]] void fail(const std::string& text) const;
  // Throws "path: is <value>, but must be <expected>".
  [[noreturn]] void fail_expected(const std::string& expected) const;

  double number(double minimum = -kInfinity, double maximum = kInfinity) const;
  int64_t integer(int64_t minimum, int64_t maximum) const;
  bool boolean() const;
  std::string text() const;
  // One of `choices`; returns its index.
  size_t choice(const std::vector<std::string>& choices) const;
  // Exactly `count` numbers.
  std::vector<double> numbers(size_t count, double minimum = -kInfinity, double maximum = kInfinity) const;
  std::array<double, 3> vector3(double minimum = -kInfinity, double maximum = kInfinity) const;
  // Elements of an array.
  std::vector<JsonValue> elements() const;

 private:
  const nlohmann::json* value_;
  std::string file_, path_;
};

// An object whose keys are all asked for by name; `finish` refuses those that nobody asked for.
class JsonObject {
 public:
  explicit JsonObject(const JsonValue& value);
  const JsonValue& value() const { return value_; }

  std::optional<JsonValue> find(const std::string& key);
  JsonValue need(const std::string& key);
  bool has(const std::string& key) { return find(key).has_value(); }
  double number(const std::string& key, double otherwise, double minimum = -kInfinity, double maximum = kInfinity);
  int64_t integer(const std::string& key, int64_t otherwise, int64_t minimum, int64_t maximum);
  bool boolean(const std::string& key, bool otherwise);
  std::string text(const std::string& key, const std::string& otherwise);
  std::array<double, 3> vector3(const std::string& key, const std::array<double, 3>& otherwise,
                                double minimum = -kInfinity, double maximum = kInfinity);
  // Throws at the first key that was not asked for, with the nearest known one.
  void finish() const;

 private:
  JsonValue value_;
  std::vector<std::string> known_;
};

// The nearest of `known` to `word`, or "" when none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

}  // namespace lumicut::io
