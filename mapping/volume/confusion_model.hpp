#pragma once
// From how often which label was seen at a place to the most likely label and its probability.
//
// The model C(s, t) is the probability that a segmentation says s where t is true. With even priors Bayes'
// rule gives P(t | counts) proportional to the product over s of C(s, t)^count(s) (McCormac et al.,
// "SemanticFusion", ICRA 2017; Rosinol et al., ICRA 2020), so the counts are all that a voxel has to keep.
// Label 0 (unknown) and labels that the model does not have are neither true nor counted. A table answers
// where a place saw one label only.

#include <array>
#include <cstdint>

#include "estimator/core/status.hpp"
#include "mapping/volume/volume_settings.hpp"
#include "mapping/volume/voxel_block.hpp"

namespace swiftlet {

struct LabelEstimate {
  std::uint8_t label = 0;  ///< 0: never seen
  float probability = 0;
};

class ConfusionModel {
 public:
  /// Rows: what was said; columns: what is true. Label 0 is left out of both.
  using Matrix = std::array<std::array<float, kLabelValues>, kLabelValues>;

  /// `labels` values (0 included): right with probability `right`, wrong with all others alike.
  explicit ConfusionModel(int labels = kLabelValues, float right = 0.9F);

  /// kInvalidInput, and nothing is changed, where an entry of the first `labels` labels is no probability or
  /// a column does not sum to 1 within 1 %. Zeros count as 1e-4: one wrong pixel must not rule out a label
  /// for ever.
  [[nodiscard]] Status set(const Matrix& matrix, int labels);

  [[nodiscard]] LabelEstimate estimate(const LabelCounts& counts) const;

 private:
  void fillTable();

  int labels_ = kLabelValues;
  std::array<std::array<float, kLabelValues>, kLabelValues> log_{};
  /// Of places that saw one label only, by count; longer runs are as certain as the last entry.
  static constexpr std::size_t kTable = 16;
  std::array<std::array<LabelEstimate, kTable>, kLabelValues> alone_{};
};

}  // namespace swiftlet
