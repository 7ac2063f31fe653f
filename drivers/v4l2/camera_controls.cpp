#include "drivers/v4l2/camera_controls.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>

#include "drivers/v4l2/video_node.hpp"
#include "estimator/core/units.hpp"

namespace swiftlet {
namespace {

/// [s], unit of V4L2_CID_EXPOSURE_ABSOLUTE.
constexpr double kExposureUnit = 1e-4;
constexpr double kDecibelsPerDecade = 20;

struct KnownGain {
  std::string_view sensor;
  bool decibel;
  double scale;  ///< gain = scale / (scale - code), or dB per step of the code
};
constexpr std::array kKnownGains = {
    KnownGain{"imx214", false, 512},  KnownGain{"imx219", false, 256},  KnownGain{"imx258", false, 512},
    KnownGain{"imx477", false, 1024}, KnownGain{"imx283", false, 2048}, KnownGain{"imx290", true, 0.3},
    KnownGain{"imx296", true, 0.1},   KnownGain{"imx327", true, 0.3},   KnownGain{"imx335", true, 0.3},
    KnownGain{"imx415", true, 0.3},   KnownGain{"imx462", true, 0.3},
};

}  // namespace

CameraControls::CameraControls(const ControlPort& port, int width, std::string_view name) : port_(&port) {
  if (spanOf(V4L2_CID_EXPOSURE_ABSOLUTE)) {
    exposure_id_ = V4L2_CID_EXPOSURE_ABSOLUTE;
    step_ = kExposureUnit;
  } else if (spanOf(V4L2_CID_EXPOSURE)) {
    findLineTime(width);
  }
  if (exposure_id_ != 0) exposure_span_ = spanOf(exposure_id_).value_or(Span{});
  findGain(name);
}

void CameraControls::findLineTime(int width) {
  const std::optional<std::int32_t> blank = read(V4L2_CID_HBLANK);
  v4l2_ext_control rate = {};
  rate.id = V4L2_CID_PIXEL_RATE;
  v4l2_ext_controls controls = {};
  controls.which = V4L2_CTRL_WHICH_CUR_VAL;
  controls.count = 1;
  controls.controls = &rate;
  if (!blank || port_->call(VIDIOC_G_EXT_CTRLS, &controls) != 0 || rate.value64 <= 0) return;
  exposure_id_ = V4L2_CID_EXPOSURE;
  step_ = static_cast<double>(width + *blank) / static_cast<double>(rate.value64);
}

void CameraControls::findGain(std::string_view name) {
  for (const std::uint32_t id : std::array<std::uint32_t, 2>{V4L2_CID_GAIN, V4L2_CID_ANALOGUE_GAIN}) {
    const std::optional<Span> span = spanOf(id);
    if (!span) continue;
    gain_id_ = id;
    gain_span_ = *span;
    break;
  }
  const auto* known =
      std::ranges::find_if(kKnownGains, [&](const KnownGain& gain) { return name.starts_with(gain.sensor); });
  if (known != kKnownGains.end()) {
    gain_law_ = known->decibel ? GainLaw::kDecibel : GainLaw::kInverse;
    gain_scale_ = known->scale;
  } else if (gain_span_.least > 0) {
    gain_law_ = GainLaw::kMultiple;
    gain_scale_ = gain_span_.least;
  }
}

std::optional<CameraControls::Span> CameraControls::spanOf(std::uint32_t id) const {
  v4l2_queryctrl control = {};
  control.id = id;
  if (port_ == nullptr || port_->call(VIDIOC_QUERYCTRL, &control) != 0) return std::nullopt;
  if ((control.flags & V4L2_CTRL_FLAG_DISABLED) != 0) return std::nullopt;
  return Span{control.minimum, control.maximum};
}

std::optional<std::int32_t> CameraControls::read(std::uint32_t id) const {
  v4l2_control control = {id, 0};
  if (!spanOf(id) || port_->call(VIDIOC_G_CTRL, &control) != 0) return std::nullopt;
  return control.value;
}

/// Clamps to the control's range first, because some drivers clamp and others refuse. Returns 0 or errno.
int CameraControls::write(std::uint32_t id, std::int64_t value) const {
  const std::optional<Span> span = spanOf(id);
  if (!span) return errno == ENODEV ? ENODEV : EINVAL;
  v4l2_control control = {id, 0};
  control.value = static_cast<std::int32_t>(std::clamp<std::int64_t>(value, span->least, span->most));
  return port_->call(VIDIOC_S_CTRL, &control) == 0 ? 0 : errno;
}

/// Disables an automatic mode that conflicts with a manual value; cameras without it need nothing.
void CameraControls::writeIfThere(std::uint32_t id, std::int32_t value) const {
  if (spanOf(id)) static_cast<void>(write(id, value));
}

void CameraControls::automaticExposureOff() {
  writeIfThere(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
  writeIfThere(V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);
}

void CameraControls::automaticGainOff() { writeIfThere(V4L2_CID_AUTOGAIN, 0); }

Duration CameraControls::timeOf(std::int64_t steps) const {
  return Duration::fromSeconds(static_cast<double>(steps) * step_);
}

/// Steps of the control, rounded down.
std::int64_t CameraControls::stepsOf(Duration exposure) const {
  constexpr double kRounding = 1e-3;  // an exposure that was read back gives the same number of steps
  return static_cast<std::int64_t>(std::floor(exposure.seconds() / step_ + kRounding));
}

/// Lengthens the frame for an exposure of `lines`. The control's maximum is the frame's length minus a margin
/// that stays constant.
void CameraControls::lengthenFrame(std::int64_t lines) {
  if (lines <= exposure_span_.most) return;
  const std::optional<std::int32_t> blank = read(V4L2_CID_VBLANK);
  if (!blank) return;
  static_cast<void>(write(V4L2_CID_VBLANK, *blank + lines - exposure_span_.most));
  exposure_span_ = spanOf(exposure_id_).value_or(exposure_span_);
}

DeviceFault CameraControls::setExposure(Duration exposure) {
  if (!exposes()) {
    return deviceFault(
        DeviceFaultKind::kUnsupported, 0,
        "the exposure time cannot be set%s; set it with the camera's own tools, and remove it here",
        port_ != nullptr && spanOf(V4L2_CID_EXPOSURE) ? " (its exposure is in lines of unknown length)" : "");
  }
  automaticExposureOff();
  const std::int64_t steps = stepsOf(exposure);
  if (exposure_id_ == V4L2_CID_EXPOSURE) lengthenFrame(steps);
  const int error = write(exposure_id_, steps);
  if (error != 0) return VideoNode::callFault(error, "setting the exposure time");
  const std::optional<Duration> set = this->exposure();
  if (!set || std::abs((*set - exposure).seconds()) > step_) {
    return deviceFault(DeviceFaultKind::kChanged, 0, "exposure: requested %.1f ms, set %.1f ms",
                       exposure.seconds() * kToMs, set.value_or(Duration{}).seconds() * kToMs);
  }
  return {};
}

DeviceFault CameraControls::setGain(std::int32_t gain) {
  if (gain_id_ == 0) return deviceFault(DeviceFaultKind::kUnsupported, 0, "the gain cannot be set");
  automaticGainOff();
  const int error = write(gain_id_, gain);
  if (error != 0) return VideoNode::callFault(error, "setting the gain");
  const std::optional<std::int32_t> set = this->gain();
  if (set != gain) {
    return deviceFault(DeviceFaultKind::kChanged, 0, "gain: requested %d, set %d", gain, set.value_or(0));
  }
  return {};
}

std::optional<Duration> CameraControls::exposure() const {
  if (!exposes()) return std::nullopt;
  const std::optional<std::int32_t> steps = read(exposure_id_);
  if (!steps) return std::nullopt;
  return timeOf(*steps);
}

std::optional<std::int32_t> CameraControls::gain() const {
  return gain_id_ == 0 ? std::nullopt : read(gain_id_);
}

double CameraControls::timesOf(std::int32_t code) const {
  const auto absolute = [this](double c) {
    switch (gain_law_) {
      case GainLaw::kUnknown:
        return 1.0;
      case GainLaw::kMultiple:
        return c / gain_scale_;
      case GainLaw::kInverse:
        return gain_scale_ / std::max(gain_scale_ - c, 1.0);
      case GainLaw::kDecibel:
        return std::pow(10.0, c * gain_scale_ / kDecibelsPerDecade);
    }
    return 1.0;
  };
  return absolute(code) / absolute(gain_span_.least);
}

std::int32_t CameraControls::codeOf(double times) const {
  // Gains rise with the code: take the largest code that gives at most `times`.
  std::int32_t low = gain_span_.least;
  std::int32_t high = gain_span_.most;
  constexpr double kRounding = 1e-9;
  while (low < high) {
    const std::int32_t middle = low + (high - low + 1) / 2;
    if (timesOf(middle) <= times + kRounding) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  return low;
}

std::optional<ExposureAbility> CameraControls::ability() const {
  const std::optional<Duration> now = exposure();
  const std::int32_t least = std::max(exposure_span_.least, 1);
  if (!now || exposure_span_.most < least) return std::nullopt;
  ExposureAbility ability;
  ability.range.step = step_;
  ability.range.shortest = timeOf(least);
  ability.range.longest = timeOf(exposure_span_.most);
  ability.now.exposure = *now;
  const std::optional<std::int32_t> code = gain();
  if (code && gain_law_ != GainLaw::kUnknown) {
    ability.range.most_gain = timesOf(gain_span_.most);
    ability.now.gain = timesOf(*code);
  }
  return ability;
}

DeviceFault CameraControls::set(const ExposureSetting& setting) {
  if (!exposes()) return deviceFault(DeviceFaultKind::kUnsupported, 0, "the exposure time cannot be set");
  if (!manual_) {
    automaticExposureOff();
    if (gain_law_ != GainLaw::kUnknown) automaticGainOff();
    manual_ = true;
  }
  std::array<v4l2_ext_control, 2> values = {};
  values[0].id = exposure_id_;
  values[0].value = static_cast<std::int32_t>(
      std::clamp<std::int64_t>(stepsOf(setting.exposure), exposure_span_.least, exposure_span_.most));
  values[1].id = gain_id_;
  v4l2_ext_controls controls = {};
  controls.which = V4L2_CTRL_WHICH_CUR_VAL;
  controls.count = 1;
  controls.controls = values.data();
  if (gain_law_ != GainLaw::kUnknown) {
    values[1].value = codeOf(setting.gain);
    controls.count = 2;
  }
  if (port_->call(VIDIOC_S_EXT_CTRLS, &controls) == 0) return {};
  return VideoNode::callFault(errno, "setting exposure and gain");
}

}  // namespace swiftlet
