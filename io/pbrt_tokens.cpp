#include "io/pbrt_tokens.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>

#include "io/file_error.h"
#include "io/find_beside.h"
#include "io/gzip.h"
#include "io/text_lines.h"

namespace lumicut::io {

namespace {

constexpr size_t kDeepest = 64;                     // of files that include each other
constexpr size_t kMostFiles = 20000;                // read, each as often as it is
constexpr uint64_t kMostBytes = uint64_t{4} << 30;  // of all files together

}  // namespace

void PbrtTokens::open(const std::string& path) {
  const auto is_this = [&](const Source& open) { return same_file(*open.path, path); };
  if (std::any_of(files_.begin(), files_.end(), is_this))
    fail(fmt::format("{} includes itself{}", shown(path), *files_.back().path == path ? "" : ", by way of others"));
  if (files_.size() >= kDeepest) fail(fmt::format("files include each other without end: {} deep", kDeepest));
  if (++opened_ > kMostFiles) fail(fmt::format("files include each other without end: more than {}", kMostFiles));
  std::string text = plain_text(unpacked(read_whole_file(path, kMostBytes), kMostBytes, path), path);
  bytes_ += text.size();
  if (bytes_ > kMostBytes) throw FileError(path, "the scene's files are too long together");
  paths_.push_back(path);
  files_.push_back({&paths_.back(), std::move(text), 0, 1});
  if (file_ == nullptr) file_ = &paths_.back();
}

std::string PbrtTokens::where() const { return fmt::format("line {}", line_); }

std::optional<PbrtToken> PbrtTokens::next() {
  auto token = ahead_ ? std::exchange(ahead_, std::nullopt) : find();
  if (token) line_ = token->line, file_ = token->file;
  return token;
}

const std::optional<PbrtToken>& PbrtTokens::peek() {
  if (!ahead_) ahead_ = find();
  return ahead_;
}

void PbrtTokens::fail(const std::string& text) const { throw FileError(file(), fmt::format("{}: {}", where(), text)); }

std::optional<PbrtToken> PbrtTokens::find() {
  while (!files_.empty()) {
    if (auto token = read(files_.back())) return token;
    files_.pop_back();
  }
  return std::nullopt;
}

std::optional<PbrtToken> PbrtTokens::read(Source& s) {
  const std::string& t = s.text;
  while (s.at < t.size()) {
    const char c = t[s.at];
    if (c == '#') {
      while (s.at < t.size() && t[s.at] != '\n') ++s.at;
    } else if (c == ' ' || c == '\t' || c == '\n' || c == '\r') {
      s.line += c == '\n';
      ++s.at;
    } else {
      break;
    }
  }
  if (s.at >= t.size()) return std::nullopt;
  PbrtToken token;
  token.line = s.line, token.file = s.path;
  const auto bad = [&](const char* what) { throw FileError(*s.path, fmt::format("line {}: {}", s.line, what)); };
  if (t[s.at] == '"') {
    token.quoted = true;
    for (++s.at; s.at < t.size() && t[s.at] != '"'; ++s.at) {
      if (t[s.at] == '\n') bad("a text does not end in its line");
      if (t[s.at] == '\\' && s.at + 1 < t.size()) ++s.at;
      token.text += t[s.at];
    }
    if (s.at >= t.size()) bad("a text does not end");
    ++s.at;
  } else if (t[s.at] == '[' || t[s.at] == ']') {
    token.text = t[s.at++];
  } else {
    while (s.at < t.size() && std::strchr(" \t\n\r\"[]#", t[s.at]) == nullptr) token.text += t[s.at++];
  }
  return token;
}

const PbrtParameter* PbrtParameters::find(const std::string& name) const {
  asked_.insert(name);
  for (const PbrtParameter& p : list)
    if (p.name == name) return &p;
  return nullptr;
}
void PbrtParameter::fail(const std::string& text) const {
  throw FileError(*file, fmt::format("line {}: \"{} {}\" {}", line, shown(type), shown(name), text));
}
double PbrtParameters::number(const std::string& name, double otherwise) const {
  const PbrtParameter* p = find(name);
  if (p == nullptr) return otherwise;
  if (!p->words.empty()) p->fail(fmt::format("is \"{}\", not a number", shown(p->words[0])));
  if (p->numbers.size() != 1) p->fail(fmt::format("has {} numbers instead of one", p->numbers.size()));
  return p->numbers[0];
}
Vec PbrtParameters::vector(const std::string& name, const Vec& otherwise) const {
  const PbrtParameter* p = find(name);
  if (p == nullptr) return otherwise;
  if (!p->words.empty()) p->fail(fmt::format("is \"{}\", not three numbers", shown(p->words[0])));
  if (p->numbers.size() != 3) p->fail(fmt::format("has {} numbers instead of 3", p->numbers.size()));
  return Vec{p->numbers[0], p->numbers[1], p->numbers[2]};
}
std::string PbrtParameters::word(const std::string& name, const std::string& otherwise) const {
  const PbrtParameter* p = find(name);
  if (p == nullptr) return otherwise;
  if (p->words.empty()) p->fail(fmt::format("is {}, not a text", p->numbers[0]));
  if (p->words.size() != 1) p->fail(fmt::format("has {} texts instead of one", p->words.size()));
  return p->words[0];
}
bool PbrtParameters::truth(const std::string& name, bool otherwise) const {
  const std::string text = word(name, otherwise ? "true" : "false");
  if (text != "true" && text != "false") find(name)->fail(fmt::format("is \"{}\", not true or false", shown(text)));
  return text == "true";
}
std::vector<std::string> PbrtParameters::unread() const {
  std::vector<std::string> out;
  for (const PbrtParameter& p : list)
    if (asked_.count(p.name) == 0 && std::find(out.begin(), out.end(), p.name) == out.end()) out.push_back(p.name);
  return out;
}

double pbrt_number(const PbrtTokens& tokens, const PbrtToken& token, const std::string& what) {
  double value = 0;
  const char* begin = token.text.data() + (token.text.starts_with('+') ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, token.text.data() + token.text.size(), value);
  if (token.quoted || error != std::errc() || end != token.text.data() + token.text.size() || !std::isfinite(value))
    tokens.fail(fmt::format("{}: \"{}\" is no finite number", what, shown(token.text)));
  return value;
}

namespace {

// What its type says of its values.
void check_type(const PbrtParameter& p) {
  enum class Holds { numbers, words, either };
  struct Type {
    Holds holds;
    size_t numbers;  // in each value
  };
  static const std::map<std::string, Type> kTypes = {
      {"integer", {Holds::numbers, 1}}, {"float", {Holds::numbers, 1}},     {"point2", {Holds::numbers, 2}},
      {"vector2", {Holds::numbers, 2}}, {"point3", {Holds::numbers, 3}},    {"vector3", {Holds::numbers, 3}},
      {"normal3", {Holds::numbers, 3}}, {"point", {Holds::numbers, 3}},     {"vector", {Holds::numbers, 3}},
      {"normal", {Holds::numbers, 3}},  {"rgb", {Holds::numbers, 3}},       {"color", {Holds::numbers, 3}},
      {"xyz", {Holds::numbers, 3}},     {"blackbody", {Holds::numbers, 1}}, {"spectrum", {Holds::either, 1}},
      {"bool", {Holds::words, 1}},      {"string", {Holds::words, 1}},      {"texture", {Holds::words, 1}}};
  const auto known = kTypes.find(p.type);
  if (known == kTypes.end()) p.fail(fmt::format("is of no type that pbrt has: {}", shown(p.type)));
  const Type& type = known->second;
  if (type.holds == Holds::numbers && !p.words.empty())
    p.fail(fmt::format("holds \"{}\", which is no number", shown(p.words[0])));
  if (type.holds == Holds::words && !p.numbers.empty())
    p.fail(fmt::format("holds {}, which is no text in quotes", p.numbers[0]));
  if (p.numbers.size() % type.numbers != 0)
    p.fail(fmt::format("has {} numbers, which is no multiple of {}", p.numbers.size(), type.numbers));
  if (p.type != "integer") return;
  for (const double n : p.numbers)
    if (n != std::floor(n)) p.fail(fmt::format("holds {}, which is no whole number", n));
}

}  // namespace

PbrtParameters pbrt_parameters(PbrtTokens& tokens) {
  PbrtParameters out;
  while (tokens.peek() && tokens.peek()->quoted) {
    const std::string head = tokens.next()->text;
    PbrtParameter p;
    const size_t begin = std::min(head.find_first_not_of(" \t"), head.size()), gap = head.find_first_of(" \t", begin);
    if (gap == std::string::npos) tokens.fail(fmt::format("\"{}\" is no type and name of a parameter", shown(head)));
    p.type = head.substr(begin, gap - begin);
    const size_t name = std::min(head.find_first_not_of(" \t", gap), head.size());
    p.name = head.substr(name, head.find_last_not_of(" \t") + 1 - name);
    p.file = &tokens.file(), p.line = tokens.line();
    const auto add = [&](const PbrtToken& token) {
      if (token.quoted || token.text == "true" || token.text == "false")
        p.words.push_back(token.text);
      else
        p.numbers.push_back(pbrt_number(tokens, token, p.name));
    };
    auto token = tokens.next();
    if (token && token->text == "[" && !token->quoted) {
      for (token = tokens.next(); token && (token->quoted || token->text != "]"); token = tokens.next()) add(*token);
      if (!token) tokens.fail(fmt::format("the values of \"{}\" do not end", shown(p.name)));
    } else if (token) {
      add(*token);
    } else {
      tokens.fail(fmt::format("\"{}\" has no value", shown(p.name)));
    }
    if (p.numbers.empty() && p.words.empty()) tokens.fail(fmt::format("\"{}\" has no value", shown(p.name)));
    check_type(p);
    out.list.push_back(std::move(p));
  }
  return out;
}

}  // namespace lumicut::io
