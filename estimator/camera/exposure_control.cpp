#include "estimator/camera/exposure_control.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

constexpr int kRowStep = 8;
constexpr int kColumnStep = 4;
constexpr std::size_t kGreys = 256;
/// Grey value from which a pixel counts as white: noise and the camera's response hide the last levels.
constexpr std::size_t kBright = 250;
constexpr double kBrightTarget = 235;  ///< grey value above which only kSaturatedShare of the pixels may be
/// A completely white image can have any brightness: request a fifth of the light.
constexpr double kWhiteLoss = 0.8;
constexpr double kMostFactor = 10;

/// Share of the correction applied per image, so that requests that take effect a frame earlier or later than
/// assumed cause no oscillation.
constexpr double kDamping = 0.5;
/// Largest step per image [ln of light] near the target, where larger steps would disturb tracking...
constexpr double kSmallStep = 0.1;
/// ...and far from it, where wrong light disturbs it more.
constexpr double kLargeStep = 0.35;
constexpr double kStepShare = 0.25;  ///< step / distance from the target, between these bounds

constexpr double kTurnMemory = 1.0;  ///< s; a vehicle that turned is likely to turn again
/// Largest change of the exposure's limit per image [ln]. The brightness stays constant, but some sensors
/// apply a gain one image before the exposure.
constexpr double kBoundStep = 0.15;
constexpr double kStepRounding = 1e-6;  // tolerance for a multiple of the step
constexpr double kPeriodShare = 0.9;    ///< largest exposure as a share of the period

double lightOf(const ExposureSetting& setting) { return setting.exposure.seconds() * setting.gain; }

}  // namespace

double meterImage(const ImageView& image) {
  std::array<std::uint32_t, kGreys> histogram{};
  std::uint32_t pixels = 0;
  std::uint64_t sum = 0;
  for (int y = kRowStep / 2; y < image.height; y += kRowStep) {
    const std::uint8_t* row = image.row(y);
    for (int x = kColumnStep / 2; x < image.width; x += kColumnStep) {
      ++histogram[row[x]];
      sum += row[x];
      ++pixels;
    }
  }
  if (pixels == 0) return 1;
  const double by_mean =
      ExposureControl::kTargetMean * pixels / static_cast<double>(std::max(sum, std::uint64_t{1}));
  const double allowed = ExposureControl::kSaturatedShare * pixels;
  std::uint32_t above = 0;
  std::size_t grey = kGreys;
  while (grey > 1 && above <= allowed) above += histogram[--grey];
  double by_bright = kBrightTarget / static_cast<double>(std::min(grey, kBright));
  if (grey >= kBright) {
    std::uint32_t white = 0;
    for (std::size_t g = kBright; g < kGreys; ++g) white += histogram[g];
    const double excess = (white - allowed) / (pixels - allowed);
    by_bright *= 1 - kWhiteLoss * excess;
  }
  return std::clamp(std::min(by_mean, by_bright), 1 / kMostFactor, kMostFactor);
}

ExposureControl::ExposureControl(const ExposureRange& range, double focal, Duration period,
                                 const ExposureSetting& start)
    : range_(range), focal_(focal), turn_decay_(std::exp(-period.seconds() / kTurnMemory)) {
  range_.longest =
      std::clamp(Duration::fromSeconds(kPeriodShare * period.seconds()), range.shortest, range.longest);
  bound_ = range_.longest.seconds();
  light_ = std::max(lightOf(start), range_.shortest.seconds());
  requests_.fill({0, start});
}

ExposureSetting ExposureControl::inForce(std::uint64_t frame) const {
  for (std::size_t back = 0; back + 1 < kRemembered; ++back) {
    const Request& request = requests_[(count_ + kRemembered - back) % kRemembered];
    if (request.frame <= frame) return request.setting;
  }
  return requests_[(count_ + 1) % kRemembered].setting;
}

void ExposureControl::moveBound(double turn_rate) {
  turn_rate_ = std::max({turn_rate_ * turn_decay_, turn_rate, kLeastTurnRate});
  const double wanted = kBlur / (focal_ * turn_rate_);
  bound_ = std::clamp(wanted, bound_ * std::exp(-kBoundStep), bound_ * std::exp(kBoundStep));
}

ExposureSetting ExposureControl::split(double light) const {
  const double shortest = range_.shortest.seconds();
  const double longest = range_.longest.seconds();
  const auto within = [&](double exposure, double bound) {
    const double chosen = std::clamp(exposure, shortest, std::clamp(bound, shortest, longest));
    if (range_.step <= 0) return chosen;
    return std::max(shortest, std::floor(chosen / range_.step + kStepRounding) * range_.step);
  };
  double exposure = within(light, bound_);
  const double gain = std::clamp(light / exposure, 1.0, range_.most_gain);
  exposure = within(light / gain, bound_ * kDarkBlur / kBlur);
  return {Duration::fromSeconds(exposure), gain};
}

void ExposureControl::remember(std::uint64_t frame, const ExposureSetting& setting) {
  ++count_;
  requests_[count_ % kRemembered] = {frame + kActingDelay, setting};
}

ExposureSetting ExposureControl::update(std::uint64_t frame, double missing, double turn_rate) {
  moveBound(turn_rate);
  const double off = std::log(missing);
  const double least = range_.shortest.seconds();
  double step = 0;
  if (std::abs(off) > kDeadband) {
    // The light that this image should have had, relative to what was requested since.
    const double wanted = off + std::log(std::max(lightOf(inForce(frame)), least) / light_);
    const double largest = std::clamp(kStepShare * std::abs(off), kSmallStep, kLargeStep);
    step = std::clamp(kDamping * wanted, -largest, largest);
  }
  const double most =
      std::clamp(bound_ * kDarkBlur / kBlur, least, range_.longest.seconds()) * range_.most_gain;
  light_ = std::clamp(light_ * std::exp(step), least, most);
  const ExposureSetting next = split(light_);
  if (next != asked()) remember(frame, next);
  return next;
}

void ExposureControl::follow(std::uint64_t frame, const ExposureSetting& asked) {
  if (asked == this->asked()) return;
  remember(frame, asked);
  light_ = lightOf(asked);
}

}  // namespace swiftlet
