#include "io/text_lines.h"

#include <algorithm>

#include "io/file_error.h"

namespace lumicut::io {

void refuse_utf16(std::string_view text, const std::string& path) {
  const bool marked = text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff");
  // Of the first letter, which is an ASCII one, one byte is 0.
  const bool unmarked = text.size() >= 2 && (text[0] == '\0') != (text[1] == '\0');
  if (marked || unmarked) throw FileError(path, "is UTF-16 text; save it as UTF-8");
}

std::string plain_text(std::string text, const std::string& path) {
  refuse_utf16(text, path);
  if (text.starts_with("\xef\xbb\xbf")) text.erase(0, 3);
  size_t out = text.find('\r');
  if (out == std::string::npos) return text;
  for (size_t in = out; in < text.size(); ++in) {
    if (text[in] == '\r' && in + 1 < text.size() && text[in + 1] == '\n') continue;
    text[out++] = text[in] == '\r' ? '\n' : text[in];
  }
  text.resize(out);
  return text;
}

std::string lower(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

LineCounter::LineCounter(std::string& text) : text_(text) {
  if (text.find('\\') == std::string::npos) return;
  const auto blank = [&](size_t at) { return text[at] == ' ' || text[at] == '\t'; };
  bool comment = false, continued = false;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    size_t first = begin, last = end;  // of what is not blank, and one beyond
    while (first < end && blank(first)) ++first;
    while (last > first && blank(last - 1)) --last;
    if (!continued) comment = first < end && text[first] == '#';
    continued = !comment && end < text.size() && last > first && text[last - 1] == '\\';
    if (continued) {
      text[last - 1] = text[end] = ' ';
      joined_.push_back(end);
    }
    begin = end + 1;
  }
}

int LineCounter::line(size_t offset) {
  if (offset < at_) at_ = 0, next_joined_ = 0, line_ = 1;
  line_ += static_cast<int>(std::count(text_.begin() + static_cast<std::ptrdiff_t>(at_),
                                       text_.begin() + static_cast<std::ptrdiff_t>(offset), '\n'));
  for (; next_joined_ < joined_.size() && joined_[next_joined_] < offset; ++next_joined_) ++line_;
  at_ = offset;
  return line_;
}

}  // namespace lumicut::io
