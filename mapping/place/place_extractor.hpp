#pragma once
// A keyframe's features for place recognition: corners all over the image at several scales, and the
// odometry's tracked features, each with a descriptor of 256 bits.
//
// Corners: FAST-9/16 scores (fast_score.hpp) that are the maximum of their 3 x 3 pixels, in octaves of
// ratio 1.2. Each octave gets a share of the features in proportion to its side, and takes them from the
// cells of a grid in turn, the best of every cell first, so that the image is covered. Tracked features come
// first: they are described in the octave where they are most of a corner, and keep the odometry's pixel and
// name.
//
// Features keep the pixel of the distorted image and the unit bearing of camera 0; those where the camera
// model has no inverse are left out. inverse_depth stays 0: others fill it in.
//
// Memory: reserved by the constructor, some 7 bytes a pixel of the image. No allocation after it, no
// randomness: the same image gives the same bytes. Cost for 752 x 480 and 400 features: see docs/place.md.

#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "mapping/place/byte_lanes.hpp"
#include "mapping/place/place_keyframe.hpp"
#include "mapping/place/place_pyramid.hpp"
#include "mapping/place/steered_brief.hpp"

namespace swiftlet {

struct PlaceExtractorSettings {
  int features = 400;  ///< at most, tracked ones included; up to kMaxPlaceFeatures
  int tracked = 200;   ///< of these at most the odometry's
  int octaves = 8;     ///< 1 to kMaxOctaves
  int min_score = 7;   ///< grey levels: least contrast of a corner
};

class PlaceExtractor {
 public:
  PlaceExtractor(int width, int height, const PlaceExtractorSettings& settings = {});

  /// Fills `keyframe` but for its epoch and the depths. `tracked` gives index, stamp and the odometry's
  /// features (those that camera 0 sees); without features only corners are described. kInvalidInput (and no
  /// features) for an image of another size, kDegenerate for an image without any corner.
  template <typename Lanes = byte_lanes::Native>
  [[nodiscard]] Status extract(const ImageView& image, const CameraModel& camera, const TrackedFrame& tracked,
                               PlaceKeyframe& keyframe);

 private:
  struct Spot {
    std::int16_t x = 0;
    std::int16_t y = 0;
    std::uint8_t score = 0;
    std::uint8_t rank = 0;  ///< in its cell, best first
    float strength = 0;     ///< Harris' measure, among the best scores of a cell
  };
  static constexpr std::size_t kPerCell = 9;
  struct Cell {
    std::array<Spot, kPerCell> best;
    std::size_t count = 0;
  };

  static bool stronger(const Spot& a, const Spot& b);
  template <typename Lanes>
  void score(int octave);
  template <typename Lanes>
  void findSpots(int octave, int wanted);
  void orderSpots(int octave, int cells);
  void keepInCell(Cell& cell, const Spot& spot) const;
  [[nodiscard]] bool inside(int octave, int x, int y) const;
  [[nodiscard]] int share(int octave, int features) const;
  [[nodiscard]] std::uint8_t scoreNear(int octave, int x, int y) const;
  void addTracked(const CameraModel& camera, const TrackedFrame& tracked, PlaceKeyframe& keyframe);
  void addCorners(int octave, int wanted, const CameraModel& camera, PlaceKeyframe& keyframe);
  [[nodiscard]] bool add(int octave, int x, int y, const Eigen::Vector2f& pixel, const CameraModel& camera,
                         PlaceKeyframe& keyframe) const;

  PlaceExtractorSettings settings_;
  PlacePyramid pyramid_;
  SteeredBrief brief_;
  std::array<std::vector<std::uint8_t>, kMaxOctaves> scores_;  ///< as the pyramid's levels
  std::vector<std::uint8_t> peaks_;                            ///< of a row
  std::vector<Cell> cells_;
  std::vector<Spot> spots_;  ///< of the octave in hand, in the order in which they are wanted
};

}  // namespace swiftlet
