#include "drivers/simulated/simulated_exposure.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

constexpr Duration kShortest{20'000};
constexpr double kPeriodShare = 0.8;  // the rest is readout

}  // namespace

double lightAt(const std::vector<LightChange>& changes, double seconds) {
  double light = 1;
  for (const LightChange& change : changes) {
    if (seconds <= change.begin) break;
    const double share = std::min((seconds - change.begin) / kLightRamp, 1.0);
    light *= std::pow(change.level / light, share);
  }
  return light;
}

SimulatedExposure::SimulatedExposure(ExposureMode mode, const SensorSettings& sensor, double exposure,
                                     double rate, double focal)
    : mode_(mode), sensor_(sensor), exposure_(exposure), period_(1 / rate), focal_(focal), gain_(sensor) {}

void SimulatedExposure::start(double mean_radiance) {
  started_ = true;
  gain_.start(mean_radiance);
  const double gain = mode_ == ExposureMode::kFixed ? gain_.gain() / sensor_.start_error : gain_.gain();
  const ExposureSetting first{Duration::fromSeconds(exposure_), gain};
  coming_.fill(first);
  const ExposureRange range{kShortest, Duration::fromSeconds(std::min(kLongest, kPeriodShare * period_)),
                            sensor_.max_gain};
  control_ = ExposureControl(range, focal_, Duration::fromSeconds(period_), first);
}

ExposureSetting SimulatedExposure::now() const {
  if (mode_ == ExposureMode::kGain) return {Duration::fromSeconds(exposure_), gain_.gain()};
  return coming_.front();
}

void SimulatedExposure::update(std::uint64_t frame, const ImageView& image, double mean, double turn_rate) {
  if (mode_ == ExposureMode::kGain) {
    // Keep the gain in a blackout, so that the images after it are usable at once.
    if (!image.empty() && mean > 0) gain_.update(mean, period_);
  } else if (mode_ == ExposureMode::kOdometry) {
    std::rotate(coming_.begin(), coming_.begin() + 1, coming_.end());
    coming_.back() = control_.asked();
    if (!image.empty()) coming_.back() = control_.update(frame, meterImage(image), turn_rate);
  }
}

}  // namespace swiftlet
