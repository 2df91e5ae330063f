// The words of pbrt's scene files, and the parameters of its statements.
#pragma once

#include <cstdint>
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
};

// The words of a file and of those that it includes.
class PbrtTokens {
 public:
  explicit PbrtTokens(const std::string& path) { open(path); }

  // The words of that file come next. It may be packed by gzip.
  void open(const std::string& path);
  std::string where() const;  // of the last word
  const std::string& file() const { return files_.empty() ? last_ : files_.back().path; }

  std::optional<PbrtToken> next();
  const std::optional<PbrtToken>& peek();
  [[noreturn]] void fail(const std::string& text) const;

 private:
  struct Source {
    std::string path, text;
    size_t at;
    int line;
  };
  std::optional<PbrtToken> find();
  std::optional<PbrtToken> read(Source& s);

  std::vector<Source> files_;
  std::optional<PbrtToken> ahead_;
  std::string last_;
  int line_ = 1;
  uint64_t bytes_ = 0;
  size_t opened_ = 0;
};

struct PbrtParameter {
  std::string type, name;
  std::vector<double> numbers;
  std::vector<std::string> words;
};

// Remembers which were asked for: what is left over is told.
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
