#pragma once
// Limits how much the live view sends, and how large its images are.
//
// A viewer receives at most kMostBytes a second: bytes sent are taken from an account that grows by kRate and
// never holds more than kBurst. Patches are always sent; images only while the account is not overdrawn. So
// the image rate drops at once when bytes are short. Size and quality follow once a second: one level down if
// a third of the images had to be omitted or the fastest viewer took less than half of them; one level up if
// the next level would fit. After a level was too much, no higher one is tried for kPause. One thread. Cost:
// O(1).

#include <array>
#include <cstddef>

#include "firmware_host/outputs/view/picture_coder.hpp"

namespace swiftlet {

class ViewBudget {
 public:
  static constexpr double kMostBytes = 3e6;  ///< per second and viewer, everything included
  /// Bytes per second. Less than kMostBytes by a burst, a map's surface (0.45 MB) and one pair of images.
  static constexpr double kRate = 2e6;
  static constexpr double kBurst = 0.2e6;  ///< bytes
  static constexpr double kPause = 10;     ///< s
  /// Best first. A picture of one level has about kGrowth times the bytes of the next.
  static constexpr std::array<PictureSize, 5> kLevels{
      {{960, 70}, {640, 70}, {480, 60}, {320, 50}, {200, 40}}};
  static constexpr double kGrowth = 3;

  /// Bytes sent to the viewers, images or other.
  void spend(std::size_t bytes);
  void spendOnImages(std::size_t bytes);
  /// Whether images may be sent now. `now`: host's clock [s].
  [[nodiscard]] bool mayShow(double now);
  /// Call at each turn; once a second the level is adapted. `taken`: called only then; share of the images
  /// since its last call that the fastest viewer has taken.
  template <typename Taken>
  void adapt(double now, Taken&& taken) {
    if (now - looked_ < 1) return;
    look(now, taken());
  }

  [[nodiscard]] const PictureSize& pictures() const { return kLevels[level_]; }
  [[nodiscard]] std::size_t level() const { return level_; }

 private:
  void look(double now, double taken);

  double account_ = kBurst;
  double filled_ = -1;  ///< host time of the last refill; negative: never
  double looked_ = 0;
  double up_from_ = 0;  ///< no level up before this time
  std::size_t level_ = 1;
  std::size_t spent_ = 0, on_images_ = 0;  ///< since looked_
  int offered_ = 0, left_out_ = 0;         ///< instants, since looked_
};

}  // namespace swiftlet
