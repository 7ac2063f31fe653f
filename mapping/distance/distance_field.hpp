#pragma once
// How far it is to the nearest surface, and which way leads from it: for planners, around the vehicle.
//
// A window of cells that follows the vehicle, in fixed memory. The writer (the map thread) says which cells
// the surface passes through and which are free; waves carry the nearest such cell on from cell to cell
// (dynamic brushfire: Lau, Sprunk, Burgard, RAS 61, 2013): a removed one raises the cells that it was nearest
// to, then those around lower them again. Each step takes as many cells from the queue as it may; what is
// left goes on in the next. Readers on other threads ask without locks or waiting: the window is an array of
// 32-bit words, each written and read whole, and each says which of the places that share its slot it is of.
// Frames: map; metres. The distance is that to the surface point inside the nearest cell (not to the cell's
// middle), negative behind the surface. Unknown cells let waves pass: the distance is to all known surface
// within `reach`. Errors: none; what lies outside the window is ignored by the writer and unknown to the
// reader. Memory: 12 bytes a cell. Cost: 0.15 to 0.3 us a cell taken from the queue; a query 0.1 us.
// docs/distance.md.

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace swiftlet {

/// The cells of the window, and how far surfaces are felt.
struct DistanceLimits {
  Eigen::Vector3i cells{200, 200, 96};  ///< each a multiple of kDistanceStep; 10 x 10 x 4.8 m
  double cell_size = 0.05;              ///< m
  int reach = 40;                       ///< cells, at most kMostReach
};
/// The window moves in steps of so many cells.
inline constexpr int kDistanceStep = 8;
/// An offset to the nearest surface is kept in 7 bits an axis.
inline constexpr int kMostReach = 60;

enum class Space : std::uint8_t { kUnknown = 0, kFree = 1, kBehindSurface = 2 };

struct DistanceSample {
  Space space = Space::kUnknown;  ///< of the cell that the point lies in
  double distance = 0;            ///< m; where `bounded` is false, at least this far
  Eigen::Vector3d gradient =
      Eigen::Vector3d::Zero();  ///< unit, away from the surface; zero where not bounded
  bool bounded = false;         ///< a surface lies within reach
};

class DistanceField {
 public:
  explicit DistanceField(const DistanceLimits& limits = {});

  // For one writer.

  /// Keeps `p_map` near the window's middle. What leaves the window is forgotten; what enters is unknown: the
  /// caller gives it again where it is known. True when the window moved.
  bool follow(const Eigen::Vector3d& p_map);
  /// A cell without surface in it.
  void setSpace(const Eigen::Vector3i& cell, Space space);
  /// The same for cells in a row along x from `first` on, x a multiple of kDistanceStep: those whose bit is
  /// set in `cells`.
  void setSpaces(const Eigen::Vector3i& first, std::uint32_t cells,
                 const std::array<Space, kDistanceStep>& space);
  /// A cell that the surface passes through, at `offset` [cells] from its middle, each component within +-1.
  void setSurface(const Eigen::Vector3i& cell, Space space, const Eigen::Vector3f& offset);
  /// Takes at most `work` cells from the queue; returns how many it took.
  std::size_t propagate(std::size_t work);
  [[nodiscard]] std::size_t queued() const { return queued_; }

  // For any reader, on any thread.

  /// The distance at a point, interpolated between cells. False outside the window.
  bool query(const Eigen::Vector3d& p_map, DistanceSample& out) const;

  [[nodiscard]] const DistanceLimits& limits() const { return limits_; }
  /// First cell of the window. Writer's thread.
  [[nodiscard]] const Eigen::Vector3i& origin() const { return origin_; }
  [[nodiscard]] Eigen::Vector3i cellOf(const Eigen::Vector3d& p_map) const;
  [[nodiscard]] Eigen::Vector3d centreOf(const Eigen::Vector3i& cell) const;
  /// Squared distance [cells^2] of a cell's middle to its nearest surface point; negative where none is in
  /// reach.
  [[nodiscard]] float squaredDistance(const Eigen::Vector3i& cell) const;
  /// A surface passes through the cell, as the writer was told. Writer's thread.
  [[nodiscard]] bool holdsSurface(const Eigen::Vector3i& cell) const;
  [[nodiscard]] std::size_t bytes() const;

 private:
  using Word = std::atomic<std::uint32_t>;
  /// Side by side, as waves ask for both.
  struct Cell {
    Word nearest{0};    ///< where its nearest surface is
    float squared = 0;  ///< to it, as it was taken [cells^2]
  };
  struct Around;
  struct Corner {
    float distance = 0;  ///< cells, signed
    bool known = false;  ///< the slot is of this cell
    bool bounded = false;
    Space space = Space::kUnknown;
  };

  [[nodiscard]] bool inside(const Eigen::Vector3i& cell) const;
  [[nodiscard]] std::uint32_t partOfSlot(int axis, int at) const;
  [[nodiscard]] std::uint32_t slotOf(const Eigen::Vector3i& cell) const;
  [[nodiscard]] std::uint32_t tagOf(const Eigen::Vector3i& cell) const;
  [[nodiscard]] Eigen::Vector3i cellAt(std::uint32_t slot) const;
  [[nodiscard]] bool holdsTrue(const Eigen::Vector3i& surface, std::uint32_t nearest) const;
  [[nodiscard]] std::uint32_t linkTo(const Eigen::Vector3i& cell, const Eigen::Vector3i& surface) const;
  [[nodiscard]] float squaredTo(const Eigen::Vector3i& surface, const Eigen::Vector3i& cell) const;
  [[nodiscard]] Corner corner(const Eigen::Vector3i& cell) const;
  void setState(std::uint32_t slot, const Eigen::Vector3i& cell, Space space);
  void dropSurface(std::uint32_t slot, const Eigen::Vector3i& cell);
  void push(std::uint32_t slot, float squared);
  bool pop(std::uint32_t& slot);
  [[nodiscard]] Around around(const Eigen::Vector3i& cell) const;
  template <typename Visit>
  static void forNeighbours(const Around& around, const Visit& visit);
  void raise(std::uint32_t slot, const Eigen::Vector3i& cell, const Around& neighbours);
  void lower(const Around& neighbours, const Eigen::Vector3i& offset, std::uint32_t link,
             const Word& surface);
  void remove(std::uint32_t slot);
  void takeOwn(std::uint32_t slot, const Eigen::Vector3i& cell);
  void askAnew(std::uint32_t slot, const Eigen::Vector3i& cell);
  void clearSlab(int axis, int first, int last);
  void wakeLayer(int axis, int at);
  void publishOrigin();

  DistanceLimits limits_;
  float squared_reach_;
  std::array<std::uint32_t, 3> brick_stride_{};  ///< slots from a brick to the next along each axis
  Eigen::Vector3i origin_;
  std::atomic<std::uint64_t> shown_origin_{0};
  std::vector<Cell> cell_;           ///< of each slot
  std::vector<Word> surface_;        ///< of each slot: the surface in it
  std::vector<std::uint32_t> next_;  ///< in the queue
  std::vector<std::uint32_t> head_;  ///< of the queue, by distance
  std::size_t lowest_ = 0;           ///< no lower bucket holds a cell
  std::size_t queued_ = 0;
};

}  // namespace swiftlet
