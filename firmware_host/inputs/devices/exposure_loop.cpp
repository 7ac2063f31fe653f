#include "firmware_host/inputs/devices/exposure_loop.hpp"

namespace swiftlet {
namespace {

/// rad/s, assumed while the IMU is silent: a brisk turn.
constexpr double kUnknownTurnRate = 1.0;
constexpr Duration kTurnRateAge = Duration::fromMilliseconds(200);

}  // namespace

DeviceFault ExposureLoop::begin(CameraSource& source) {
  const std::optional<ExposureAbility> ability = source.exposureAbility();
  if (!ability) {
    return deviceFault(DeviceFaultKind::kUnsupported, 0,
                       "the exposure cannot be set in flight: set cameras.exposure_control to false");
  }
  const ExposureSetting start = begun_ ? control_.asked() : ability->now;
  // Set even if this exposure is in force already: this turns the camera's automatic exposure off.
  if (const DeviceFault fault = source.setExposure(start); !fault.ok()) return fault;
  control_ = ExposureControl(ability->range, setup_.focal, setup_.period, start);
  begun_ = true;
  return {};
}

double ExposureLoop::turnRate(Stamp now) const {
  TurnRate turn;
  const bool known = setup_.turn_rate != nullptr && setup_.turn_rate->read(turn) != 0;
  return known && now - turn.arrival < kTurnRateAge ? turn.rate : kUnknownTurnRate;
}

DeviceFault ExposureLoop::step(std::uint64_t frame, const ImageView& image, Stamp now, CameraSource& source) {
  const ExposureSetting before = control_.asked();
  AskedExposure leader;
  if (!setup_.leads && setup_.asked->read(leader) != 0 && now - leader.arrival < kLeaderSilence) {
    control_.follow(frame, leader.setting);
  } else {
    control_.update(frame, meterImage(image), turnRate(now));
  }
  if (setup_.leads && setup_.asked != nullptr) setup_.asked->write({control_.asked(), now});
  return control_.asked() == before ? DeviceFault{} : source.setExposure(control_.asked());
}

}  // namespace swiftlet
