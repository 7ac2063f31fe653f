#pragma once
// Whether a camera's images show anything, and anything new, by some of their rows.
//
// An image equal to the one before in all of them is no new image: no sensor is without noise. It would show
// a vehicle at rest that flies. Cost: of reading every 37th row. Memory: none.

#include <cstdint>

#include "estimator/core/image_view.hpp"

namespace swiftlet {

class ImageWatch {
 public:
  enum class Look : std::uint8_t { kNew, kRepeated, kDark };

  Look look(const ImageView& image);

 private:
  /// Rows between those that are read: prime, so that no pattern of a sensor or of text hides between them.
  static constexpr int kRowStep = 37;

  std::uint64_t signature_ = 0;
};

}  // namespace swiftlet
