#pragma once
// Time as data: integer nanoseconds, not floating-point seconds.
//
// A `Stamp` is a point on one clock (CLOCK_MONOTONIC live, the log's clock in replay); a `Duration` is the
// difference of two. A double of seconds near 1.4e9 resolves only 238 ns, which breaks equality of stamps;
// hence distinct types and explicit conversions.

#include <compare>
#include <cstdint>

namespace swiftlet {

struct Duration {
  std::int64_t ns = 0;

  /// Seconds; exact to 1 ns for |duration| < 104 days.
  [[nodiscard]] constexpr double seconds() const { return static_cast<double>(ns) * 1e-9; }
  [[nodiscard]] static constexpr Duration fromSeconds(double seconds) {
    return {static_cast<std::int64_t>(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5))};
  }
  [[nodiscard]] static constexpr Duration fromMilliseconds(std::int64_t ms) { return {ms * 1'000'000}; }

  constexpr auto operator<=>(const Duration&) const = default;
  constexpr Duration operator+(Duration other) const { return {ns + other.ns}; }
  constexpr Duration operator-(Duration other) const { return {ns - other.ns}; }
  constexpr Duration operator-() const { return {-ns}; }
};

struct Stamp {
  std::int64_t ns = 0;

  constexpr auto operator<=>(const Stamp&) const = default;
  constexpr Duration operator-(Stamp other) const { return {ns - other.ns}; }
  constexpr Stamp operator+(Duration duration) const { return {ns + duration.ns}; }
  constexpr Stamp operator-(Duration duration) const { return {ns - duration.ns}; }
};

}  // namespace swiftlet
