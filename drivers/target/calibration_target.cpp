#include "drivers/target/calibration_target.hpp"

namespace swiftlet {

Eigen::Vector3d CalibrationTarget::corner(int id) const {
  if (!hasTags()) return {size * (id % columns), square_height * (id / columns), 0};
  const int tag = id / 4;
  const int side = id % 4;
  const double pitch = size * (1 + gap);
  const double right = side == 1 || side == 2 ? size : 0;
  const double up = side >= 2 ? size : 0;
  return {pitch * (tag % columns) + right, pitch * (tag / columns) + up, 0};
}

}  // namespace swiftlet
