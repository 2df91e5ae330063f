// A folder for images that a scene's file holds, which readers of pictures want as files. Removed at its end.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

#include "io/file_error.h"

namespace lumicut::io {

class UnpackFolder {
 public:
  UnpackFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "lumicut-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw FileError(name, "cannot be made: images inside of files are unpacked there");
    path_ = name;
  }
  ~UnpackFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  UnpackFolder(const UnpackFolder&) = delete;
  UnpackFolder& operator=(const UnpackFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace lumicut::io
