// g2o text: what is read, repaired, refused and written.

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cctype>
#include <ctime>
#include <string>

#include "mapping/pose_graph/g2o_text.hpp"
#include "mapping/pose_graph/pose_error.hpp"
#include "tests/mapping/random_graph.hpp"

namespace swiftlet::test {
namespace {

const std::string kPlane =
    "VERTEX_SE2 0 0 0 0\n"
    "VERTEX_SE2 1 1 0 0.1\n"
    "EDGE_SE2 0 1 1 0 0.1 10 1 2 20 3 30\n";
const std::string kUnit21 = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 4 0 0 4 0 4";
const std::string kSpace =
    "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"
    "VERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"
    "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1" +
    kUnit21 + "\n";

struct Outcome {
  bool taken = false;
  G2oGraph graph;
  G2oReport report;
  G2oMessage fault;
};

Outcome read(const std::string& text) {
  Outcome outcome;
  outcome.taken = readG2o(text, outcome.graph, outcome.report, outcome.fault);
  return outcome;
}

void checkRefused(const std::string& text, std::size_t line, const std::string& field,
                  const std::string& part) {
  INFO(text);
  const Outcome outcome = read(text);
  CHECK_FALSE(outcome.taken);
  CHECK(outcome.fault.line == line);
  CHECK(outcome.fault.field == field);
  INFO(outcome.fault.text);
  CHECK(outcome.fault.text.find(part) != std::string::npos);
  CHECK_FALSE(outcome.fault.remedy.empty());
  CHECK(outcome.graph.poseCount() == 0);
}

TEST_CASE("plane: order of fields, with the cost worked by hand") {
  const Outcome outcome = read(kPlane);
  REQUIRE(outcome.taken);
  CHECK(outcome.graph.planar);
  REQUIRE(outcome.graph.plane.edges.size() == 1);
  PoseGraph<SE2> graph = outcome.graph.plane;
  CHECK(graphCost(graph) == Approx(0).margin(1e-30));
  // Off by 0.2 rad and (0.3, 0.4) m in the measured frame: 1/2 e^T Omega e, text's order x y theta.
  graph.poses[1] = graph.edges[0].T_from_to * SE2(0.2, {0.3, 0.4});
  const Eigen::Vector3d e(0.3, 0.4, 0.2);
  Eigen::Matrix3d omega;
  omega << 10, 1, 2, 1, 20, 3, 2, 3, 30;
  CHECK(graphCost(graph) == Approx(0.5 * e.dot(omega * e)));
  CHECK(outcome.report.warnings.empty());
}

TEST_CASE("space: order of fields and the half angle, with the cost worked by hand") {
  std::string text =
      "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 0 0 0 0 0 0 1\nEDGE_SE3:QUAT 0 1 1 2 3 0 0 0 1";
  Eigen::Matrix<double, 6, 6> omega;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      const double value = row == column ? 100.0 + row : row * 6 + column + 1;
      omega(row, column) = omega(column, row) = value;
      text += " " + std::to_string(value);
    }
  }
  const Outcome outcome = read(text);
  REQUIRE(outcome.taken);
  CHECK_FALSE(outcome.graph.planar);
  PoseGraph<SE3> graph = outcome.graph.space;
  const Eigen::Quaterniond q(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  graph.poses[1] = graph.edges[0].T_from_to * SE3(q, {0.3, 0.4, 0.5});
  Eigen::Matrix<double, 6, 1> e;
  e << 0.3, 0.4, 0.5, q.vec();
  CHECK(graphCost(graph) == Approx(0.5 * e.dot(omega * e)));
}

template <typename Pose>
void checkRoundTrip(std::uint64_t seed) {
  G2oGraph graph;
  graph.planar = PoseSpace<Pose>::kDof == 3;
  const PoseGraph<Pose> made = randomGraph<Pose>(seed, 30, 20, 0.2).graph;
  if constexpr (PoseSpace<Pose>::kDof == 3) {
    graph.plane = made;
  } else {
    graph.space = made;
  }
  for (std::int64_t k = 0; k < 30; ++k) graph.ids.push_back((k * 7919) % 31 * 1000000007LL - 5);
  graph.fixed = {4, 2};
  const std::string once = writeG2o(graph);
  const Outcome first = read(once);
  REQUIRE(first.taken);
  CHECK(first.graph.ids == graph.ids);
  CHECK(first.graph.fixed == graph.fixed);
  CHECK(writeG2o(first.graph) == once);
  const auto& back = [&]() -> const PoseGraph<Pose>& {
    if constexpr (PoseSpace<Pose>::kDof == 3) {
      return first.graph.plane;
    } else {
      return first.graph.space;
    }
  }();
  for (std::size_t e = 0; e < made.edges.size(); ++e) {
    CHECK(back.edges[e].information == made.edges[e].information);
    CHECK(back.edges[e].from == made.edges[e].from);
    CHECK(back.edges[e].to == made.edges[e].to);
  }
  CHECK(graphCost(back) == graphCost(made));
}

TEST_CASE("what is written reads back equal, bit by bit") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    checkRoundTrip<SE2>(seed);
    checkRoundTrip<SE3>(seed);
  }
}

TEST_CASE("files as they come") {
  SECTION("blank lines, comments, CRLF, tabs, no last line end, order of records") {
    const Outcome outcome = read(
        "# a graph\r\n\r\nEDGE_SE2 70 -3\t1 0 0.1 1 0 0 1 0 1 # first\r\n  \nVERTEX_SE2 -3 +1 0 1e-1\r\nFIX "
        "70\r\n"
        "VERTEX_SE2 70 0 0 0");
    REQUIRE(outcome.taken);
    CHECK(outcome.graph.ids == std::vector<std::int64_t>{-3, 70});
    CHECK(outcome.graph.plane.edges[0].from == 1);
    CHECK(outcome.graph.plane.edges[0].to == 0);
    CHECK(outcome.graph.fixed == std::vector<std::uint32_t>{1});
    CHECK(outcome.graph.has_poses);
  }
  SECTION("no vertices: poses from the edges, in the order of ids") {
    const Outcome outcome =
        read("EDGE_SE2 20 30 1 0 0 1 0 0 1 0 1\nEDGE_SE2 10 20 2 0 1.5707963267948966 1 0 0 1 0 1\n");
    REQUIRE(outcome.taken);
    CHECK_FALSE(outcome.graph.has_poses);
    CHECK(outcome.graph.ids == std::vector<std::int64_t>{10, 20, 30});
    CHECK((outcome.graph.plane.poses[2].translation - Eigen::Vector2d(2, 1)).norm() < 1e-12);
  }
  SECTION("records of other kinds are left out and counted") {
    const Outcome outcome = read("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n" + kPlane + "VERTEX_XY 7 1 2\n");
    REQUIRE(outcome.taken);
    CHECK(outcome.report.records_left_out == 2);
    REQUIRE(outcome.report.warnings.size() == 1);
    CHECK(outcome.report.warnings[0].line == 1);
    CHECK(outcome.report.warnings[0].field == "PARAMS_SE3OFFSET");
  }
  SECTION("several pieces") {
    const Outcome outcome = read(kPlane + "VERTEX_SE2 2 0 0 0\n");
    REQUIRE(outcome.taken);
    CHECK(outcome.report.pieces == 2);
    REQUIRE(outcome.report.warnings.size() == 1);
    CHECK(outcome.report.warnings[0].text.find("2 pieces") != std::string::npos);
  }
  SECTION("poses without edges") { CHECK(read("VERTEX_SE2 0 0 0 0\n").taken); }
  SECTION("several FIX, one twice") {
    const Outcome outcome = read(kPlane + "FIX 1 0\nFIX 1\n");
    REQUIRE(outcome.taken);
    CHECK(outcome.graph.fixed == std::vector<std::uint32_t>{1, 0});
  }
}

TEST_CASE("FIX of every pose costs no more than the poses themselves") {
  constexpr int kPoses = 200'000;
  std::string poses, fixed;
  for (int k = 0; k < kPoses; ++k) {
    poses += "VERTEX_SE2 " + std::to_string(k) + " 0 0 0\n";
    fixed += "FIX " + std::to_string(k) + "\n";
  }
  const auto seconds = [](const std::string& text, std::size_t expected) {
    const std::clock_t begin = std::clock();
    const Outcome outcome = read(text);
    CHECK(outcome.graph.fixed.size() == expected);
    return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  };
  const double alone = seconds(poses, 0);
  // A search through those before makes it some 50 times as much.
  CHECK(seconds(poses + fixed, kPoses) < 5 * alone);
}

TEST_CASE("repairs are counted") {
  SECTION("information with a negative eigenvalue") {
    const Outcome outcome = read(
        "EDGE_SE2 0 1 1 0 0 1 2 0 1 0 1\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\nEDGE_SE2 2 0 1 0 0 1 2 0 1 0 1\n");
    REQUIRE(outcome.taken);
    CHECK(outcome.report.clamped_information == 2);
    REQUIRE(outcome.report.warnings.size() == 1);
    CHECK(outcome.report.warnings[0].line == 1);
    CHECK(outcome.report.warnings[0].field == "information");
    // [1 2; 2 1] has 3 along (1, 1) and -1, which goes.
    const Eigen::Matrix3d& information = outcome.graph.plane.edges[0].information;
    CHECK(information(1, 1) == Approx(1.5));
    CHECK(information(1, 2) == Approx(1.5));
    CHECK(information(0, 0) == Approx(1));
    // Nothing is left to repair in what is written.
    CHECK(read(writeG2o(outcome.graph)).report.clamped_information == 0);
  }
  SECTION("quaternions off unit length") {
    const Outcome outcome = read("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 2\n");
    REQUIRE(outcome.taken);
    CHECK(outcome.report.normalized_quaternions == 1);
    CHECK(outcome.graph.space.poses[0].rotation.w() == 1);
    // As public files round them: normalized in silence.
    const Outcome rounded = read("VERTEX_SE3:QUAT 0 0 0 0 0 0 0.7071 0.7071\n");
    CHECK(rounded.report.normalized_quaternions == 0);
    CHECK(rounded.graph.space.poses[0].rotation.norm() == Approx(1).epsilon(1e-15));
  }
}

TEST_CASE("numbers missing, too many, malformed or not finite") {
  checkRefused("VERTEX_SE2 0 0 0\n", 1, "theta", "missing");
  checkRefused("VERTEX_SE2\n", 1, "id", "missing");
  checkRefused(kPlane + "EDGE_SE2 0 1 1 0 0 1 0 0 1 0\n", 4, "I33", "missing");
  checkRefused(kSpace + "\nEDGE_SE3:QUAT 0 1 1 0 0 0 0\n", 5, "qz", "missing");
  checkRefused(kPlane + "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 9\n", 4, "word 13", "more than EDGE_SE2 has");
  checkRefused("VERTEX_SE2 0 0 0 0 0\n", 1, "word 6", "more");
  checkRefused("VERTEX_SE2 1.5 0 0 0\n", 1, "id", "not a vertex number");
  checkRefused("VERTEX_SE2 99999999999999999999 0 0 0\n", 1, "id", "not a vertex number");
  checkRefused("VERTEX_SE2 0 nan 0 0\n", 1, "x", "not a finite number");
  checkRefused("VERTEX_SE2 0 0 -inf 0\n", 1, "y", "not a finite number");
  checkRefused("VERTEX_SE2 0 0 0 1e999\n", 1, "theta", "not a finite number");
  checkRefused("VERTEX_SE2 0 0 0,1 0\n", 1, "y", "`0,1`");
  checkRefused(kPlane + "EDGE_SE2 0 1 1 0 0 1 0 0 NaN 0 1\n", 4, "I22", "not a finite number");
  checkRefused(kSpace + "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 inf" + kUnit21, 4, "qw", "not a finite number");
  checkRefused(kPlane + "FIX\n", 4, "id", "missing");
  checkRefused(kPlane + "FIX 0 x\n", 4, "id", "not a vertex number");
}

TEST_CASE("graphs that cannot be") {
  checkRefused(kPlane + "EDGE_SE2 0 1 1 0 0 0 0 0 0 0 0\n", 4, "information", "no positive eigenvalue");
  checkRefused(kPlane + "EDGE_SE2 0 1 1 0 0 -1 0 0 -1 0 -1\n", 4, "information", "no positive eigenvalue");
  checkRefused(kPlane + "EDGE_SE2 1 1 1 0 0 1 0 0 1 0 1\n", 4, "to", "to itself");
  checkRefused(kPlane + "EDGE_SE2 0 7 1 0 0 1 0 0 1 0 1\n", 4, "to", "vertex 7");
  checkRefused(kPlane + "EDGE_SE2 8 0 1 0 0 1 0 0 1 0 1\n", 4, "from", "vertex 8");
  checkRefused(kPlane + "VERTEX_SE2 0 5 5 5\n", 4, "id", "first in line 1");
  checkRefused(kPlane + "FIX 3\n", 4, "id", "vertex 3");
  checkRefused(kPlane + kSpace, 4, "record kind", "SE3");
  checkRefused(kSpace + kPlane, 4, "record kind", "SE3");
  checkRefused("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 0\n", 1, "qx qy qz qw", "zero length");
  checkRefused("VERTEX_SE3:QUAT 0 0 0 0 1e308 1e308 1e308 1e308\n", 1, "qx qy qz qw", "zero length");
  checkRefused("", 0, "", "no pose");
  checkRefused("\n# nothing\n", 0, "", "no pose");
  checkRefused("VERTEX2 0 0 0 0\nEDGE2 0 1 1 0 0 1 0 1 1 0 0\n", 0, "", "VERTEX2");
  checkRefused("0 0 0 0\n", 1, "record kind", "`0`");
  checkRefused(std::string("VERTEX_SE2 0 0 0 0\n\x01\xff junk\n"), 2, "record kind", "`??`");
}

}  // namespace
}  // namespace swiftlet::test
