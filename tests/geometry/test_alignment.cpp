#include <catch2/catch.hpp>
#include <limits>
#include <vector>

#include "estimator/geometry/alignment.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/geometry/random_vectors.hpp"

namespace swiftlet::test {
namespace {

std::vector<Eigen::Vector3d> cloud(Random& random, std::size_t count) {
  std::vector<Eigen::Vector3d> points(count);
  for (Eigen::Vector3d& p : points) p = 10 * normalVector(random) + Eigen::Vector3d(100, -50, 20);
  return points;
}

std::vector<Eigen::Vector3d> moved(const std::vector<Eigen::Vector3d>& points, const SE3& T, double scale) {
  std::vector<Eigen::Vector3d> result;
  for (const Eigen::Vector3d& p : points) result.push_back(T.rotation * (scale * p) + T.translation);
  return result;
}

double rmsOf(const Alignment& a, const std::vector<Eigen::Vector3d>& from,
             const std::vector<Eigen::Vector3d>& to) {
  double sum = 0;
  for (std::size_t i = 0; i < from.size(); ++i) sum += (a * from[i] - to[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(from.size()));
}

}  // namespace

TEST_CASE("alignments recover an exact motion", "[alignment]") {
  Random random(1);
  for (const std::size_t count : {3UL, 4UL, 50UL}) {
    for (int trial = 0; trial < 50; ++trial) {
      const auto from = cloud(random, count);
      const SE3 T(expSo3(normalVector(random)), 10 * normalVector(random));
      const SE3 yaw(expSo3({0, 0, random.uniform(-3, 3)}), 10 * normalVector(random));
      Alignment a;
      REQUIRE(alignRigid(from, moved(from, T, 1), a).ok());
      CHECK((a.T_to_from.R() - T.R()).norm() < 1e-10);
      CHECK((a.T_to_from.translation - T.translation).norm() < 1e-8);
      CHECK(a.scale == 1.0);
      CHECK(a.rms < 1e-10);
      REQUIRE(alignSimilarity(from, moved(from, T, 0.37), a).ok());
      CHECK(a.scale == Approx(0.37).epsilon(1e-10));
      CHECK(a.rms < 1e-10);
      REQUIRE(alignYaw(from, moved(from, yaw, 1), a).ok());
      CHECK((a.T_to_from.R() - yaw.R()).norm() < 1e-10);
      CHECK(a.rms < 1e-10);
    }
  }
}

TEST_CASE("no small change of the alignment lowers the error", "[alignment]") {
  Random random(2);
  const auto from = cloud(random, 40);
  auto to = moved(from, SE3(expSo3({0.1, 0.2, 2.0}), {1, 2, 3}), 1.4);
  for (Eigen::Vector3d& p : to) p += 0.5 * normalVector(random);
  Alignment rigid, similar, yaw;
  REQUIRE(alignRigid(from, to, rigid).ok());
  REQUIRE(alignSimilarity(from, to, similar).ok());
  REQUIRE(alignYaw(from, to, yaw).ok());
  CHECK(rigid.rms == Approx(rmsOf(rigid, from, to)));
  CHECK(similar.rms < rigid.rms);
  CHECK(rigid.rms < yaw.rms);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Quaterniond turn = expSo3(1e-3 * normalVector(random));
    const Eigen::Quaterniond turn_z = expSo3({0, 0, 1e-3 * random.normal()});
    const Eigen::Vector3d shift = 1e-2 * normalVector(random);
    Alignment other = rigid;
    other.T_to_from = SE3(turn, shift) * rigid.T_to_from;
    CHECK(rmsOf(other, from, to) > rigid.rms);
    other = similar;
    other.T_to_from = SE3(turn, shift) * similar.T_to_from;
    other.scale *= 1 + 1e-3 * random.normal();
    CHECK(rmsOf(other, from, to) > similar.rms);
    other = yaw;
    other.T_to_from = SE3(turn_z, shift) * yaw.T_to_from;
    CHECK(rmsOf(other, from, to) > yaw.rms);
  }
}

TEST_CASE("a mirrored set is not answered by a mirror", "[alignment]") {
  Random random(3);
  const auto from = cloud(random, 20);
  std::vector<Eigen::Vector3d> to;
  for (const Eigen::Vector3d& p : from) to.emplace_back(p.x(), p.y(), -p.z());
  Alignment a;
  REQUIRE(alignRigid(from, to, a).ok());
  CHECK(a.T_to_from.R().determinant() == Approx(1.0));
}

TEST_CASE("alignments say when the points do not determine them", "[alignment]") {
  std::vector<Eigen::Vector3d> line, column;
  for (int i = 0; i < 10; ++i) {
    line.emplace_back(i, 2 * i, -i);
    column.emplace_back(1, 2, i);
  }
  Alignment a;
  CHECK(alignRigid(line, line, a).code == StatusCode::kDegenerate);
  CHECK(a.rms < 1e-9);  // still a transform that fits
  CHECK(alignSimilarity(line, line, a).code == StatusCode::kDegenerate);
  CHECK(alignYaw(line, line, a).ok());
  CHECK(alignYaw(column, column, a).code == StatusCode::kDegenerate);
  const std::vector<Eigen::Vector3d> same(5, Eigen::Vector3d(1, 2, 3));
  CHECK(alignRigid(same, same, a).code == StatusCode::kDegenerate);
  CHECK(alignSimilarity(same, same, a).code == StatusCode::kDegenerate);
  CHECK(alignRigid({}, {}, a).code == StatusCode::kInvalidInput);
  CHECK(alignRigid(line, same, a).code == StatusCode::kInvalidInput);
  auto broken = line;
  broken[3].y() = std::numeric_limits<double>::quiet_NaN();
  CHECK(alignRigid(broken, line, a).code == StatusCode::kInvalidInput);
}

}  // namespace swiftlet::test
