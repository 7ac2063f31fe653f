#pragma once
// Figures over time in bounded memory: rows of 32-bit floats; the first column is the rising time.
//
// A full table is thinned: time is divided into at most kMost / 2 equal stretches, and one row of each is
// kept, the one with the highest value in the column `judge`, or the first if there is no such column. The
// stretches double whenever there are too many, so that repeated thinning removes nothing from the same
// place. Old figures become coarser the longer a run lasts; the newest keep their rate. Cost of add(): O(1);
// thinning: O(rows), at most once in kMost / 2 rows.

#include <cstddef>
#include <span>
#include <vector>

namespace swiftlet {

class LiveTable {
 public:
  static constexpr std::size_t kMost = 1500;
  static constexpr std::size_t kNoJudge = static_cast<std::size_t>(-1);

  explicit LiveTable(std::size_t columns, std::size_t judge = kNoJudge);

  /// `row` has one value per column. A row whose time does not rise is omitted.
  void add(std::span<const float> row);

  [[nodiscard]] std::size_t rows() const { return columns_.front().size(); }
  [[nodiscard]] std::span<const float> column(std::size_t index, std::size_t from = 0) const {
    return std::span<const float>(columns_[index]).subspan(from);
  }

  /// First row added after the last sent(); 0 if all must be sent again.
  [[nodiscard]] std::size_t unsent() const { return unsent_; }
  /// Whether the rows were thinned since the last sent().
  [[nodiscard]] bool replaced() const { return replaced_; }
  void sent();

 private:
  void thin();

  std::vector<std::vector<float>> columns_;
  std::size_t judge_;
  double origin_ = 0;   ///< start of the stretches: the first row's time
  double stretch_ = 0;  ///< 0: never thinned
  std::size_t unsent_ = 0;
  bool replaced_ = false;
};

}  // namespace swiftlet
