#pragma once
// Whether a sanitizer watches the test: all takes tenfold then, and memory is neither locked nor malloc's
// own.

namespace swiftlet {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace swiftlet
