#pragma once
// Rows of the accuracy table, the committed file, and the rule that compares the two.

#include <iosfwd>
#include <string>
#include <vector>

namespace swiftlet {

struct AccuracyRow {
  std::string log;
  int cameras = 2;
  std::string trajectory;  ///< odometry (causal), states (fixed lag), map (full smoothing)
  double all = 0;          ///< m, ATE RMSE with SE(3) fit over all poses
  double from_3s = 0;      ///< m, the same from 3 s after the first image

  [[nodiscard]] bool sameCase(const AccuracyRow& other) const {
    return log == other.log && cameras == other.cameras && trajectory == other.trajectory;
  }
};

/// A figure may grow by the larger of these before it counts as worse.
inline constexpr double kAllowedShare = 0.05;
inline constexpr double kAllowedMetres = 0.0003;

/// True when `now` exceeds `before` by more than what is allowed, or is no number.
bool isWorse(double now, double before);

/// What got worse than a committed number, a line each: "log, 2 cameras, odometry, all: 0.0120 m, committed
/// 0.0070 m".
std::vector<std::string> findWorse(const std::vector<AccuracyRow>& now,
                                   const std::vector<AccuracyRow>& before);

/// Committed rows that a run no longer produces, a line each: "log, 2 cameras, map".
std::vector<std::string> findLost(const std::vector<AccuracyRow>& now,
                                  const std::vector<AccuracyRow>& before);

/// The committed rows after `now`: new figures replace the old ones. What the logs of `now` no longer produce
/// goes, rows of other logs stay.
std::vector<AccuracyRow> updatedRows(const std::vector<AccuracyRow>& now, std::vector<AccuracyRow> before);

/// `log,cameras,trajectory,all_m,from_3s_m`, 4 decimals; no number is an empty field. Throws
/// std::runtime_error naming the line.
std::vector<AccuracyRow> readAccuracyRows(std::istream& in);
void writeAccuracyRows(std::ostream& out, const std::vector<AccuracyRow>& rows);

/// A markdown table with the committed figures beside the new ones.
std::string accuracyMarkdown(const std::vector<AccuracyRow>& now, const std::vector<AccuracyRow>& before);

}  // namespace swiftlet
