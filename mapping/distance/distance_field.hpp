#pragma once
// How far it is to the nearest surface, which way leads from it, and how far all is known: for planners,
// around the vehicle.
//
// A window of cells that follows the vehicle, in fixed memory. The writer (the map thread) says which cells
// the surface passes through, which are free and which unknown; update() finds the nearest surface cell of
// every cell anew (NearestSeeds: exact), and how far it is to the nearest unknown one. Its cost does not
// depend on how much changed. Readers on other threads ask without locks or waiting: the window is arrays of
// 32-bit words, each written and read whole, and each says which of the places that share its slot it is of.
// A reader beside an update finds old words or new ones; what a word names and is no longer there counts as
// "at least". Frames: map; metres. Errors: none; what lies outside the window is ignored by the writer and
// unknown to the reader. Memory: 13 bytes a cell. Cost: an update about 40 ms for the default window; a query
// below 1 us. docs/distance.md.

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

/// The cells of the window, and how far surfaces are felt.
struct DistanceLimits {
  Eigen::Vector3i cells{200, 200, 96};  ///< each a multiple of kDistanceStep; 10 x 10 x 4.8 m
  double cell_size = 0.05;              ///< m
  int reach = 40;                       ///< cells, at most kMostReach
};
/// The window moves in steps of so many cells.
inline constexpr int kDistanceStep = 8;
static_assert(kDistanceStep == NearestSeeds::kColumns);

class DistanceField {
 public:
  explicit DistanceField(const DistanceLimits& limits = {});

  // For one writer.

  /// The map has an image of this time.
  void announce(Stamp newest) { newest_.store(newest.ns, std::memory_order_relaxed); }
  /// Keeps `p_map` near the window's middle. What leaves the window is forgotten; what enters is unknown: the
  /// caller gives it again where it is known. True when the window moved.
  bool follow(const Eigen::Vector3d& p_map);
  /// Cells without surface in a row along x from `first` on, x a multiple of kDistanceStep: those whose bit
  /// is set in `cells`.
  void setSpaces(const Eigen::Vector3i& first, std::uint32_t cells,
                 const std::array<Space, kDistanceStep>& space);
  /// A cell that the surface passes through.
  void setSurface(const Eigen::Vector3i& cell, Space space, const CellSurface& point);
  /// Brings the distances up to what the cells say, which is all that images up to `up_to` gave.
  void update(Stamp up_to);

  // For any reader, on any thread.

  /// At a point, interpolated between cells.
  [[nodiscard]] DistanceSample query(const Eigen::Vector3d& p_map) const;

  [[nodiscard]] const DistanceLimits& limits() const { return limits_; }
  [[nodiscard]] Eigen::Vector3i cellOf(const Eigen::Vector3d& p_map) const;
  [[nodiscard]] Eigen::Vector3d centreOf(const Eigen::Vector3i& cell) const;
  [[nodiscard]] std::size_t bytes() const;
  /// First cell of the window. Writer's thread.
  [[nodiscard]] const Eigen::Vector3i& origin() const { return origin_; }
  /// A surface passes through the cell, as the writer was told. Writer's thread.
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
  // By slot: for each eight of x, for each two of z, for each y these sixteen cells.
  std::vector<Word> state_;    ///< the cell's space, and the surface in it
  std::vector<Word> nearest_;  ///< where its nearest surface is, how far all is known
  // The writer's: bits of the same slots, and what changed since the last update, by y in the window.
  std::vector<std::uint8_t> surface_bits_, unknown_bits_;
  std::vector<std::uint8_t> surface_changed_, unknown_changed_;
  bool changed_ = false;
  NearestSeeds surfaces_;
  KnownRange known_;
};

}  // namespace swiftlet
