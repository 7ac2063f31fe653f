#include "mapping/volume/confusion_model.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

constexpr float kLeastProbability = 1e-4F;
constexpr float kSumTolerance = 0.01F;

}  // namespace

ConfusionModel::ConfusionModel(int labels, float right) {
  labels_ = std::clamp(labels, 2, kLabelValues);
  right = std::clamp(right, kLeastProbability, 1 - kLeastProbability);
  const float wrong = labels_ > 2 ? (1 - right) / static_cast<float>(labels_ - 2) : 1 - right;
  for (std::size_t said = 0; said < kLabelValues; ++said) {
    for (std::size_t real = 0; real < kLabelValues; ++real) {
      log_[said][real] = std::log(std::max(said == real ? right : wrong, kLeastProbability));
    }
  }
  fillTable();
}

Status ConfusionModel::set(const Matrix& matrix, int labels) {
  if (labels < 2 || labels > kLabelValues) {
    return {StatusCode::kInvalidInput, "confusion model: from 2 to 32 labels, 0 included"};
  }
  const auto count = static_cast<std::size_t>(labels);
  for (std::size_t real = 1; real < count; ++real) {
    float sum = 0;
    for (std::size_t said = 1; said < count; ++said) {
      const float p = matrix[said][real];
      if (!(p >= 0 && p <= 1))
        return {StatusCode::kInvalidInput, "confusion model: an entry is not a probability"};
      sum += p;
    }
    if (!(std::abs(sum - 1) <= kSumTolerance)) {
      return {StatusCode::kInvalidInput, "confusion model: a column does not sum to 1"};
    }
  }
  labels_ = labels;
  for (std::size_t said = 0; said < kLabelValues; ++said) {
    for (std::size_t real = 0; real < kLabelValues; ++real) {
      const bool known = said < count && real < count;
      log_[said][real] =
          std::log(known ? std::max(matrix[said][real], kLeastProbability) : kLeastProbability);
    }
  }
  fillTable();
  return okStatus();
}

void ConfusionModel::fillTable() {
  for (auto& row : alone_) row.fill({});
  for (std::size_t label = 1; label < static_cast<std::size_t>(labels_); ++label) {
    LabelCounts counts;
    for (std::size_t n = 1; n < kTable; ++n) {
      counts.add(static_cast<std::uint8_t>(label));
      alone_[label][n] = {};
      LabelEstimate result = estimate(counts);
      alone_[label][n] = result;
    }
  }
}

LabelEstimate ConfusionModel::estimate(const LabelCounts& counts) const {
  if (counts.empty()) return {};
  if (counts.count(1) == 0) {
    const LabelEstimate& known = alone_[counts.label(0)][std::min<std::size_t>(counts.count(0), kTable - 1)];
    if (known.label != 0) return known;
  }
  std::array<float, kLabelValues> sum{};
  bool any = false;
  for (int slot = 0; slot < LabelCounts::kSlots && counts.count(slot) > 0; ++slot) {
    if (counts.label(slot) >= labels_) continue;
    any = true;
    const auto& row = log_[counts.label(slot)];
    const auto n = static_cast<float>(counts.count(slot));
    for (std::size_t i = 0; i < kLabelValues; ++i) sum[i] += n * row[i];
  }
  if (!any) return {};
  const auto count = static_cast<std::size_t>(labels_);
  std::size_t best = 1;
  for (std::size_t i = 2; i < count; ++i) best = sum[i] > sum[best] ? i : best;
  // Only labels that are more than a millionth as likely as the best count.
  constexpr float kLeastLog = -14;
  float total = 0;
  for (std::size_t i = 1; i < count; ++i) {
    const float log = sum[i] - sum[best];
    if (log > kLeastLog) total += std::exp(log);
  }
  return {static_cast<std::uint8_t>(best), 1 / total};
}

}  // namespace swiftlet
