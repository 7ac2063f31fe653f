#pragma once
// Computes the most likely label of a voxel and its probability from its label counts.
//
// The model C(s, t) is the probability that a segmentation reports s if t is true. With even priors Bayes'
// rule gives P(t | counts) proportional to the product over s of C(s, t)^count(s) (McCormac et al.,
// "SemanticFusion", ICRA 2017; Rosinol et al., ICRA 2020), so counts are sufficient. Label 0 (unknown) and
// labels beyond the model are ignored. Voxels with a single label are looked up in a table.

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
  /// Rows: reported label; columns: true label. Without label 0.
  using Matrix = std::array<std::array<float, kLabelValues>, kLabelValues>;

  /// `labels` values including 0: right with probability `right`, all wrong labels equally likely.
  explicit ConfusionModel(int labels = kLabelValues, float right = 0.9F);

  /// kInvalidInput, without effect, if an entry of the first `labels` labels is not a probability or a column
  /// does not sum to 1 within 1 %. Zeros count as 1e-4, because one wrong pixel must not rule out a label
  /// forever.
  [[nodiscard]] Status set(const Matrix& matrix, int labels);

  [[nodiscard]] LabelEstimate estimate(const LabelCounts& counts) const;

 private:
  void fillTable();

  int labels_ = kLabelValues;
  std::array<std::array<float, kLabelValues>, kLabelValues> log_{};
  /// Estimates of voxels with a single label, by count; larger counts use the last entry.
  static constexpr std::size_t kTable = 16;
  std::array<std::array<LabelEstimate, kTable>, kLabelValues> alone_{};
};

}  // namespace swiftlet
