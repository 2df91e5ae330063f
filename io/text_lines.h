// Text files of any system, made plain for readers that go by lines.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace lumicut::io {

// Without a byte-order mark; every line ends with '\n', whether the file has LF, CRLF or CR. Throws FileError for
// UTF-16, which would be read as garbage.
std::string plain_text(std::string text, const std::string& path);

// Throws FileError for UTF-16, with a byte-order mark or without.
void refuse_utf16(std::string_view text, const std::string& path);

// ASCII letters alone.
std::string lower(std::string text);

// Which line of the file a place in its text is in. Quick when places are asked for in rising order.
class LineCounter {
 public:
  // `text` must outlive this and is changed: lines that end with '\' are joined with the next by spaces, comments
  // (which begin with '#') excepted.
  explicit LineCounter(std::string& text);
  int line(size_t offset);

 private:
  const std::string& text_;
  std::vector<size_t> joined_;  // where line ends were
  size_t at_ = 0, next_joined_ = 0;
  int line_ = 1;
};

}  // namespace lumicut::io
