#pragma once
// How much the live view sends, and how large its images are.
//
// At most kMostBytes a second go to a viewer: what is sent is taken from an account that grows by kRate and
// never holds more than kBurst. Patches are always sent; images only while the account is not overdrawn. So
// the rate of images falls at once when bytes are short, and their size and quality follow: once a second,
// one level down where a third of them had to be left out or the quickest viewer took less than half of them,
// one level up where the next would fit. A level that was too much is not tried again for kPause.
// One thread. Cost: O(1).

#include <array>
#include <cstddef>

#include "firmware_host/outputs/view/picture_coder.hpp"

namespace swiftlet {

class ViewBudget {
 public:
  static constexpr double kMostBytes = 3e6;  ///< a second and viewer, of all that is sent
  /// Bytes a second. Below kMostBytes by a burst, a map's surface (0.45 MB) and one pair of images.
  static constexpr double kRate = 2e6;
  static constexpr double kBurst = 0.2e6;  ///< bytes
  static constexpr double kPause = 10;     ///< s
  /// The best first. A picture of one level has about kGrowth times the bytes of the next.
  static constexpr std::array<PictureSize, 5> kLevels{
      {{960, 70}, {640, 70}, {480, 60}, {320, 50}, {200, 40}}};
  static constexpr double kGrowth = 3;

  /// Bytes that went to the viewers, images or not.
  void spend(std::size_t bytes);
  void spendOnImages(std::size_t bytes);
  /// Whether images may be sent now. `now`: host's clock [s].
  [[nodiscard]] bool mayShow(double now);
  /// At each turn; once a second the level is looked at. `taken`: asked then only, the share of the images
  /// that the quickest viewer has taken since it was asked last.
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
  double filled_ = -1;  ///< when; negative: never
  double looked_ = 0;
  double up_from_ = 0;  ///< no level up before
  std::size_t level_ = 1;
  std::size_t spent_ = 0, on_images_ = 0;  ///< since looked_
  int offered_ = 0, left_out_ = 0;         ///< instants, since looked_
};

}  // namespace swiftlet
