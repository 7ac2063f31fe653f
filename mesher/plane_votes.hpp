#pragma once
// Where the faces of a mesh agree on a horizontal or a vertical plane: two histograms.
//
//  - horizontal: height of the vertices of faces that look up or down (one histogram each);
//  - vertical: azimuth and distance. A face votes for all azimuths that its noisy normal may stand for, each
//    with the distance that its vertices have along it: only on the true azimuth do the faces of a wall meet
//    in one distance (Hough).
// A vote weighs as much as the face's area, up to a limit: a few large triangles are no surface.
// Distances from the viewer. Memory: 250 kB. Cost: 21 additions a vertical face, 6 a horizontal one; a search
// reads the rows that have changed.

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
  /// Adds a face's vote, or with `sign` -1 takes it back.
  void vote(const MeshFace& face, const FaceFacts& facts, const MeshFacts& mesh, float sign);
  /// The bin with the largest weight, if that is at least `least` [m^2].
  [[nodiscard]] std::optional<PlaneGuess> strongest(float least);
  /// Empties a guess's bin and its neighbours: it led nowhere.
  void suppress(const PlaneGuess& guess);

 private:
  void spread(std::size_t row, float distance, float weight);
  [[nodiscard]] std::size_t rowOf(const PlaneGuess& guess) const;

  // Rows of kDistanceBins: heights of what looks up, of what looks down, then one for each azimuth.
  std::vector<float> bins_;
  std::vector<float> highest_;             // of each row
  std::vector<std::uint8_t> stale_;        // the row has changed since
  std::vector<Eigen::Vector3f> azimuths_;  // unit, of each row's middle
};

}  // namespace swiftlet
