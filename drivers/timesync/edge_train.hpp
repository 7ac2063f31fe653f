#pragma once
// Numbers the edges of a periodic trigger by their pulses, despite missed edges and glitches.
//
// The number follows from the time: an edge on the grid of the tracked period is a pulse, any other is a
// glitch. Cameras with the same trigger share one train, so equal numbers mean the same exposure.
//
// - On the grid means within 0.1 periods. If two edges fall on the same position, the one closer to the grid
//   is used.
// - Gaps of up to 16 periods are bridged. After a longer gap, or when four edges in a row agree on another
//   grid, numbering restarts and `epoch` increases.
//
// Cost: O(1). Memory: 256 edges, 4 KiB. Accepts any stamps without overflow.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

class EdgeTrain {
 public:
  /// `period`: nominal, within 2 % of the true one; positive.
  explicit EdgeTrain(Duration period);

  /// Adds one edge, in reading order. `sequence`: the kernel's event number on this line. It shows whether
  /// pulses without an edge were missed or did not exist.
  void add(Stamp edge, std::optional<std::uint32_t> sequence = std::nullopt);

  struct Edge {
    Stamp stamp;
    bool measured = false;  ///< false: not read (yet); computed from its neighbours and the period
  };
  /// The edge of pulse `index` of this epoch; empty if no edge is near.
  [[nodiscard]] std::optional<Edge> at(std::int64_t index) const;
  /// The number of the pulse nearest to `stamp`; empty without edges.
  [[nodiscard]] std::optional<std::int64_t> nearest(Stamp stamp) const;

  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  [[nodiscard]] Duration period() const { return {static_cast<std::int64_t>(period_)}; }
  [[nodiscard]] std::uint64_t edges() const { return edges_; }
  [[nodiscard]] std::uint64_t missed() const { return missed_; }  ///< pulses without an edge
  [[nodiscard]] std::uint64_t glitches() const { return glitches_; }

 private:
  static constexpr std::size_t kKept = 256;
  struct Slot {
    std::int64_t index = -1;
    Stamp stamp;
  };
  void restart(Stamp edge);
  void offGrid(Stamp edge);
  [[nodiscard]] const Slot* slot(std::int64_t index) const;

  double nominal_;  ///< [ns]
  double period_;
  std::array<Slot, kKept> slots_{};
  std::int64_t newest_ = -1;  ///< index
  Stamp grid_;                ///< time of pulse newest_ on the grid
  bool any_ = false;
  std::optional<std::uint32_t> sequence_;
  int others_ = 0;  ///< edges in a row that agree on another grid
  Stamp other_;
  std::uint32_t epoch_ = 0;
  std::uint64_t edges_ = 0;
  std::uint64_t missed_ = 0;
  std::uint64_t glitches_ = 0;
};

}  // namespace swiftlet
