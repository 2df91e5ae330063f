#include "io/atomic_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <optional>
#include <random>
#include <set>

#include "io/file_error.h"

namespace lumicut::io {

namespace fs = std::filesystem;

namespace {

constexpr char kPrefix[] = ".lumicut-", kSuffix[] = ".part";

[[noreturn]] void fail_write(const std::string& path, int error) {
  throw FileError(path, fmt::format("cannot be written: {}", std::strerror(error)));
}

class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  void reset(int fd) {
    if (fd_ >= 0) ::close(fd_);
    fd_ = fd;
  }
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

// Where bytes for `path` go.
struct Target {
  enum class Kind { file, stream, descriptor };
  Kind kind = Kind::file;
  fs::path path;       // links followed
  struct stat old {};  // of the earlier file
  bool exists = false;
  int descriptor = -1;  // of /proc/self/fd/N, to which /dev/stdout leads
};

// N of /proc/self/fd/N, /proc/thread-self/fd/N and /dev/fd/N, or -1.
int own_descriptor(const fs::path& path) {
  const std::string folder = path.parent_path().string(), name = path.filename().string();
  if (folder != "/proc/self/fd" && folder != "/dev/fd" && folder != "/proc/thread-self/fd") return -1;
  int number = -1;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return error == std::errc() && end == name.data() + name.size() ? number : -1;
}

Target find_target(const std::string& path) {
  Target target;
  target.path = path;
  struct stat link {};
  for (int links = 0;; ++links) {
    target.descriptor = own_descriptor(target.path);
    if (target.descriptor >= 0) {
      target.kind = Target::Kind::descriptor;
      const int mode = fcntl(target.descriptor, F_GETFL);
      if (mode < 0 || (mode & O_ACCMODE) == O_RDONLY) fail_write(path, EBADF);
      return target;
    }
    if (lstat(target.path.c_str(), &link) != 0 || !S_ISLNK(link.st_mode)) break;
    if (links == 40) fail_write(path, ELOOP);
    std::error_code code;
    const fs::path to = fs::read_symlink(target.path, code);
    if (code) fail_write(path, code.value());
    target.path = target.path.parent_path() / to;  // an absolute `to` replaces all
  }
  target.exists = stat(target.path.c_str(), &target.old) == 0;
  if (!target.exists) {
    if (errno != ENOENT) fail_write(path, errno);
    if (!target.path.has_filename()) throw FileError(path, "is no file name");
    const fs::path folder = target.path.has_parent_path() ? target.path.parent_path() : fs::path(".");
    std::error_code code;
    if (!fs::is_directory(folder, code)) throw FileError(path, "the folder " + folder.string() + " does not exist");
    return target;
  }
  const mode_t type = target.old.st_mode & S_IFMT;
  if (type == S_IFDIR) throw FileError(path, "is a folder, not a file");
  if (type == S_IFBLK) throw FileError(path, "is a block device; images are not written over disks");
  if (type == S_IFSOCK) throw FileError(path, "is a socket, not a file");
  if (type != S_IFREG) target.kind = Target::Kind::stream;
  // A rename asks only for the folder's permission; a file that may not be written shall stay.
  if (faccessat(AT_FDCWD, target.path.c_str(), W_OK, AT_EACCESS) != 0) fail_write(path, errno);
  return target;
}

// What killed runs left in the folder: files of ours by name and owner that no process holds locked. Once a run and
// folder.
void sweep(const fs::path& folder) {
  static std::mutex mutex;
  static std::set<fs::path> swept;
  const std::lock_guard lock(mutex);
  if (!swept.insert(fs::absolute(folder)).second) return;
  std::error_code code;
  for (fs::directory_iterator at(folder, code), end; !code && at != end; at.increment(code)) {
    const std::string name = at->path().filename().string();
    if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) continue;
    const Descriptor file(open(at->path().c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    struct stat found {};
    if (file.get() < 0 || fstat(file.get(), &found) != 0 || !S_ISREG(found.st_mode) || found.st_uid != geteuid())
      continue;
    if (flock(file.get(), LOCK_EX | LOCK_NB) == 0) unlink(at->path().c_str());
  }
}

// A file beside the target that is not in its place yet. Locked while it has a name, so that no other run sweeps it.
class Temporary {
 public:
  // Throws FileError naming `path`.
  Temporary(const std::string& path, const Target& target) : path_(path), target_(target) {
    folder_ = target.path.has_parent_path() ? target.path.parent_path() : fs::path(".");
    sweep(folder_);
    const mode_t mode = target.exists ? 0600 : 0666;  // nobody reads what the earlier file kept secret
    if (access("/proc/self/fd", X_OK) == 0)           // through which it gets its name
      file_.reset(open(folder_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, mode));
    if (file_.get() < 0) {  // not on every file system
      // The lock comes after the name: a run that sweeps in between removes it.
      struct stat made {};
      do {
        name_ = unused_name();
        file_.reset(open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode));
        if (file_.get() < 0 && errno != EEXIST) {
          name_.clear();
          fail_write(path_, errno);
        }
        if (file_.get() >= 0) flock(file_.get(), LOCK_EX | LOCK_NB);
      } while (file_.get() < 0 || fstat(file_.get(), &made) != 0 || made.st_nlink == 0);
    } else {
      flock(file_.get(), LOCK_EX | LOCK_NB);
    }
    if (!target.exists) return;
    mode_t kept = target.old.st_mode & 0777;
    if (fchown(file_.get(), target.old.st_uid, target.old.st_gid) != 0 &&
        fchown(file_.get(), static_cast<uid_t>(-1), target.old.st_gid) != 0)
      kept &= 0707;  // the permissions were another group's
    fchmod(file_.get(), kept);
  }
  ~Temporary() {
    if (!name_.empty()) unlink(name_.c_str());
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;

  int descriptor() const { return file_.get(); }

  // To the disk, then to its place.
  void commit() {
    if (fsync(file_.get()) != 0 && errno != EINVAL && errno != ENOSYS && errno != ENOTSUP) fail_write(path_, errno);
    // Some file systems tell of errors at close alone; the lock stays with the other descriptor.
    const int copy = fcntl(file_.get(), F_DUPFD_CLOEXEC, 0);
    if (copy < 0 || close(copy) != 0) fail_write(path_, errno);
    if (name_.empty()) {
      const std::string here = fmt::format("/proc/self/fd/{}", file_.get());
      std::string name;
      do name = unused_name();
      while (linkat(AT_FDCWD, here.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) != 0 && errno == EEXIST);
      struct stat made {};
      if (lstat(name.c_str(), &made) != 0) fail_write(path_, errno);
      name_ = name;
    }
    if (rename(name_.c_str(), target_.path.c_str()) != 0) fail_write(path_, errno);
    name_.clear();
  }

 private:
  std::string unused_name() const {
    std::random_device random;
    return (folder_ / fmt::format("{}{:08x}{:08x}{}", kPrefix, random(), random(), kSuffix)).string();
  }

  const std::string& path_;
  const Target& target_;
  fs::path folder_;
  std::string name_;  // empty: it has none
  Descriptor file_;
};

void write_all(const std::string& path, int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = write(fd, bytes.data(), std::min(bytes.size(), size_t{1} << 30));
    if (count >= 0) {
      bytes.remove_prefix(static_cast<size_t>(count));
      continue;
    }
    if (errno != EAGAIN) fail_write(path, errno);  // EINTR too: Ctrl-C while nobody reads a pipe
    pollfd room = {fd, POLLOUT, 0};
    if (poll(&room, 1, -1) < 0) fail_write(path, errno);
  }
}

// A reader that leaves is an error of this file, not the end of the process.
class WithoutBrokenPipeSignal {
 public:
  WithoutBrokenPipeSignal() {
    struct sigaction ignore {};
    ignore.sa_handler = SIG_IGN;
    sigaction(SIGPIPE, &ignore, &before_);
  }
  ~WithoutBrokenPipeSignal() { sigaction(SIGPIPE, &before_, nullptr); }
  WithoutBrokenPipeSignal(const WithoutBrokenPipeSignal&) = delete;
  WithoutBrokenPipeSignal& operator=(const WithoutBrokenPipeSignal&) = delete;

 private:
  struct sigaction before_ {};
};

// A device or a pipe; waits a while for somebody who reads the pipe.
int open_stream(const std::string& path, const fs::path& place) {
  constexpr int kWaits = 100;  // of 20 ms
  for (int i = 0;; ++i) {
    const int fd = open(place.c_str(), O_WRONLY | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    if (fd >= 0) return fd;  // write_all waits where it is full
    if (errno == ENXIO && i == kWaits) throw FileError(path, "cannot be written: nobody reads this pipe");
    if (errno != ENXIO) fail_write(path, errno);
    usleep(20000);
  }
}

}  // namespace

void check_distinct(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs) {
  // Nothing where there is no plain file: whoever writes there says so.
  const auto place_of = [](const std::string& path) -> std::optional<fs::path> {
    if (path.empty()) return {};
    Target target;
    try {
      target = find_target(path);
    } catch (const FileError&) {
      return {};
    }
    if (target.kind != Target::Kind::file) return {};
    std::error_code code;
    const fs::path place = fs::weakly_canonical(fs::absolute(target.path, code), code);
    return code ? target.path : place;
  };
  std::set<fs::path> written;
  for (const std::string& path : outputs)
    if (const auto place = place_of(path); place && !written.insert(*place).second)
      throw FileError(path, "is where two outputs shall be written");
  for (const std::string& path : inputs)
    if (const auto place = place_of(path); place && written.contains(*place))
      throw FileError(path, "is read, and an output shall not take its place");
}

void check_writable(const std::string& path, uint64_t bytes) {
  const Target target = find_target(path);
  if (target.kind != Target::Kind::file) return;
  const Temporary file(path, target);
  if (bytes == 0) return;
  if (const int error = posix_fallocate(file.descriptor(), 0, static_cast<off_t>(bytes)); error != 0)
    fail_write(path, error);
}

void write_whole_file(const std::string& path, std::string_view bytes) {
  const Target target = find_target(path);
  switch (target.kind) {
    case Target::Kind::file: {
      Temporary file(path, target);
      write_all(path, file.descriptor(), bytes);
      return file.commit();
    }
    case Target::Kind::stream: {
      const Descriptor out(open_stream(path, target.path));
      const WithoutBrokenPipeSignal no_signal;
      return write_all(path, out.get(), bytes);
    }
    case Target::Kind::descriptor:
      std::fflush(stdout);  // what was printed comes before
      return write_all(path, target.descriptor, bytes);
  }
}

}  // namespace lumicut::io
