#pragma once
// Distance to the nearest surface, direction away from it, and radius of known space, for planners, in a
// window around the vehicle.
//
// A window of cells that follows the vehicle, in fixed memory. The writer (the map thread) sets which cells
// hold surface, are free or unknown. update() recomputes the nearest surface cell of every cell (exactly, by
// NearestSeeds) and the distance to the nearest unknown cell; its cost does not depend on how much changed.
//
// Readers on other threads query without locks or waiting. The window is stored in atomic 32-bit words. Cells
// one window size apart share a slot; a tag in each word tells which of them it describes. A query during an
// update sees old or new words; if the surface that a word refers to has disappeared, the answer is "at
// least".
//
// Frames: map; metres. Errors: none; the writer ignores cells outside the window, and queries there return
// unknown. Memory: 13 bytes a cell. Cost: an update about 40 ms for the default window, a query about 1 us.
// docs/distance.md.

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mapping/distance/distance_sample.hpp"
#include "mapping/distance/known_range.hpp"
#include "mapping/distance/nearest_seeds.hpp"

namespace swiftlet {

/// Size of the window and reach of distances.
struct DistanceLimits {
  Eigen::Vector3i cells{200, 200, 96};  ///< each a multiple of kDistanceStep; 10 x 10 x 4.8 m
  double cell_size = 0.05;              ///< m
  int reach = 40;                       ///< cells, at most kMostReach
};
/// The window moves in steps of this many cells.
inline constexpr int kDistanceStep = 8;
static_assert(kDistanceStep == NearestSeeds::kColumns);

class DistanceField {
 public:
  explicit DistanceField(const DistanceLimits& limits = {});

  // For one writer.

  /// Sets the stamp of the newest image in the map.
  void announce(Stamp newest) { newest_.store(newest.ns, std::memory_order_relaxed); }
  /// Keeps `p_map` near the middle of the window. Cells that leave are forgotten; cells that enter are
  /// unknown until the caller sets them. True if the window moved.
  bool follow(const Eigen::Vector3d& p_map);
  /// Sets cells without surface in a row of kDistanceStep cells along x from `first` (its x a multiple of
  /// kDistanceStep). Only cells whose bit is set in `cells` are written.
  void setSpaces(const Eigen::Vector3i& first, std::uint32_t cells,
                 const std::array<Space, kDistanceStep>& space);
  /// Sets a cell that holds surface.
  void setSurface(const Eigen::Vector3i& cell, Space space, const CellSurface& point);
  /// Recomputes the distances after changes. `up_to`: all images up to this stamp are in the cells.
  void update(Stamp up_to);

  // For any reader, on any thread.

  /// The sample at a point, interpolated between cells.
  [[nodiscard]] DistanceSample query(const Eigen::Vector3d& p_map) const;

  [[nodiscard]] const DistanceLimits& limits() const { return limits_; }
  [[nodiscard]] Eigen::Vector3i cellOf(const Eigen::Vector3d& p_map) const;
  [[nodiscard]] Eigen::Vector3d centreOf(const Eigen::Vector3i& cell) const;
  [[nodiscard]] std::size_t bytes() const;
  /// First cell of the window. Writer's thread.
  [[nodiscard]] const Eigen::Vector3i& origin() const { return origin_; }
  /// Whether the cell holds surface. Writer's thread.
  [[nodiscard]] bool holdsSurface(const Eigen::Vector3i& cell) const;

 private:
  using Word = std::atomic<std::uint32_t>;
  struct Holder;
  struct Corner;

  [[nodiscard]] bool inside(const Eigen::Vector3i& cell) const;
  [[nodiscard]] std::size_t slotOf(const Eigen::Vector3i& cell) const;
  [[nodiscard]] std::uint32_t tagOf(const Eigen::Vector3i& cell) const;
  void put(std::size_t slot, int y, std::uint32_t word);
  void clearSlab(int axis, int first, int last);
  void publishOrigin();
  [[nodiscard]] Eigen::Vector3i shownOrigin() const;
  void findUnknown();
  void findSurfaces();
  void writeLines(int x, int z);
  [[nodiscard]] bool corners(const Eigen::Vector3i& first, std::array<Corner, 8>& out) const;
  bool findHolder(const Eigen::Vector3i& first, Holder& holder) const;
  [[nodiscard]] Holder descend(const Eigen::Vector3i& first, const Eigen::Vector3f& part,
                               const std::array<Corner, 8>& corner) const;
  static void interpolate(const std::array<Corner, 8>& corner, const Holder& near_point,
                          const Eigen::Vector3d& part, DistanceSample& out);

  DistanceLimits limits_;
  Eigen::Vector3i origin_;
  std::atomic<std::uint64_t> shown_origin_{0};
  std::atomic<std::int64_t> newest_{0}, up_to_{0};
  // By slot. Groups of sixteen cells (8 along x, 2 along z) are ordered by x, then z, then y.
  std::vector<Word> state_;    ///< the space of the cell, and the surface in it
  std::vector<Word> nearest_;  ///< its nearest surface, and the radius of known space
  // Used only by the writer. One bit per slot:
  std::vector<std::uint8_t> surface_bits_, unknown_bits_;
  std::vector<std::uint8_t> surface_changed_, unknown_changed_;  ///< since update(), by y in the window
  bool changed_ = false;
  NearestSeeds surfaces_;
  KnownRange known_;
};

}  // namespace swiftlet
