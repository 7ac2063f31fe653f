#pragma once
// Counts of faults by text, in fixed memory. Texts are literals and are compared by address.

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
    // Never full: the stages have fewer texts. If it were, the total would still be right.
    if (!rows_.tryPushBack({status.what, 1})) ++rows_[0].count;
  }
  [[nodiscard]] const auto& rows() const { return rows_; }

 private:
  FixedVector<Row, 16> rows_;
};

}  // namespace swiftlet
