#pragma once
// Detects dark and repeated images of a camera from some of their rows.
//
// An image equal to the previous one in all of these rows is not a new image: no sensor is free of noise.
// Used as a new image it would show a flying vehicle at rest. Cost: reading every 37th row. Memory: none.

#include <cstdint>

#include "estimator/core/image_view.hpp"

namespace swiftlet {

class ImageWatch {
 public:
  enum class Look : std::uint8_t { kNew, kRepeated, kDark };

  Look look(const ImageView& image);

 private:
  /// Distance between the rows that are read: prime, so that no regular pattern of a sensor or of text falls
  /// between them.
  static constexpr int kRowStep = 37;

  std::uint64_t signature_ = 0;
};

}  // namespace swiftlet
