#pragma once
// A 6 x 6 block of the normal equations, by columns, padded to two vectors per column.

#include <cstddef>

#include "estimator/smoother/state.hpp"

namespace swiftlet {

inline constexpr std::size_t kPaddedRows = 8;

struct PaddedBlock {
  alignas(32) double column[kPoseDim][kPaddedRows] = {};

  void add(const PaddedBlock& other) {
    for (std::size_t c = 0; c < kPoseDim; ++c) {
      for (std::size_t r = 0; r < kPaddedRows; ++r) column[c][r] += other.column[c][r];
    }
  }
};

}  // namespace swiftlet
