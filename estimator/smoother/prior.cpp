#include "estimator/smoother/prior.hpp"

#include <algorithm>

namespace swiftlet {

Prior::Prior() : h_(alignedMapSize(kMaxSystemDim)), b_(static_cast<std::size_t>(kMaxSystemDim)) {}

void Prior::clear() {
  blocks_.clear();
  dimension_ = 0;
}

bool Prior::touches(std::uint8_t slot) const {
  return std::any_of(blocks_.begin(), blocks_.end(), [slot](const PriorBlock& b) { return b.slot == slot; });
}

void Prior::begin() { clear(); }

void Prior::addBlock(std::uint8_t slot, int dimension, const BodyState& reference) {
  blocks_.pushBack({slot, dimension, dimension_, reference});
  dimension_ += dimension;
}

void Prior::allocate() {
  H().setZero();
  b().setZero();
}

MatrixMap Prior::H() { return alignedMap(h_, dimension_); }

VectorMap Prior::b() { return {b_.data(), dimension_}; }

}  // namespace swiftlet
