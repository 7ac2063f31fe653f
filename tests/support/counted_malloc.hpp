#pragma once
// Counts the calls of malloc: include it in one source of a test program. One thread only.
//
// SWIFTLET_COUNTS_MALLOC is defined where that is possible: with glibc, and without a sanitizer, which has
// its own allocator.

#include <cstddef>
#include <cstdlib>

namespace swiftlet::test {

inline long malloc_calls = 0;  ///< stays zero where they are not counted

}  // namespace swiftlet::test

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SWIFTLET_COUNTS_MALLOC

namespace swiftlet::test {

/// A count that stays zero says something only where this is true.
inline bool mallocIsCounted() {
  const long before = malloc_calls;
  void* volatile const memory = std::malloc(8);
  std::free(memory);
  return malloc_calls > before;
}

}  // namespace swiftlet::test

extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) {
  ++swiftlet::test::malloc_calls;
  return __libc_malloc(size);
}

#endif
