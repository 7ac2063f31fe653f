#pragma once
// Histograms in which the faces of a mesh vote for horizontal and vertical planes.
//
//  - horizontal: height of the vertices of faces that look up or down (one histogram each);
//  - vertical: azimuth and distance. A face votes for all azimuths within the noise of its normal, each with
//    the distance of its vertices along that azimuth. Only at the true azimuth do the faces of a wall agree
//    on one distance (Hough).
// A vote weighs as much as the area of the face, up to a limit, because a few large triangles are no surface.
// Distances are from the viewer. Memory: 250 kB. Cost: 21 additions per vertical face, 6 per horizontal one;
// a search reads the rows that have changed.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/plane_report.hpp"
#include "mesher/plane_facts.hpp"

namespace swiftlet {

/// n . p = distance from the viewer.
struct PlaneGuess {
  PlaneDirection direction = PlaneDirection::kHorizontal;
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  float distance = 0;  ///< m
};

class PlaneVotes {
 public:
  PlaneVotes();

  void clear();
  /// Adds a face's vote; with `sign` -1 removes it.
  void vote(const MeshFace& face, const FaceFacts& facts, const MeshFacts& mesh, float sign);
  /// The bin of largest weight, if that is at least `least` [m^2].
  [[nodiscard]] std::optional<PlaneGuess> strongest(float least);
  /// Empties the bin of a rejected guess and its neighbours.
  void suppress(const PlaneGuess& guess);

 private:
  void spread(std::size_t row, float distance, float weight);
  [[nodiscard]] std::size_t rowOf(const PlaneGuess& guess) const;

  // Rows of kDistanceBins: heights of faces that look up, of faces that look down, then one row per azimuth.
  std::vector<float> bins_;
  std::vector<float> highest_;             // largest bin of each row
  std::vector<std::uint8_t> stale_;        // of each row: changed since highest_ was computed
  std::vector<Eigen::Vector3f> azimuths_;  // unit, at the middle of each row
};

}  // namespace swiftlet
