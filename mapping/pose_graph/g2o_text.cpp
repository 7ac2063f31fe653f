#include "mapping/pose_graph/g2o_text.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <span>

#include "mapping/pose_graph/g2o_fields.hpp"
#include "mapping/pose_graph/graph_layout.hpp"
#include "mapping/pose_graph/odometry_start.hpp"

namespace swiftlet {
namespace {

// A quaternion this close to unit length is left as it is, so that what was written reads back equal.
constexpr double kUnit = 1e-14;          // of the squared length
constexpr double kUnitTolerance = 1e-3;  // of the squared length; beyond, normalizing is worth a warning
constexpr double kNoDirection = 1e-6;    // a shorter quaternion is no rotation
constexpr double kNegative = 1e-12;      // of the largest eigenvalue: rounding below, negative beyond

/// The record kinds of one geometry, with its numbers.
template <typename Pose>
struct Kinds;
template <>
struct Kinds<SE2> {
  static constexpr std::string_view kVertex = "VERTEX_SE2";
  static constexpr std::string_view kEdge = "EDGE_SE2";
  static constexpr std::array<const char*, 3> kPoseFields = {"x", "y", "theta"};
  static constexpr std::array<const char*, 3> kMeasured = {"dx", "dy", "dtheta"};
  static constexpr std::array<int, 3> kToTangent = {1, 2, 0};  ///< place in the text -> in memory
  static constexpr double kHalf = 1;                           ///< text's rotation error over memory's
};
template <>
struct Kinds<SE3> {
  static constexpr std::string_view kVertex = "VERTEX_SE3:QUAT";
  static constexpr std::string_view kEdge = "EDGE_SE3:QUAT";
  static constexpr std::array<const char*, 7> kPoseFields = {"x", "y", "z", "qx", "qy", "qz", "qw"};
  static constexpr std::array<const char*, 7> kMeasured = kPoseFields;
  static constexpr std::array<int, 6> kToTangent = {3, 4, 5, 0, 1, 2};
  static constexpr double kHalf = 0.5;
};

template <typename Pose>
constexpr int kDof = PoseSpace<Pose>::kDof;

/// Factor from the text's information to memory's, for entry (a, b) in memory.
template <typename Pose>
double informationScale(int a, int b) {
  constexpr int kTurns = PoseSpace<Pose>::kRotationDof;
  return (a < kTurns ? Kinds<Pose>::kHalf : 1.0) * (b < kTurns ? Kinds<Pose>::kHalf : 1.0);
}

struct Ends {
  std::int64_t from = 0;
  std::int64_t to = 0;
  std::size_t line = 0;
};

struct IdAt {
  std::int64_t id = 0;
  std::size_t line = 0;
};

class Reader {
 public:
  Reader(G2oGraph& graph, G2oReport& report, G2oMessage& fault)
      : graph_(graph), report_(report), fault_(fault) {}

  bool read(std::string_view text);

 private:
  bool readLine(std::string_view line);
  template <typename Pose>
  bool readVertex(PoseGraph<Pose>& graph);
  template <typename Pose>
  bool readEdge(PoseGraph<Pose>& graph);
  template <typename Pose>
  bool readInformation(typename RelativePose<Pose>::Information& information);
  bool readPose(SE2& pose, std::span<const char* const> names);
  bool readPose(SE3& pose, std::span<const char* const> names);
  bool readFix();
  bool chooseGeometry(bool planar);
  template <typename Pose>
  bool finish(PoseGraph<Pose>& graph);
  void collectIds();
  bool findPose(std::int64_t id, std::uint32_t& pose) const;
  template <typename Pose>
  void warnOfPieces(const PoseGraph<Pose>& graph);
  void warnOfRepairs();
  bool refuse(std::string field, std::string text, std::string remedy);

  G2oGraph& graph_;
  G2oReport& report_;
  G2oMessage& fault_;
  G2oFields fields_;
  bool geometry_known_ = false;
  std::size_t line_ = 0;
  std::vector<IdAt> vertices_;
  std::vector<Ends> ends_;
  std::vector<IdAt> fixed_;
  std::vector<std::pair<std::int64_t, std::uint32_t>> pose_of_id_;  ///< sorted
  std::size_t first_clamped_ = 0;
  std::size_t first_normalized_ = 0;
  std::size_t first_left_out_ = 0;
  std::string kind_left_out_;
};

bool Reader::refuse(std::string field, std::string text, std::string remedy) {
  fault_ = {line_, std::move(field), std::move(text), std::move(remedy)};
  return false;
}

bool Reader::chooseGeometry(bool planar) {
  if (geometry_known_ && graph_.planar != planar) {
    return refuse("record kind", "2D (SE2) and 3D (SE3) records in one file",
                  "Split the file, or give all poses in 2D or in 3D");
  }
  graph_.planar = planar;
  geometry_known_ = true;
  return true;
}

bool Reader::readPose(SE2& pose, std::span<const char* const> names) {
  std::array<double, 3> v{};
  if (!fields_.numbers(names, v, fault_)) return false;
  pose.translation = {v[0], v[1]};
  pose.angle = wrapAngle(v[2]);
  return true;
}

bool Reader::readPose(SE3& pose, std::span<const char* const> names) {
  std::array<double, 7> v{};
  if (!fields_.numbers(names, v, fault_)) return false;
  pose.translation = {v[0], v[1], v[2]};
  pose.rotation = Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  const double length = pose.rotation.coeffs().stableNorm();
  if (!(length > kNoDirection) || !std::isfinite(length)) {
    return refuse("qx qy qz qw", "a quaternion of zero length is not a rotation",
                  "Give a unit quaternion; the identity is 0 0 0 1");
  }
  const double off = std::abs(length * length - 1);
  if (off > kUnitTolerance && report_.normalized_quaternions++ == 0) first_normalized_ = line_;
  if (off > kUnit) pose.rotation.coeffs() /= length;
  return true;
}

template <typename Pose>
bool Reader::readVertex(PoseGraph<Pose>& graph) {
  std::int64_t id = 0;
  Pose pose;
  if (!chooseGeometry(kDof<Pose> == kDof<SE2>) || !fields_.id("id", id, fault_) ||
      !readPose(pose, Kinds<Pose>::kPoseFields) || !fields_.end(fault_)) {
    return false;
  }
  graph.poses.push_back(pose);
  vertices_.push_back({id, line_});
  return true;
}

template <typename Pose>
bool Reader::readInformation(typename RelativePose<Pose>::Information& information) {
  for (int row = 0; row < kDof<Pose>; ++row) {
    for (int column = row; column < kDof<Pose>; ++column) {
      double value = 0;
      const std::string name = "I" + std::to_string(row + 1) + std::to_string(column + 1);
      if (!fields_.number(name.c_str(), value, fault_)) return false;
      const int a = Kinds<Pose>::kToTangent[static_cast<std::size_t>(row)];
      const int b = Kinds<Pose>::kToTangent[static_cast<std::size_t>(column)];
      information(a, b) = information(b, a) = value * informationScale<Pose>(a, b);
    }
  }
  return true;
}

template <typename Pose>
bool Reader::readEdge(PoseGraph<Pose>& graph) {
  Ends ends;
  ends.line = line_;
  RelativePose<Pose> edge;
  if (!chooseGeometry(kDof<Pose> == kDof<SE2>) || !fields_.id("from", ends.from, fault_) ||
      !fields_.id("to", ends.to, fault_) || !readPose(edge.T_from_to, Kinds<Pose>::kMeasured) ||
      !readInformation<Pose>(edge.information) || !fields_.end(fault_)) {
    return false;
  }
  if (ends.from == ends.to) {
    return refuse("to", "the edge joins vertex " + std::to_string(ends.to) + " to itself", "Remove the line");
  }
  const Eigen::SelfAdjointEigenSolver<typename RelativePose<Pose>::Information> eigen(edge.information);
  const auto values = eigen.eigenvalues();
  const double largest = values.cwiseAbs().maxCoeff();
  if (!(values.maxCoeff() > kNegative * largest) || !std::isfinite(largest)) {
    return refuse("information", "has no positive eigenvalue, so the edge carries no information",
                  "Give a positive definite matrix (upper triangle, row by row), or remove the line");
  }
  if (values.minCoeff() < -kNegative * largest) {
    const auto clamped = values.cwiseMax(0.0).eval();
    edge.information =
        (eigen.eigenvectors() * clamped.asDiagonal() * eigen.eigenvectors().transpose()).eval();
    edge.information = (0.5 * (edge.information + edge.information.transpose())).eval();
    if (report_.clamped_information++ == 0) first_clamped_ = line_;
  }
  graph.edges.push_back(edge);
  ends_.push_back(ends);
  return true;
}

bool Reader::readFix() {
  do {
    IdAt fix{0, line_};
    if (!fields_.id("id", fix.id, fault_)) return false;
    fixed_.push_back(fix);
  } while (!fields_.atEnd());
  return true;
}

bool Reader::readLine(std::string_view line) {
  fields_.start(line, line_);
  std::string_view kind;
  if (!fields_.word(kind)) return true;
  if (kind == Kinds<SE2>::kVertex) return readVertex(graph_.plane);
  if (kind == Kinds<SE2>::kEdge) return readEdge(graph_.plane);
  if (kind == Kinds<SE3>::kVertex) return readVertex(graph_.space);
  if (kind == Kinds<SE3>::kEdge) return readEdge(graph_.space);
  if (kind == "FIX") return readFix();
  const bool letter =
      (kind[0] >= 'A' && kind[0] <= 'Z') || (kind[0] >= 'a' && kind[0] <= 'z') || kind[0] == '_';
  if (!letter) {
    return refuse("record kind", "`" + shown(kind) + "` is not a record kind",
                  "Start each line with VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX or #");
  }
  if (report_.records_left_out++ == 0) {
    first_left_out_ = line_;
    kind_left_out_ = shown(kind);
  }
  return true;
}

void Reader::collectIds() {
  graph_.has_poses = !vertices_.empty();
  if (graph_.has_poses) {
    for (const IdAt& vertex : vertices_) graph_.ids.push_back(vertex.id);
  } else {
    for (const Ends& ends : ends_) {
      graph_.ids.push_back(ends.from);
      graph_.ids.push_back(ends.to);
    }
    std::sort(graph_.ids.begin(), graph_.ids.end());
    graph_.ids.erase(std::unique(graph_.ids.begin(), graph_.ids.end()), graph_.ids.end());
  }
  for (std::uint32_t k = 0; k < graph_.ids.size(); ++k) pose_of_id_.emplace_back(graph_.ids[k], k);
  std::sort(pose_of_id_.begin(), pose_of_id_.end());
}

bool Reader::findPose(std::int64_t id, std::uint32_t& pose) const {
  const auto at = std::lower_bound(pose_of_id_.begin(), pose_of_id_.end(), std::pair(id, 0U));
  if (at == pose_of_id_.end() || at->first != id) return false;
  pose = at->second;
  return true;
}

template <typename Pose>
void Reader::warnOfPieces(const PoseGraph<Pose>& graph) {
  std::vector<BlockPair> ends;
  ends.reserve(graph.edges.size());
  for (const RelativePose<Pose>& edge : graph.edges) ends.emplace_back(edge.from, edge.to);
  static_cast<void>(graphPieces(graph.poses.size(), ends, report_.pieces));
  if (report_.pieces > 1) {
    report_.warnings.push_back({0, "edges",
                                "the graph has " + std::to_string(report_.pieces) +
                                    " pieces; each is fixed by its first pose (or its FIX), so their "
                                    "relative positions are arbitrary",
                                "Add edges between the pieces, or solve them one by one"});
  }
}

void Reader::warnOfRepairs() {
  if (report_.records_left_out > 0) {
    report_.warnings.push_back(
        {first_left_out_, kind_left_out_,
         std::to_string(report_.records_left_out) +
             " records that are not a pose, edge or FIX are ignored; this is the first",
         ""});
  }
  if (report_.clamped_information > 0) {
    report_.warnings.push_back({first_clamped_, "information",
                                "negative eigenvalues of " + std::to_string(report_.clamped_information) +
                                    " edges are set to 0; this is the first",
                                "Write positive definite matrices"});
  }
  if (report_.normalized_quaternions > 0) {
    report_.warnings.push_back(
        {first_normalized_, "qx qy qz qw",
         std::to_string(report_.normalized_quaternions) +
             " quaternions are not of unit length and were normalized; this is the first",
         ""});
  }
}

template <typename Pose>
bool Reader::finish(PoseGraph<Pose>& graph) {
  collectIds();
  for (std::size_t k = 1; k < pose_of_id_.size(); ++k) {
    if (pose_of_id_[k].first != pose_of_id_[k - 1].first) continue;
    line_ = vertices_[pose_of_id_[k].second].line;
    return refuse("id",
                  "vertex " + std::to_string(pose_of_id_[k].first) + " is defined again, first in line " +
                      std::to_string(vertices_[pose_of_id_[k - 1].second].line),
                  "Keep one of the two lines");
  }
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    line_ = ends_[e].line;
    const bool has_from = findPose(ends_[e].from, graph.edges[e].from);
    if (!has_from || !findPose(ends_[e].to, graph.edges[e].to)) {
      return refuse(
          has_from ? "to" : "from",
          "no line defines vertex " + std::to_string(has_from ? ends_[e].to : ends_[e].from),
          "Add its VERTEX line, remove the edge, or remove all VERTEX lines to start from the edges");
    }
  }
  std::vector<bool> is_fixed(graph_.ids.size(), false);
  for (const IdAt& fix : fixed_) {
    std::uint32_t pose = 0;
    line_ = fix.line;
    if (!findPose(fix.id, pose)) {
      return refuse("id", "FIX names vertex " + std::to_string(fix.id) + ", which does not exist",
                    "Add its VERTEX line, or remove the FIX");
    }
    if (!is_fixed[pose]) graph_.fixed.push_back(pose);
    is_fixed[pose] = true;
  }
  if (!graph_.has_poses) {
    graph.poses.resize(graph_.ids.size());
    odometryStart(graph);
  }
  warnOfPieces(graph);
  warnOfRepairs();
  return true;
}

bool Reader::read(std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    ++line_;
    if (!readLine(text.substr(0, end))) return false;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  if (vertices_.empty() && ends_.empty()) {
    line_ = 0;
    return refuse(
        "",
        report_.records_left_out > 0
            ? "no pose and no edge among the records (the first is `" + kind_left_out_ + "`)"
            : "no pose and no edge",
        "Check that this is a g2o pose graph (VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT)");
  }
  return graph_.planar ? finish(graph_.plane) : finish(graph_.space);
}

void put(std::string& text, double value) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  text += ' ';
  text.append(digits.data(), end);
}

void put(std::string& text, const SE2& pose) {
  put(text, pose.translation.x());
  put(text, pose.translation.y());
  put(text, pose.angle);
}

void put(std::string& text, const SE3& pose) {
  for (int k = 0; k < 3; ++k) put(text, pose.translation[k]);
  for (int k = 0; k < 4; ++k) put(text, pose.rotation.coeffs()[k]);
}

template <typename Pose>
void write(const PoseGraph<Pose>& graph, const G2oGraph& file, std::string& text) {
  for (std::size_t k = 0; k < graph.poses.size(); ++k) {
    text.append(Kinds<Pose>::kVertex).append(" ").append(std::to_string(file.ids[k]));
    put(text, graph.poses[k]);
    text += '\n';
  }
  for (const std::uint32_t pose : file.fixed) text += "FIX " + std::to_string(file.ids[pose]) + "\n";
  for (const RelativePose<Pose>& edge : graph.edges) {
    text.append(Kinds<Pose>::kEdge).append(" ").append(std::to_string(file.ids[edge.from]));
    text.append(" ").append(std::to_string(file.ids[edge.to]));
    put(text, edge.T_from_to);
    for (int row = 0; row < kDof<Pose>; ++row) {
      for (int column = row; column < kDof<Pose>; ++column) {
        const int a = Kinds<Pose>::kToTangent[static_cast<std::size_t>(row)];
        const int b = Kinds<Pose>::kToTangent[static_cast<std::size_t>(column)];
        put(text, edge.information(a, b) / informationScale<Pose>(a, b));
      }
    }
    text += '\n';
  }
}

}  // namespace

bool readG2o(std::string_view text, G2oGraph& graph, G2oReport& report, G2oMessage& fault) {
  graph = {};
  report = {};
  fault = {};
  if (Reader(graph, report, fault).read(text)) return true;
  graph = {};
  return false;
}

std::string writeG2o(const G2oGraph& graph) {
  std::string text;
  if (graph.planar) {
    write(graph.plane, graph, text);
  } else {
    write(graph.space, graph, text);
  }
  return text;
}

}  // namespace swiftlet
