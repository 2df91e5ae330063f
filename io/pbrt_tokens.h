// The words of pbrt's scene files, and the parameters of its statements.
#pragma once

#include <cstdint>
#include <list>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/affine.h"

namespace lumicut::io {

struct PbrtToken {
  std::string text;
  bool quoted = false;
  int line = 0;
  const std::string* file = nullptr;  // as long as the PbrtTokens live
};

// The words of a file and of those that it includes.
class PbrtTokens {
 public:
  explicit PbrtTokens(const std::string& path) { open(path); }
  PbrtTokens(const PbrtTokens&) = delete;
  PbrtTokens& operator=(const PbrtTokens&) = delete;

  // The words of that file come next. It may be packed by gzip. Fails where it is among those that include it.
  void open(const std::string& path);
  // Of the last word.
  std::string where() const;
  int line() const { return line_; }
  const std::string& file() const { return *file_; }

  std::optional<PbrtToken> next();
  const std::optional<PbrtToken>& peek();
  [[noreturn]] void fail(const std::string& text) const;

 private:
  struct Source {
    const std::string* path;
    std::string text;
    size_t at;
    int line;
  };
  std::optional<PbrtToken> find();
  std::optional<PbrtToken> read(Source& s);

  std::list<std::string> paths_;
  std::vector<Source> files_;
  std::optional<PbrtToken> ahead_;
  const std::string* file_ = nullptr;
  int line_ = 1;
  uint64_t bytes_ = 0;
  size_t opened_ = 0;
};

struct PbrtParameter {
  std::string type, name;
  std::vector<double> numbers;
  std::vector<std::string> words;  // or these, as the type says
  const std::string* file = nullptr;
  int line = 0;

  [[noreturn]] void fail(const std::string& text) const;
};

// Remembers which were asked for: what is left over is told. A value of another kind than is asked for is an error.
class PbrtParameters {
 public:
  std::vector<PbrtParameter> list;

  const PbrtParameter* find(const std::string& name) const;
  double number(const std::string& name, double otherwise) const;
  Vec vector(const std::string& name, const Vec& otherwise) const;
  std::string word(const std::string& name, const std::string& otherwise) const;
  bool truth(const std::string& name, bool otherwise) const;
  // Names of those that nobody asked for.
  std::vector<std::string> unread() const;
  void ignore(const std::string& name) const { asked_.insert(name); }

 private:
  mutable std::set<std::string> asked_;
};

double pbrt_number(const PbrtTokens& tokens, const PbrtToken& token, const std::string& what);
// "type name" [ values ] ...
PbrtParameters pbrt_parameters(PbrtTokens& tokens);

}  // namespace lumicut::io
