#include "io/ply_check.h"

#include <fmt/format.h>

#include <charconv>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <vector>

#include "io/file_error.h"
#include "io/find_beside.h"

namespace lumicut::io {

namespace {

struct Kind {
  size_t size = 0;
  bool is_signed = false, is_real = false;
};
struct Property {
  std::optional<Kind> count;  // of a list
  Kind value;
};
struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> out;
  constexpr const char* kBlank = " \t\r";
  for (size_t at = line.find_first_not_of(kBlank); at != line.npos; at = line.find_first_not_of(kBlank, at)) {
    const size_t end = std::min(line.find_first_of(kBlank, at), line.size());
    out.push_back(line.substr(at, end - at));
    at = end;
  }
  return out;
}

std::optional<int64_t> whole(std::string_view word) {
  int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

std::optional<Kind> kind_of(std::string_view word) {
  static const std::map<std::string_view, Kind> kKinds = {{"char", {1, true}},
                                                          {"int8", {1, true}},
                                                          {"uchar", {1}},
                                                          {"uint8", {1}},
                                                          {"short", {2, true}},
                                                          {"int16", {2, true}},
                                                          {"ushort", {2}},
                                                          {"uint16", {2}},
                                                          {"int", {4, true}},
                                                          {"int32", {4, true}},
                                                          {"uint", {4}},
                                                          {"uint32", {4}},
                                                          {"float", {4, true, true}},
                                                          {"float32", {4, true, true}},
                                                          {"double", {8, true, true}},
                                                          {"float64", {8, true, true}}};
  const auto found = kKinds.find(word);
  return found == kKinds.end() ? std::nullopt : std::optional(found->second);
}

class Check {
 public:
  Check(const std::string& path, std::string_view bytes) : path_(path), bytes_(bytes) {}

  void run() {
    if (!header()) return;
    for (const Element& e : elements_) {
      if (e.properties.empty()) continue;
      if (format_ == "ascii")
        rows(e);
      else
        packed(e, format_ == "binary_big_endian");
    }
  }

 private:
  [[noreturn]] void fail(const std::string& text) const { throw FileError(path_, text); }
  [[noreturn]] void ends_early(const Element& e, uint64_t row) const {
    fail(fmt::format("the file ends after {} of the {} rows of its element \"{}\"", row, e.count, shown(e.name)));
  }
  std::optional<std::string_view> line() {
    if (at_ >= bytes_.size()) return std::nullopt;
    const size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
    const auto out = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return out;
  }

  // False: assimp says what is wrong with it.
  bool header() {
    if (!bytes_.starts_with("ply")) fail("is no PLY file: it does not begin with \"ply\"");
    for (;;) {
      const auto next = line();
      if (!next) fail("its header has no end_header");
      const auto words = words_of(*next);
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info" || words[0] == "ply") continue;
      if (words[0] == "end_header") return format_ == "ascii" || format_.starts_with("binary_");
      if (words[0] == "format" && words.size() > 1) format_ = words[1];
      if (words[0] == "element" && words.size() > 2) {
        const auto count = whole(words[2]);
        // A row has a byte at least.
        if (!count || *count < 0 || static_cast<uint64_t>(*count) > bytes_.size())
          fail(fmt::format("element {} promises {} rows, in a file of {} bytes", shown(words[1]), shown(words[2]),
                           bytes_.size()));
        elements_.push_back({std::string(words[1]), static_cast<uint64_t>(*count), {}});
      }
      if (words[0] == "property") {
        const bool list = words.size() > 4 && words[1] == "list";
        if (elements_.empty() || words.size() < 3) return false;
        const auto value = kind_of(words[list ? 3 : 1]);
        const auto count = list ? kind_of(words[2]) : std::nullopt;
        if (!value || (list && (!count || count->is_real))) return false;
        elements_.back().properties.push_back({count, *value});
      }
    }
  }

  void rows(const Element& e) {
    for (uint64_t row = 0; row < e.count; ++row) {
      std::vector<std::string_view> words;
      while (words.empty() || words[0] == "comment") {
        const auto next = line();
        if (!next) ends_early(e, row);
        words = words_of(*next);
      }
      size_t needed = 0;
      for (const Property& p : e.properties) {
        uint64_t more = 1;
        if (p.count) {
          const auto count = needed < words.size() ? whole(words[needed]) : std::nullopt;
          if (!count || *count < 0) fail(fmt::format("{}, {}: no length of a list", shown(e.name), row));
          more += static_cast<uint64_t>(*count);
        }
        if (more > words.size() - std::min(needed, words.size()))
          fail(fmt::format("row {} of its element \"{}\" has {} numbers, too few{}", row, shown(e.name), words.size(),
                           p.count ? fmt::format(" for a list of {}", more - 1) : ""));
        needed += more;
      }
    }
  }

  void packed(const Element& e, bool big) {
    size_t fixed = 0;
    bool lists = false;
    for (const Property& p : e.properties) fixed += p.value.size, lists = lists || p.count;
    if (!lists) {
      if (e.count > (bytes_.size() - std::min(at_, bytes_.size())) / fixed)
        ends_early(e, (bytes_.size() - at_) / fixed);
      at_ += e.count * fixed;
      return;
    }
    for (uint64_t row = 0; row < e.count; ++row)
      for (const Property& p : e.properties) {
        uint64_t values = 1;
        if (p.count) {
          if (p.count->size > bytes_.size() - at_) ends_early(e, row);
          values = 0;
          for (size_t k = 0; k < p.count->size; ++k)
            values |= uint64_t{static_cast<unsigned char>(bytes_[at_ + k])} << 8 * (big ? p.count->size - 1 - k : k);
          if (p.count->is_signed && (values >> (8 * p.count->size - 1) & 1) != 0)
            fail(fmt::format("row {} of its element \"{}\" has a list of a length below 0", row, shown(e.name)));
          at_ += p.count->size;
        }
        if (values > (bytes_.size() - at_) / p.value.size) {
          if (!p.count) ends_early(e, row);
          fail(fmt::format("row {} of its element \"{}\" has a list of {} numbers, and the file ends before", row,
                           shown(e.name), values));
        }
        at_ += values * p.value.size;
      }
  }

  std::string path_;
  std::string_view bytes_;
  size_t at_ = 0;
  std::string format_;
  std::vector<Element> elements_;
};

}  // namespace

void check_ply(const std::string& path, std::string_view bytes) { Check(path, bytes).run(); }

}  // namespace lumicut::io
