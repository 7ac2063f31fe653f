#pragma once
// The straight line below a cloud of points (time, offset + delay) whose delays are never negative. It
// estimates the offset plus the smallest delay.
//
// The lowest point of each quarter second is kept, for 32 s. The line is the edge of the points' lower convex
// hull above the mean of their times: of all lines with no point below, it has the smallest sum of distances.
// Its slope is bounded by that of crystals, 150 ppm, unless the steeper line fits far better. While the
// points span too little time for a slope, the last known slope (or zero) is used, through the lowest point.
//
// Cost: add() O(1); O(kBins), about 2 us, when a quarter second ends or a point lies below the line. Memory:
// 2.1 KiB. Accepts any values within +-kStampLimit without overflow.
// Source: S. B. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock skew from network delay
// measurements", INFOCOM 1999; the edge over the mean time: L. Zhang, Z. Liu, C. H. Xia, "Clock
// synchronization algorithms for network measurements", INFOCOM 2002. Hull: A. M. Andrew, 1979.

#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/timesync/stamp_limit.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class LowerEnvelope {
 public:
  static constexpr std::size_t kBins = 128;
  static constexpr Duration kBinWidth = {250'000'000};

  /// Adds one point. Times must not decrease.
  void add(Stamp time, std::int64_t value_ns);
  /// Drops all points and keeps the slope: a clock that has stepped still runs at the same rate.
  void restart() { count_ = 0; }
  /// Drops the points before `time` and keeps the slope.
  void dropBefore(Stamp time);

  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] std::size_t bins() const { return count_; }
  [[nodiscard]] Duration span() const;
  /// 1e-6 = 1 ppm.
  [[nodiscard]] double slope() const { return slope_; }
  /// The line [ns]; call only if not empty. Saturates far from the points.
  [[nodiscard]] std::int64_t at(Stamp time) const;
  /// Height [ns] of a point above the line; call only if not empty.
  [[nodiscard]] double heightOf(Stamp time, std::int64_t value_ns) const;
  /// Estimated error [ns] of the line at `time`: error of the fit plus possible clock drift since the newest
  /// point.
  [[nodiscard]] double uncertainty(Stamp time) const;
  /// Whether the line has risen permanently: in the newest n >= `fewest` closed bins no point came within h
  /// of the line, with n (h - tolerance - error of the fit) >= surprise x roughness. For evenly distributed
  /// jitter the probability of this by chance is about e^-surprise. `since`: the first of these bins. Cost:
  /// O(kBins).
  [[nodiscard]] bool raised(std::size_t fewest, double tolerance, double surprise, Stamp& since) const;
  /// Number of bins closed since construction.
  [[nodiscard]] std::uint64_t closed() const { return closed_; }

 private:
  struct Point {
    std::int64_t time = 0;   ///< device, ns since origin_
    std::int64_t value = 0;  ///< ns above base_
  };
  [[nodiscard]] Point& point(std::size_t i) { return points_[(first_ + i) % kBins]; }
  [[nodiscard]] const Point& point(std::size_t i) const { return points_[(first_ + i) % kBins]; }
  static double rise(const Point& from, const Point& to);
  [[nodiscard]] double line(std::int64_t time) const;
  [[nodiscard]] double height(const Point& p) const { return static_cast<double>(p.value) - line(p.time); }
  void dropOldest();
  void fit();

  Stamp origin_;           ///< time of the first point since the restart
  std::int64_t base_ = 0;  ///< its value
  std::array<Point, kBins> points_{};
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t closed_ = 0;
  std::int64_t bin_ = 0;        ///< number of the newest bin
  std::int64_t reference_ = 0;  ///< where level_ is defined: time of the newest point
  double level_ = 0;            ///< the line's value there
  double slope_ = 0;
  bool slope_known_ = false;
  std::int64_t slope_span_ = 0;  ///< [ns] span of the points that slope_ was taken from
  double mean_excess_ = 0;
  double roughness_ = 0;
};

}  // namespace swiftlet
