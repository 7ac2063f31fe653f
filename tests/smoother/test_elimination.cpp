// What leaves a system, against dense Schur complements and against the solution with everything in it.

#include "estimator/smoother/elimination.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <catch2/catch.hpp>
#include <memory>
#include <string_view>
#include <vector>

#include "estimator/smoother/normal_equations.hpp"
#include "tests/smoother/window_scene.hpp"

using namespace swiftlet;
using test::randomVector;

namespace {

// A window's columns: two calibration columns, three extra states, a pose-only state, two whole ones.
constexpr std::array<ColumnRange, 7> kVariables{ColumnRange{0, 2}, {2, 3},   {5, 3},  {8, 3},
                                                {11, 6},           {17, 15}, {32, 15}};
constexpr int kDimension = 47;

struct Problem {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(kDimension, kDimension);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(kDimension);
};

/// Random linear factors on single variables and on pairs; the normal equations made by hand and by the
/// class.
Problem randomProblem(Random& random, NormalEquations& system) {
  Problem problem;
  system.begin({}, kDimension);
  for (int k = 0; k < 400; ++k) {
    const auto a = static_cast<std::size_t>(random.uniform(0, 6.999));
    const auto b = static_cast<std::size_t>(random.uniform(0, 6.999));
    const int rows = 1 + k % 3;
    LinearFactor factor;
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(rows, kDimension);
    for (const std::size_t v : {a, b}) {
      if (v == b && a == b && factor.columns > 0) break;
      Eigen::MatrixXd block(rows, kVariables[v].count);
      for (Eigen::Index i = 0; i < block.size(); ++i) block.data()[i] = random.normal();
      factor.addVariable(kVariables[v].offset, block);
      J.middleCols(kVariables[v].offset, kVariables[v].count) = block;
    }
    const Eigen::Vector3d r = randomVector(random, 1);
    factor.residual.head(rows) = r.head(rows);
    factor.cost = 0.5 * r.head(rows).squaredNorm();
    system.addFactor(factor);
    problem.H += J.transpose() * J;
    problem.g += J.transpose() * r.head(rows);
  }
  return problem;
}

void mirror(MatrixMap H) {
  for (Eigen::Index c = 0; c < H.cols(); ++c) {
    for (Eigen::Index r = c + 1; r < H.rows(); ++r) H(c, r) = H(r, c);
  }
}

Eigen::VectorXi columnsOf(std::span<const ColumnRange> ranges) {
  Eigen::VectorXi columns(kDimension);
  Eigen::Index count = 0;
  for (const ColumnRange& range : ranges) {
    for (int k = 0; k < range.count; ++k) columns[count++] = range.offset + k;
  }
  return columns.head(count);
}

Problem denseSchur(const Problem& all, const Eigen::VectorXi& stay, const Eigen::VectorXi& leave) {
  const Eigen::MatrixXd gain = all.H(stay, leave) * all.H(leave, leave).inverse();
  Problem rest;
  rest.H = all.H(stay, stay) - gain * all.H(leave, stay);
  rest.g = all.g(stay) - gain * all.g(leave);
  return rest;
}

}  // namespace

TEST_CASE("Small factors add up to J^T J in either triangle's order", "[smoother][elimination]") {
  Random random(41);
  auto system = std::make_unique<NormalEquations>();
  const Problem problem = randomProblem(random, *system);
  mirror(system->H());
  CHECK((Eigen::MatrixXd(system->H()) - problem.H).cwiseAbs().maxCoeff() < 1e-11);
  CHECK((system->g() - problem.g).cwiseAbs().maxCoeff() < 1e-11);
}

TEST_CASE("Variables leave as the dense Schur complement says, whichever and in any number",
          "[smoother][elimination]") {
  Random random(42);
  auto system = std::make_unique<NormalEquations>();
  std::vector<double> work(static_cast<std::size_t>(kDimension) * kStateDim);
  // Indices of kVariables, in the order in which they leave.
  for (const std::string_view departure : {"1", "4", "5", "6", "13", "1235", "324"}) {
    const Problem problem = randomProblem(random, *system);
    mirror(system->H());
    std::vector<ColumnRange> stay;
    std::vector<ColumnRange> leave;
    for (std::size_t v = 0; v < kVariables.size(); ++v) {
      const bool leaves = departure.find(static_cast<char>('0' + v)) != std::string_view::npos;
      (leaves ? leave : stay).push_back(kVariables[v]);
    }
    // Those that leave later are among the others, as are those that have left.
    for (const char digit : departure) {
      const auto v = static_cast<std::size_t>(digit - '0');
      std::vector<ColumnRange> others = stay;
      for (const ColumnRange& other : leave) {
        if (other.offset != kVariables[v].offset) others.push_back(other);
      }
      eliminateColumns(system->H(), system->g(), kVariables[v], others, work);
    }
    const Eigen::VectorXi columns = columnsOf(stay);
    const Problem expected = denseSchur(problem, columns, columnsOf(leave));
    const Eigen::MatrixXd H = system->H();
    const Eigen::VectorXd g = system->g();
    CHECK((H(columns, columns) - expected.H).cwiseAbs().maxCoeff() < 1e-9 * problem.H.maxCoeff());
    CHECK((g(columns) - expected.g).cwiseAbs().maxCoeff() < 1e-9 * problem.H.maxCoeff());
    // What stays ends where it would have ended with everything in the system.
    const Eigen::VectorXd whole = problem.H.ldlt().solve(problem.g);
    const Eigen::VectorXd rest = Eigen::MatrixXd(H(columns, columns)).ldlt().solve(g(columns));
    CHECK((rest - whole(columns)).norm() < 1e-9 * whole.norm());
  }
}

TEST_CASE("A part of a state leaves", "[smoother][elimination]") {
  Random random(43);
  auto system = std::make_unique<NormalEquations>();
  std::vector<double> work(static_cast<std::size_t>(kDimension) * kStateDim);
  const Problem problem = randomProblem(random, *system);
  mirror(system->H());
  const ColumnRange motion{17 + kPoseDim, kStateDim - kPoseDim};
  std::vector<ColumnRange> others(kVariables.begin(), kVariables.end());
  others[5].count = kPoseDim;
  eliminateColumns(system->H(), system->g(), motion, others, work);
  const Eigen::VectorXi columns = columnsOf(others);
  const Problem expected = denseSchur(problem, columns, columnsOf({&motion, 1}));
  const Eigen::MatrixXd H = system->H();
  CHECK((H(columns, columns) - expected.H).cwiseAbs().maxCoeff() < 1e-9 * problem.H.maxCoeff());
}

TEST_CASE("Directions of what leaves that nothing determines take no information along",
          "[smoother][elimination]") {
  // A point in a plane's direction alone: one row on the point, one on point and state.
  auto system = std::make_unique<NormalEquations>();
  std::vector<double> work(static_cast<std::size_t>(kDimension) * kStateDim);
  system->begin({}, kDimension);
  LinearFactor factor;
  factor.addVariable(2, Eigen::RowVector3d(0, 0, 1));
  factor.addVariable(11, Eigen::RowVector3d(1, 0, 0));
  factor.residual[0] = 2;
  system->addFactor(factor);
  mirror(system->H());
  const std::array<ColumnRange, 1> others{ColumnRange{11, 6}};
  eliminateColumns(system->H(), system->g(), {2, 3}, others, work);
  // The point takes up whatever the factor says: nothing is left for the state.
  CHECK(system->H().block(11, 11, 6, 6).cwiseAbs().maxCoeff() < 1e-12);
  CHECK(system->g().segment(11, 6).cwiseAbs().maxCoeff() < 1e-12);
}
