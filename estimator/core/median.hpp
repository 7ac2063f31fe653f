#pragma once
// The median of values whose order does not matter.

#include <algorithm>
#include <iterator>

namespace swiftlet {

/// Of an even number of values, the upper one of the two in the middle. Reorders the values, of which there
/// must be one; linear time, no allocation.
template <typename Values>
auto medianOf(Values&& values) {
  const auto middle = std::begin(values) + std::ssize(values) / 2;
  std::nth_element(std::begin(values), middle, std::end(values));
  return *middle;
}

}  // namespace swiftlet
