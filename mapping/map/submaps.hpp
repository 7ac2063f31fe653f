#pragma once
// The submaps of the map: which images were fused together, and how loops have moved them since.
//
// A submap is what was fused within two seconds of flight while no correction moved the poses. Its anchor is
// its first image. If loop closure moves the anchor, the whole submap moves rigidly: motion() takes a point
// from its fused to its corrected position. Old surface can thus be corrected without its images, at the cost
// of one pose per submap.
//
// Frames: map; world is that of an epoch of the odometry. Memory: kMost entries, reserved at construction;
// when they are used up, the last submap takes all further images of its epoch and none of another (takes()).
// No clock, no randomness. Not thread safe.

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "mapping/volume/block_index.hpp"

namespace swiftlet {

/// Pose of a keyframe in the map and in its odometry's world.
struct WorldInMap {
  std::uint64_t frame = 0;
  std::uint32_t epoch = 0;
  SE3 T_map_body;
  SE3 T_world_body;

  [[nodiscard]] SE3 T_map_world() const { return T_map_body * T_world_body.inverse(); }
};

struct Submap {
  Stamp stamp;              ///< of the anchor
  std::uint64_t frame = 0;  ///< of the anchor
  std::uint32_t epoch = 0;
  SE3 T_world_body;       ///< of the anchor
  SE3 T_map_world_fused;  ///< when its images were fused
  SE3 T_map_world;        ///< corrected by loop closure
  bool tied = false;      ///< of an earlier epoch that loops join to the newest image's

  [[nodiscard]] SE3 motion() const { return T_map_world * T_map_world_fused.inverse(); }
  [[nodiscard]] bool hasMoved() const {
    return T_map_world.translation != T_map_world_fused.translation ||
           T_map_world.rotation.coeffs() != T_map_world_fused.rotation.coeffs();
  }
};

/// Whether poses may be corrected later. Given poses are not; an epoch is then one submap.
enum class MapPoses : std::uint8_t { kEstimated, kGiven };

class Submaps {
 public:
  static constexpr std::size_t kMost = 8192;

  /// `tolerance` [m]: images whose poses in the map disagree by less may share a submap.
  Submaps(MapPoses poses, double tolerance);

  /// Adds a submap of an earlier flight, before the first image. False if there are too many.
  bool addKept(const Submap& submap);
  /// Call before an image is fused. True if the image begins a new submap.
  bool follow(const Submap& image);
  /// False if all submaps are used and the last is of another epoch: images of `epoch` must not be fused.
  [[nodiscard]] bool takes(std::uint32_t epoch) const {
    return submaps_.size() < kMost || submaps_.back().epoch == epoch;
  }
  /// Updates the poses of the submaps. `worlds` are ordered by frame; between two of one epoch the correction
  /// is interpolated by frame number. Submaps of other epochs do not move.
  struct Correction {
    bool moved = false;
    bool tied = false;  ///< a submap has come into the newest image's frame, or left it
  };
  Correction correct(std::span<const WorldInMap> worlds);

  [[nodiscard]] std::size_t size() const { return submaps_.size(); }
  [[nodiscard]] const Submap& operator[](std::size_t id) const { return submaps_[id]; }
  [[nodiscard]] SubmapId newest() const { return static_cast<SubmapId>(submaps_.size() - 1); }
  /// Whether the submap is in the same frame as the newest image.
  [[nodiscard]] bool isInMap(std::size_t id) const {
    return submaps_[id].tied || submaps_[id].epoch == epoch_;
  }
  /// How far the surface of its images would move with another T_map_world [m].
  [[nodiscard]] static double shift(const Submap& submap, const SE3& T_map_world);
  /// Blocks last seen in a submap before this one have not been seen for long.
  [[nodiscard]] SubmapId staleBefore() const { return stale_before_; }
  /// For each submap: 1 if it moved by more than the tolerance, so that newer images begin its blocks anew.
  [[nodiscard]] const std::uint8_t* outdated() const { return outdated_.data(); }
  [[nodiscard]] std::size_t bytes() const;

 private:
  [[nodiscard]] bool isDue(const Submap& image) const;

  MapPoses poses_;
  double tolerance_;
  std::vector<Submap> submaps_;
  std::vector<std::uint8_t> outdated_;
  SubmapId stale_before_ = 0;
  std::uint32_t epoch_ = 0;  ///< of the newest image
};

}  // namespace swiftlet
