#pragma once
// Threads that only serve viewers give way to all others, also where no thread may have real-time priority.

namespace swiftlet {

/// Of the calling thread: a niceness of 10. Where that is refused it stays as it is.
void yieldToOthers();

}  // namespace swiftlet
