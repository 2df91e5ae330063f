// The standard streams of a command, from its first line to its exit code.
#pragma once

namespace lumicut::io {

// First of all in main. A stream that is closed (`>&-`) would hand its number to the next file opened, and text would go
// into that: /dev/null stands in, where writing is an error. A file that grows beyond `ulimit -f` becomes an error too.
void open_standard_streams();

// Last in main. Brings standard output to its end and returns the exit code: `code`, or `failure`, with a message, when
// not all of it could be written. `error` is errno of an earlier attempt, where known. A reader that has gone (`| head`) is no error worth a message.
int close_standard_output(const char* command, int code, int failure, int error = 0);

}  // namespace lumicut::io
