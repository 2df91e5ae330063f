// What readers notice in a file and read all the same: collected, at most ten of a kind in full, then a count.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace lumicut::io {

class Warnings {
 public:
  static constexpr uint64_t kShown = 10;  // of one kind

  // `kind` is a plural that the count is told with: "missing textures". `text` says what was read in its place.
  void add(const std::string& kind, const std::string& file, const std::string& text);
  void add(const std::string& kind, const std::string& file, int line, const std::string& text);

  // Each text becomes what `change` makes of it.
  void rewrite(const std::function<std::string(const std::string&)>& change) {
    for (auto& text : texts_) text = change(text);
  }
  bool empty() const { return texts_.empty(); }
  // "FILE: line N: text" in the order found, then a line for each kind with more than kShown.
  std::vector<std::string> lines() const;

 private:
  std::vector<std::string> texts_;
  std::map<std::string, uint64_t> counts_;
};

}  // namespace lumicut::io
