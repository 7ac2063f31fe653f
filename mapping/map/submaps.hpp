#pragma once
// The map's submaps: which images were fused together, and where loops have moved them since.
//
// A submap is what was fused within two seconds of flight while nothing corrected the poses. Its anchor is
// its first image. Where loop closure moves the anchor, all that the submap holds moves with it, as one:
// motion() takes a point from where it was fused to where it belongs. So old surface needs no image any more,
// and each correction costs one pose a submap.
//
// Frames: map; world is the odometry's, of an epoch. Memory: kMost entries, reserved at construction; when
// they are used up the last one goes on. No clock, no randomness. Not thread safe.

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "mapping/volume/block_index.hpp"

namespace swiftlet {

/// Where a keyframe lies in the map, and how its odometry's world does.
struct WorldInMap {
  std::uint64_t frame = 0;
  std::uint32_t epoch = 0;
  SE3 T_map_body;
  SE3 T_world_body;

  [[nodiscard]] SE3 T_map_world() const { return T_map_body * T_world_body.inverse(); }
};

struct Submap {
  Stamp stamp;              ///< of the anchor
  std::uint64_t frame = 0;  ///< the anchor
  std::uint32_t epoch = 0;
  SE3 T_world_body;       ///< of the anchor
  SE3 T_map_world_fused;  ///< with which its images were fused
  SE3 T_map_world;        ///< as loop closure has it by now
  bool tied = false;      ///< by loops to the newest epoch, where it is of another

  [[nodiscard]] SE3 motion() const { return T_map_world * T_map_world_fused.inverse(); }
  [[nodiscard]] bool hasMoved() const {
    return T_map_world.translation != T_map_world_fused.translation ||
           T_map_world.rotation.coeffs() != T_map_world_fused.rotation.coeffs();
  }
};

/// Whether the poses may be corrected later. Given ones are not: an epoch is one submap.
enum class MapPoses : std::uint8_t { kEstimated, kGiven };

class Submaps {
 public:
  static constexpr std::size_t kMost = 8192;

  /// `tolerance` [m]: images whose places in the map disagree by less may share a submap.
  Submaps(MapPoses poses, double tolerance);

  /// Before the first image: of an earlier flight. False: there are too many.
  bool addKept(const Submap& submap);
  /// An image is to be fused: begins a submap where one is due (true).
  bool follow(const Submap& image);
  /// Ordered by frame; between two of one epoch the map moves evenly with the frames' numbers. Submaps of
  /// epochs that are not among them stay. True where one moved.
  bool correct(std::span<const WorldInMap> worlds);

  [[nodiscard]] std::size_t size() const { return submaps_.size(); }
  [[nodiscard]] const Submap& operator[](std::size_t id) const { return submaps_[id]; }
  [[nodiscard]] SubmapId newest() const { return static_cast<SubmapId>(submaps_.size() - 1); }
  /// Whether it lies in the same frame as the newest.
  [[nodiscard]] bool isInMap(std::size_t id) const {
    return submaps_[id].tied || submaps_[id].epoch == submaps_.back().epoch;
  }
  /// By how much what its images show would lie elsewhere with another T_map_world [m].
  [[nodiscard]] static double shift(const Submap& submap, const SE3& T_map_world);
  /// What was seen last in one before this was not seen for long.
  [[nodiscard]] SubmapId staleBefore() const { return stale_before_; }
  /// Of each, 1 where it has moved by more than the tolerance: newer images do not go into its blocks.
  [[nodiscard]] const std::uint8_t* outdated() const { return outdated_.data(); }
  [[nodiscard]] std::size_t bytes() const;

 private:
  [[nodiscard]] bool isDue(const Submap& image) const;

  MapPoses poses_;
  double tolerance_;
  std::vector<Submap> submaps_;
  std::vector<std::uint8_t> outdated_;
  SubmapId stale_before_ = 0;
};

}  // namespace swiftlet
