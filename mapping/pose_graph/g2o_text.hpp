#pragma once
// Pose graphs as g2o text: VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX.
//
// Memory holds rotation first, in radians (pose_graph.hpp). The text holds translation first and, in space,
// the information of vec(q), half an angle: reading divides its rotation block by 4 and its cross blocks by
// 2. Both are exact in binary, so costs are equal and a written graph reads back equal.
// Accepted: blank lines, comments from # to the end of the line, CRLF, ids of any kind (kept), records in any
// order, several ids after FIX. Without VERTEX lines the poses are those that edges name, ordered by id and
// placed by odometryStart().
// Repaired, counted in a warning: information with negative eigenvalues (clamped to 0), quaternions that are
// not unit (normalized). Warned: records of other kinds (ignored, as g2o does), several pieces (each is held
// by its first pose).
// Rejected with line, field and remedy: missing, extra, malformed or non-finite numbers; information that is
// zero, before or after clamping; quaternions of length 0; self loops; duplicate vertices; edges or FIX that
// name a missing vertex; records of plane and space in one file; a file without poses.
// Cost: linear in the text, plus sorting the ids. Source: the format of g2o's types_slam2d and types_slam3d.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "mapping/pose_graph/pose_graph.hpp"

namespace swiftlet {

struct G2oMessage {
  std::size_t line = 0;  ///< from 1; 0: the whole text
  std::string field;
  std::string text;
  std::string remedy;
};

struct G2oGraph {
  bool planar = true;
  PoseGraph<SE2> plane;              ///< the graph if `planar`
  PoseGraph<SE3> space;              ///< the graph if not `planar`
  std::vector<std::int64_t> ids;     ///< of the poses
  std::vector<std::uint32_t> fixed;  ///< poses named by FIX, in the order of the text
  bool has_poses = false;            ///< the text has VERTEX lines

  [[nodiscard]] std::size_t poseCount() const { return ids.size(); }
  [[nodiscard]] std::size_t edgeCount() const { return planar ? plane.edges.size() : space.edges.size(); }
};

struct G2oReport {
  std::vector<G2oMessage> warnings;
  std::size_t clamped_information = 0;     ///< edges
  std::size_t normalized_quaternions = 0;  ///< of vertices and edges, off by more than 1e-3
  std::size_t records_left_out = 0;
  std::uint32_t pieces = 0;
};

/// False with `fault` if the text is rejected; `graph` is then empty.
bool readG2o(std::string_view text, G2oGraph& graph, G2oReport& report, G2oMessage& fault);

/// Numbers are the shortest decimals that read back equal. Deterministic.
std::string writeG2o(const G2oGraph& graph);

}  // namespace swiftlet
