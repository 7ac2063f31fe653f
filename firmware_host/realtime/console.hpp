#pragma once
// Messages of a run on stdout and stderr. A closed terminal, a pipe without a reader, a full disk behind a
// redirection or a stalled reader costs messages, never the run: nothing here throws, raises a signal, or
// waits longer than 0.1 s for a stalled reader, and then not again until it reads.
//
// Threads: any except those of the flight path. A message is written completely if the reader accepts it.

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace swiftlet {

/// To stdout. `text` ends its own lines.
void say(std::string_view text);
/// To stderr.
void warn(std::string_view text);
/// Writes one warning line to stderr for each entry, beginning with number `from`.
void warnAll(std::span<const std::string> warnings, std::size_t from = 0);

/// Call at the program's start: opens /dev/null as 0, 1 and 2 where these are closed. Otherwise the run's
/// first files would get these numbers, and messages would be written into them.
void holdStandardStreams();

}  // namespace swiftlet
