#include "estimator/smoother/state.hpp"

#include "estimator/geometry/so3.hpp"

namespace swiftlet {

void BodyState::retract(const Vector15d& delta) {
  T_world_body.rotation = (T_world_body.rotation * expSo3(delta.segment<3>(0))).normalized();
  T_world_body.translation += delta.segment<3>(3);
  v_world_body += delta.segment<3>(6);
  bias_gyro += delta.segment<3>(9);
  bias_accel += delta.segment<3>(12);
}

Vector15d BodyState::minus(const BodyState& reference) const {
  Vector15d delta;
  delta << logSo3(reference.T_world_body.rotation.conjugate() * T_world_body.rotation),
      T_world_body.translation - reference.T_world_body.translation, v_world_body - reference.v_world_body,
      bias_gyro - reference.bias_gyro, bias_accel - reference.bias_accel;
  return delta;
}

}  // namespace swiftlet
