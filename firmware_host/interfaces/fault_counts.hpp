#pragma once
// Counts of faults by their text, in fixed memory. Texts are literals: one is known by its address.

#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/status.hpp"

namespace swiftlet {

class FaultCounts {
 public:
  struct Row {
    const char* text = "";
    std::uint64_t count = 0;
  };

  void add(const Status& status) {
    for (Row& row : rows_) {
      if (row.text == status.what) {
        ++row.count;
        return;
      }
    }
    // More kinds of faults than the stages have texts for do not happen; the total stays right.
    if (!rows_.tryPushBack({status.what, 1})) ++rows_[0].count;
  }
  [[nodiscard]] const auto& rows() const { return rows_; }

 private:
  FixedVector<Row, 16> rows_;
};

}  // namespace swiftlet
