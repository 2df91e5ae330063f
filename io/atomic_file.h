// Files appear whole or not at all: written beside their place under another name, brought to the disk, then renamed.
//
// A symbolic link stays, and what it points to is replaced. An earlier file's mode, and owner where permitted, pass to
// the new one. Pipes and character devices (/dev/null, /dev/stdout) are written to as they are and never replaced;
// folders, block devices, sockets and files without write permission are refused. A run that is killed leaves the
// earlier file; a nameless temporary file (O_TMPFILE) where the file system has them leaves nothing else either, and
// what is left elsewhere is removed by the next run that writes into the folder.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lumicut::io {

// Throws FileError when two of the outputs (empty ones aside) are the same file, by whatever name, or one is an input: the
// one would take the place of the other. Devices and pipes may be named twice.
void check_distinct(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs = {});

// Throws FileError when a file of so many bytes cannot be written at `path` (links, devices and pipes: nothing): before
// hours of work, not after. Changes nothing.
void check_writable(const std::string& path, uint64_t bytes = 0);

// Throws FileError on any error, a full disk included; then the earlier file stands as it was.
void write_whole_file(const std::string& path, std::string_view bytes);

}  // namespace lumicut::io
