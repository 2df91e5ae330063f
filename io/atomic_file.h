// Files appear whole or not at all: written beside their place under another name, then renamed.
#pragma once

#include <string>

namespace lumicut::io {

class AtomicFile {
 public:
  // `path` is where the file shall be. Throws FileError when its folder does not exist or cannot be written to.
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();  // removes the temporary file unless committed
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  // Write here; has the same extension as `path`.
  const std::string& temporary() const { return temporary_; }
  void commit();

 private:
  std::string path_, temporary_;
  bool committed_ = false;
};

// Writes bytes atomically. Throws FileError.
void write_whole_file(const std::string& path, const std::string& bytes);

}  // namespace lumicut::io
