#include "io/atomic_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "io/file_error.h"

namespace lumicut::io {

namespace fs = std::filesystem;

std::string read_whole_file(const std::string& path, uint64_t max_bytes) {
  std::error_code code;
  const auto status = fs::status(path, code);
  if (!fs::exists(status)) throw FileError(path, "no such file");
  if (fs::is_directory(status)) throw FileError(path, "is a folder, not a file");
  std::ifstream in(path, std::ios::binary);
  if (!in) throw FileError(path, std::string("cannot be read: ") + std::strerror(errno));
  std::string bytes;
  if (fs::is_regular_file(status)) {
    const uint64_t size = fs::file_size(path, code);
    if (!code && size > max_bytes)
      throw FileError(path,
                      "has " + std::to_string(size) + " bytes; at most " + std::to_string(max_bytes) + " are read");
    if (!code) bytes.reserve(size);
  }
  std::string chunk(size_t{1} << 20, '\0');
  while (in) {
    in.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
    bytes.append(chunk.data(), static_cast<size_t>(in.gcount()));
    if (bytes.size() > max_bytes) throw FileError(path, "is longer than " + std::to_string(max_bytes) + " bytes");
  }
  if (in.bad()) throw FileError(path, "reading failed");
  return bytes;
}

AtomicFile::AtomicFile(const std::string& path) : path_(path) {
  const fs::path target(path);
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  std::error_code code;
  if (!fs::is_directory(folder, code)) throw FileError(path, "the folder " + folder.string() + " does not exist");
  if (fs::is_directory(target, code)) throw FileError(path, "is a folder, not a file");
  temporary_ =
      (folder / fmt::format(".{}.part{}{}", target.stem().string(), ::getpid(), target.extension().string())).string();
  if (!std::ofstream(temporary_, std::ios::binary))
    throw FileError(path, std::string("cannot be written: ") + std::strerror(errno));
}

AtomicFile::~AtomicFile() {
  std::error_code code;
  if (!committed_) fs::remove(temporary_, code);
}

void AtomicFile::commit() {
  std::error_code code;
  fs::rename(temporary_, path_, code);
  if (code) throw FileError(path_, "cannot be written: " + code.message());
  committed_ = true;
}

void write_whole_file(const std::string& path, const std::string& bytes) {
  AtomicFile file(path);
  std::ofstream out(file.temporary(), std::ios::binary);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) throw FileError(path, std::string("cannot be written: ") + std::strerror(errno));
  file.commit();
}

}  // namespace lumicut::io
