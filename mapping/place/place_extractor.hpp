#pragma once
// Features of a keyframe for place recognition: corners spread over the image at several scales, and the
// odometry's tracked features, each with a descriptor of 256 bits.
//
// Corners are maxima of the FAST-9/16 score (fast_score.hpp) among 3 x 3 pixels, in octaves of ratio 1.2.
// Each octave has a share of the features in proportion to its side and takes them from the cells of a grid
// in turn, the best of every cell first, so that features cover the image. Tracked features come first: they
// are described in the octave where they are most corner-like, and keep the odometry's pixel and id.
//
// Features keep the pixel of the distorted image and the unit bearing of camera 0; those for which the camera
// model has no inverse are left out. inverse_depth stays 0 (feature_depth.hpp sets it).
//
// Memory: reserved by the constructor, some 7 bytes a pixel of the image. No allocation afterwards, no
// randomness: the same image gives the same bytes. Cost for 752 x 480 and 400 features: docs/place.md.

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
  int features = 400;  ///< largest number, including tracked ones; up to kMaxPlaceFeatures
  int tracked = 200;   ///< largest number of the odometry's tracked features
  int octaves = 8;     ///< 1 to kMaxOctaves
  int min_score = 7;   ///< grey levels: least contrast of a corner
};

class PlaceExtractor {
 public:
  PlaceExtractor(int width, int height, const PlaceExtractorSettings& settings = {});

  /// Fills `keyframe` except for its epoch and depths. `tracked` gives index, stamp and the odometry's
  /// features in camera 0; without features only corners are described. kInvalidInput (and no features) for
  /// an image of another size, kDegenerate for an image without a corner.
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
  std::vector<Spot> spots_;  ///< of the present octave, in order of preference
};

}  // namespace swiftlet
