// What goes to another core of a state comes out of it as it went in.

#include <catch2/catch.hpp>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/interfaces/state_news.hpp"

namespace swiftlet {
namespace {

TEST_CASE("news of a state hold it, and its covariance to a float's precision") {
  Random random(5);
  const auto vector = [&random] {
    return Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  };
  NavState in;
  in.stamp = Stamp{1'403'636'579'763'555'584};
  in.epoch = 7;
  in.health = Health::kDegraded;
  in.T_world_body = SE3(expSo3(vector()), vector());
  in.v_world_body = vector();
  in.bias_gyro = vector();
  in.bias_accel = vector();
  Matrix15d A;
  for (double& value : A.reshaped()) value = random.normal();
  in.covariance = A * A.transpose();
  const Eigen::Vector3d omega = vector();
  const StateNews news(in, omega);
  CHECK(news.omegaBody() == omega);
  const NavState out = news.state();
  CHECK(out.stamp == in.stamp);
  CHECK(out.epoch == in.epoch);
  CHECK(out.health == in.health);
  CHECK(out.T_world_body.rotation.coeffs() == in.T_world_body.rotation.coeffs());
  CHECK(out.T_world_body.translation == in.T_world_body.translation);
  CHECK(out.v_world_body == in.v_world_body);
  CHECK(out.bias_gyro == in.bias_gyro);
  CHECK(out.bias_accel == in.bias_accel);
  constexpr int kTold = StateNews::kTold;
  const Eigen::Matrix<float, kTold, kTold> wanted = in.covariance.topLeftCorner<kTold, kTold>()
                                                        .selfadjointView<Eigen::Lower>()
                                                        .toDenseMatrix()
                                                        .cast<float>();
  CHECK((out.covariance.topLeftCorner<kTold, kTold>().cast<float>() == wanted));
  CHECK(out.covariance.isApprox(out.covariance.transpose(), 0));
  CHECK(out.covariance.rightCols<3>().isZero(0));
  // Its purpose: what goes from core to core at every sample.
  STATIC_REQUIRE(sizeof(StateNews) <= 512);
}

}  // namespace
}  // namespace swiftlet
