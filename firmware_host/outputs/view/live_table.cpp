#include "firmware_host/outputs/view/live_table.hpp"

#include <algorithm>

namespace swiftlet {

LiveTable::LiveTable(std::size_t columns, std::size_t judge) : columns_(columns), judge_(judge) {
  for (std::vector<float>& column : columns_) column.reserve(kMost);
}

void LiveTable::add(std::span<const float> row) {
  if (row.size() != columns_.size()) return;
  if (rows() > 0 && row.front() <= columns_.front().back()) return;
  if (rows() == 0) origin_ = row.front();
  if (rows() == kMost) thin();
  for (std::size_t i = 0; i < row.size(); ++i) columns_[i].push_back(row[i]);
}

void LiveTable::sent() {
  unsent_ = rows();
  replaced_ = false;
}

void LiveTable::thin() {
  constexpr std::size_t kParts = kMost / 2;
  const std::vector<float>& time = columns_.front();
  const double length = static_cast<double>(time.back()) - origin_;
  if (stretch_ == 0) stretch_ = length / static_cast<double>(kParts);
  while (length >= stretch_ * static_cast<double>(kParts)) stretch_ *= 2;
  const auto part = [&](std::size_t row) {
    return static_cast<std::size_t>((time[row] - origin_) / stretch_);
  };
  std::vector<std::size_t> kept;
  kept.reserve(kParts);
  std::size_t last = kParts;
  for (std::size_t row = 0; row < rows(); ++row) {
    const std::size_t now = part(row);
    if (now != last) {
      kept.push_back(row);
      last = now;
    } else if (judge_ != kNoJudge && columns_[judge_][row] > columns_[judge_][kept.back()]) {
      kept.back() = row;
    }
  }
  for (std::vector<float>& column : columns_) {
    for (std::size_t i = 0; i < kept.size(); ++i) column[i] = column[kept[i]];
    column.resize(kept.size());
  }
  unsent_ = 0;
  replaced_ = true;
}

}  // namespace swiftlet
