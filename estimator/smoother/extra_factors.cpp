#include "estimator/smoother/extra_factors.hpp"

#include <cmath>

namespace swiftlet {
namespace {

// Like kInformationScale (vision_factor.hpp), for one-dimensional residuals.
constexpr double kInformationScale1 = 1.099;

void weigh(double information_scale, LinearFactor& linear) {
  const RobustWeight robust = RobustWeight::cauchy(linear.residual.squaredNorm(), information_scale);
  const double root = std::sqrt(robust.weight);
  linear.residual *= root;
  linear.jacobian.leftCols(linear.columns) *= root;
  linear.cost = robust.cost;
}

}  // namespace

void linearize(const ExtraFactor& factor, const ExtraState& plane, const ExtraState& landmark,
               LinearFactor& linear) {
  linear.columns = 0;
  linear.residual.setZero();
  const double scale = 1.0 / factor.sigma;
  const Plane& at = plane.x.plane;
  const Eigen::Matrix<double, 3, 2> basis = at.basis();
  if (factor.tiesPoint()) {
    const Eigen::Vector3d& p = landmark.x.point;
    linear.residual[0] = scale * at.height(p);
    linear.addVariable(landmark.offset, scale * at.normal().transpose());
    Eigen::RowVector3d J;
    J << p.transpose() * basis, -1;
    linear.addVariable(plane.offset, scale * J);
    weigh(kInformationScale1, linear);
  } else if (factor.kind == ExtraFactorKind::kHorizontalPlane) {
    linear.residual.head<2>() = scale * at.normal().head<2>();
    linear.addVariable(plane.offset, scale * basis.topRows<2>());
    weigh(kInformationScale, linear);
  } else {
    linear.residual[0] = scale * at.normal().z();
    linear.addVariable(plane.offset, scale * basis.row(2));
    weigh(kInformationScale1, linear);
  }
}

}  // namespace swiftlet
