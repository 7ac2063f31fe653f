#pragma once
// The nearest seed of every cell of a window, within reach: exact, in three passes, one for each axis.
//
// A pass along a line gives each cell the least of (squared distance in the axes before + square of the
// steps along this one); the least of such sums is exact however the axes are ordered (Felzenszwalb,
// Huttenlocher, "Distance Transforms of Sampled Functions", Theory of Computing 8, 2012). Within a reach no
// envelope of parabolas is needed: cells ask their line outwards, step by step, until no step can gain, and
// lines lie side by side in vector lanes. Which seed it is stays in the low bits of the same word, so that
// the least word names it; of seeds as near the one with the least word is taken. Along x seeds are bits.
// Used so: for each y the seeds of a plane, transformPlane(y); then transformLines() for all columns. A plane
// that did not change need not be given again. Errors: none. Memory: 4 bytes a cell. Cost: some 5 ns a cell
// at a reach of 40. No allocation after the constructor. Not thread safe.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace swiftlet {

/// Steps to a seed are kept in 7 bits an axis.
inline constexpr int kMostReach = 60;

class NearestSeeds {
 public:
  static constexpr int kColumns = 8;  ///< cells along x whose lines are transformed together
  static constexpr int kLayers = 2;   ///< the same along z
  /// Squared distance, whether the seed lies at a lower y, steps to it along z and x: from high bits to low.
  /// About kNever where none is in reach.
  using Word = std::uint32_t;
  static constexpr Word kNever = 1U << 31U;
  struct alignas(32) Columns : std::array<Word, kColumns> {};
  using Block = std::array<Columns, kLayers>;  ///< of one y

  /// `cells`: even along z. `reach` in cells, at most kMostReach. `gap`: cells' own size: that much is taken
  /// from the steps along each axis before they are squared (1: distance between cells' faces).
  NearestSeeds(const Eigen::Vector3i& cells, int reach, int gap = 0);

  /// Row z of the plane in hand: cell x is bit x % 8 of byte x / 8. To be filled by the caller.
  std::span<std::uint8_t> seeds(int z);
  /// The plane in hand is the one at `y`.
  void transformPlane(int y);
  /// Of the cells x to x + kColumns - 1, z and z + 1, for every y. Valid until the next call.
  std::span<const Block> transformLines(int x, int z);

  static int squaredOf(Word word) { return static_cast<int>(word >> kSquareShift); }
  // Steps to the seed, where one is in reach.
  static int xOf(Word word) { return static_cast<int>(word & kStepMask) - kBias; }
  static int zOf(Word word) { return static_cast<int>(word >> kZShift & kStepMask) - kBias; }
  static int yOf(Word word) {
    const int squared = squaredOf(word) - xOf(word) * xOf(word) - zOf(word) * zOf(word);
    const auto y = static_cast<int>(std::sqrt(static_cast<float>(std::max(squared, 0))) + 0.5F);
    return (word >> kBeforeBit & 1U) != 0 ? -y : y;
  }

  [[nodiscard]] std::size_t bytes() const;

 private:
  static constexpr unsigned kZShift = 7, kBeforeBit = 14, kSquareShift = 15;
  static constexpr Word kStepMask = (1U << kZShift) - 1;
  static constexpr int kBias = 64;

  /// What a step along an axis adds to a word, forwards (seed at a higher place) and backwards.
  struct Steps {
    std::vector<Word> forward, backward;
  };
  using Line = std::vector<Block>;

  [[nodiscard]] Word squareOf(int steps) const;
  [[nodiscard]] std::size_t placeOf(int y, int block) const {
    return (static_cast<std::size_t>(y) * static_cast<std::size_t>(blocks_) +
            static_cast<std::size_t>(block)) *
           static_cast<std::size_t>(cells_.z());
  }
  void transformRow(std::span<const std::uint8_t> seeds);
  void fillBetween(int before, int after);
  void alongLine(int count, const Steps& steps);

  Eigen::Vector3i cells_;
  int reach_;
  int gap_;
  int margin_;  ///< cells that a line is asked for beyond its ends
  int blocks_;  ///< of kColumns along x
  Steps in_z_, in_y_;
  std::vector<std::uint8_t> furthest_;  ///< by squared distance: steps that may still gain at the next place
  std::vector<Word> after_seed_, before_seed_;  ///< a row's words beside a seed, outwards and inwards
  std::vector<std::uint8_t> seeds_;             ///< of the plane in hand
  std::vector<Word> row_;
  std::vector<Columns> kept_;  ///< after x and z, by y, block and z
  Line line_;                  ///< in hand, with room before and after it
  Line out_;
};

}  // namespace swiftlet
