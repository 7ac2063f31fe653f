#pragma once
// Whether a camera's images show anything, and anything new, by some of their rows.
//
// An image equal to the one before in all of them is no new image: no sensor is without noise. It would show
// a vehicle at rest that flies. Cost: 3 % of toGrey(). Memory: a row.

#include <array>
#include <cstdint>

#include "drivers/v4l2/raw_image.hpp"

namespace swiftlet {

class ImageWatch {
 public:
  enum class Look : std::uint8_t { kNew, kRepeated, kDark };

  Look look(const RawImage& image);

 private:
  /// Rows between those that are read: prime, so that no pattern of a sensor or of text hides between them.
  static constexpr int kRowStep = 37;
  static constexpr int kWidest = 4096;  // px, the rest of a wider row is not read

  std::array<std::uint8_t, kWidest> row_ = {};
  std::uint64_t signature_ = 0;
};

}  // namespace swiftlet
