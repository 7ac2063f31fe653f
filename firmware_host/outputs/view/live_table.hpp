#pragma once
// Figures over time in bounded memory: rows of 32-bit floats, the first column rising time.
//
// When the table is full the rows are thinned: of each of at most kMost / 2 equal stretches of time one row
// stays, the one with the highest value of the column `judge`, or where there is none the first. Stretches
// become twice as long whenever there are too many, so that thinning again and again takes nothing from the
// same place. Old figures become coarser the longer a run lasts, the newest keep their rate. Cost of add():
// O(1); thinning: O(rows), once in at least kMost / 2 rows.

#include <cstddef>
#include <span>
#include <vector>

namespace swiftlet {

class LiveTable {
 public:
  static constexpr std::size_t kMost = 1500;
  static constexpr std::size_t kNoJudge = static_cast<std::size_t>(-1);

  explicit LiveTable(std::size_t columns, std::size_t judge = kNoJudge);

  /// `row` has as many values as there are columns; one whose time does not rise is left out.
  void add(std::span<const float> row);

  [[nodiscard]] std::size_t rows() const { return columns_.front().size(); }
  [[nodiscard]] std::span<const float> column(std::size_t index, std::size_t from = 0) const {
    return std::span<const float>(columns_[index]).subspan(from);
  }

  /// First row that came after the last sent(); 0 where all have to be sent anew.
  [[nodiscard]] std::size_t unsent() const { return unsent_; }
  /// The rows were thinned since the last sent().
  [[nodiscard]] bool replaced() const { return replaced_; }
  void sent();

 private:
  void thin();

  std::vector<std::vector<float>> columns_;
  std::size_t judge_;
  double origin_ = 0;   ///< of the stretches: the first row's time
  double stretch_ = 0;  ///< 0: never thinned
  std::size_t unsent_ = 0;
  bool replaced_ = false;
};

}  // namespace swiftlet
