#include "drivers/simulated/flight_path.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;
constexpr double kKnotSpacing = 0.1;       // s; represents oscillations up to about 2 Hz
constexpr double kPathStep = 0.02;         // m between samples of the rounded tour
constexpr double kRamp = 1.0;              // s from motion to rest
constexpr double kHeadingAhead = 0.5;      // m: the airframe looks to where it will be
constexpr double kHeadingSmooth = 0.7;     // s at the mean speed, sigma of the heading's low pass
constexpr double kClimb = 2.5;             // s of take-off
constexpr double kGroundClearance = 0.12;  // m of the body above the floor when landed
constexpr double kMargin = 1.0;            // s of motion beyond both ends, for the spline's support

double smoothStep(double x) {  // 0 to 1 with vanishing first and second derivatives at both ends
  x = std::clamp(x, 0.0, 1.0);
  return x * x * x * (x * (6.0 * x - 15.0) + 10.0);
}

// One slow oscillation per axis: a sum of sines without a common period.
struct Oscillation {
  static constexpr std::size_t kTerms = 3;
  std::array<double, kTerms> amplitude{};
  std::array<double, kTerms> omega{};
  std::array<double, kTerms> phase{};

  Oscillation(Random& random, double size, double low_hz, double high_hz) {
    for (std::size_t i = 0; i < kTerms; ++i) {
      omega[i] = kTwoPi * random.uniform(low_hz, high_hz);
      // Equal peak speeds: slower terms have larger amplitudes.
      amplitude[i] = size * low_hz * kTwoPi / omega[i] / std::sqrt(static_cast<double>(kTerms));
      phase[i] = random.uniform(0.0, kTwoPi);
    }
  }
  double operator()(double t) const {
    double sum = 0;
    for (std::size_t i = 0; i < kTerms; ++i) sum += amplitude[i] * std::sin(omega[i] * t + phase[i]);
    return sum;
  }
};

// The rounded tour, parametrized by arc length.
class RoundedTour {
 public:
  RoundedTour(const std::vector<Eigen::Vector3d>& waypoints, double heading_sigma) : waypoints_(waypoints) {
    const std::size_t n = waypoints_.size();
    constexpr int kFine = 200;  // samples per waypoint for the arc length
    Eigen::Vector3d last = at(0);
    double length = 0;
    points_.push_back(last);
    for (std::size_t i = 1; i <= n * kFine; ++i) {
      const Eigen::Vector3d point = at(static_cast<double>(i) / kFine);
      const double step = (point - last).norm();
      while (static_cast<double>(points_.size()) * kPathStep <= length + step && step > 0) {
        const double share = (static_cast<double>(points_.size()) * kPathStep - length) / step;
        points_.push_back(last + share * (point - last));
      }
      length += step;
      last = point;
    }
    smoothHeading(heading_sigma);
  }
  // Linear between samples 2 cm apart: the trajectory's spline smooths the corners.
  [[nodiscard]] Eigen::Vector3d operator()(double s) const {
    const auto n = static_cast<double>(points_.size());
    double place = std::fmod(s / kPathStep, n);
    if (place < 0) place += n;
    const auto index = std::min(static_cast<std::size_t>(place), points_.size() - 1);
    const double share = place - static_cast<double>(index);
    return points_[index] + share * (points_[(index + 1) % points_.size()] - points_[index]);
  }
  [[nodiscard]] double length() const { return kPathStep * static_cast<double>(points_.size()); }
  // Heading of the airframe [rad], unwrapped: a function of arc length only, so it rests when the position
  // rests.
  [[nodiscard]] double heading(double s) const {
    const double n = static_cast<double>(points_.size());
    const double laps = std::floor(s / kPathStep / n);
    const double place = s / kPathStep - laps * n;
    const auto index = std::min(static_cast<std::size_t>(place), points_.size() - 1);
    const double share = place - static_cast<double>(index);
    return laps * winding_ + heading_[index] + share * (heading_[index + 1] - heading_[index]);
  }

 private:
  [[nodiscard]] Eigen::Vector3d at(double place) const {
    const std::size_t n = waypoints_.size();
    const auto i = static_cast<std::size_t>(place);
    const double u = place - static_cast<double>(i);
    const double v = 1.0 - u;
    return (v * v * v * waypoints_[i % n] + (3 * u * u * u - 6 * u * u + 4) * waypoints_[(i + 1) % n] +
            (3 * v * v * v - 6 * v * v + 4) * waypoints_[(i + 2) % n] + u * u * u * waypoints_[(i + 3) % n]) /
           6.0;
  }
  // Direction to the point half a metre ahead, unwrapped along one lap, smoothed by a Gaussian along the
  // path.
  void smoothHeading(double sigma) {
    const auto n = static_cast<std::ptrdiff_t>(points_.size());
    const auto ahead = static_cast<std::ptrdiff_t>(kHeadingAhead / kPathStep);
    std::vector<double> raw;
    for (std::ptrdiff_t i = 0; i <= n; ++i) {
      const Eigen::Vector3d chord =
          points_[static_cast<std::size_t>((i + ahead) % n)] - points_[static_cast<std::size_t>(i % n)];
      const double angle = std::atan2(chord.y(), chord.x());
      raw.push_back(raw.empty() ? angle : raw.back() + std::remainder(angle - raw.back(), kTwoPi));
    }
    winding_ = raw.back() - raw.front();
    const auto reach = static_cast<std::ptrdiff_t>(std::ceil(3.0 * sigma / kPathStep));
    heading_.assign(static_cast<std::size_t>(n) + 1, 0.0);
    for (std::ptrdiff_t i = 0; i <= n; ++i) {
      double sum = 0;
      double weight_sum = 0;
      for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
        const double distance = static_cast<double>(k) * kPathStep / sigma;
        const double weight = std::exp(-0.5 * distance * distance);
        const std::ptrdiff_t lap = (i + k) < 0 ? (i + k + 1) / n - 1 : (i + k) / n;
        const auto index = static_cast<std::size_t>(i + k - lap * n);
        sum += weight * (raw[index] + static_cast<double>(lap) * winding_);
        weight_sum += weight;
      }
      heading_[static_cast<std::size_t>(i)] = sum / weight_sum;
    }
  }

  std::vector<Eigen::Vector3d> waypoints_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<double> heading_;  // one more than points_: the last is the first one lap later
  double winding_ = 0;           // rad per lap
};

// Share of full motion (1) at time t; `hover` receives the share of hovering.
double activityAt(const FlightSettings& settings, double t, double* hover) {
  double activity = 1;
  double hovering = 0;
  if (settings.rest_at_start > 0) activity = smoothStep((t - settings.rest_at_start) / kRamp);
  for (const RestPhase& rest : settings.rests) {
    const double slowed = smoothStep((t - rest.start + kRamp) / kRamp);
    const double share = slowed - smoothStep((t - rest.start - rest.duration) / kRamp);
    activity *= 1.0 - share;
    if (rest.hover) hovering += share;
  }
  if (hover != nullptr) *hover = hovering;
  return activity;
}

struct PathSample {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double heading = 0;  // rad, unwrapped
};

// Position and heading of the airframe every kKnotSpacing from -kMargin on. `activity_time` advances with the
// activity, so that all oscillations stop at rest.
std::vector<PathSample> samplePath(const Tour& tour, const FlightSettings& settings) {
  Random random(settings.seed, 11);
  const RoundedTour path(tour.waypoints, kHeadingSmooth * std::max(settings.speed, 0.2));
  const double swing = settings.aggressiveness;
  std::array<Oscillation, 3> sway{Oscillation(random, 0.10 * swing, 0.15, 0.5),
                                  Oscillation(random, 0.10 * swing, 0.15, 0.5),
                                  Oscillation(random, 0.10 * swing, 0.15, 0.5)};
  std::array<Oscillation, 3> drift{Oscillation(random, 0.03, 0.1, 0.8), Oscillation(random, 0.03, 0.1, 0.8),
                                   Oscillation(random, 0.03, 0.1, 0.8)};
  const Oscillation scan(random, 0.45 * swing, 0.08, 0.3);
  const Oscillation pace(random, 0.3 * std::min(swing, 2.0), 0.05, 0.2);
  const double begin = random.uniform(0.0, settings.rest_at_start > 0 ? 0.0 : path.length());

  std::vector<PathSample> samples;
  constexpr int kSubsteps = 10;
  const double step = kKnotSpacing / kSubsteps;
  const auto count =
      static_cast<std::size_t>(std::ceil((settings.duration + 2 * kMargin) / kKnotSpacing)) + 6;
  double s = begin;
  double activity_time = 0;
  double climb_time = 0;
  double hover_time = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double t = -kMargin + kKnotSpacing * static_cast<double>(i);
    double hover = 0;
    activityAt(settings, t, &hover);
    PathSample sample;
    sample.position = path(s);
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      sample.position[axis] += sway[a](activity_time) + hover * drift[a](hover_time);
    }
    if (settings.start_on_ground && settings.rest_at_start > 0) {
      const double lift = smoothStep(climb_time / kClimb);
      const double ground = tour.floor + kGroundClearance;
      sample.position.z() = ground + lift * (sample.position.z() - ground);
    }
    sample.heading = path.heading(s) + scan(activity_time);
    samples.push_back(sample);
    for (int k = 0; k < kSubsteps; ++k) {
      const double middle = t + (k + 0.5) * step;
      const double activity = activityAt(settings, middle, &hover);
      // The take-off from the ground comes first: forward motion grows with height.
      const bool climbing = settings.start_on_ground && settings.rest_at_start > 0;
      const double lift = climbing ? smoothStep(climb_time / kClimb) : 1.0;
      climb_time += step * activity;
      s += step * activity * lift * settings.speed * std::max(0.2, 1.0 + pace(activity_time));
      activity_time += step * activity * lift;
      hover_time += step * hover;
    }
  }
  return samples;
}

}  // namespace

Eigen::Quaterniond eurocBodyAxes() {
  Eigen::Matrix3d R;
  R << 0, 0, 1, 0, -1, 0, 1, 0, 0;  // columns: body x, y, z in forward-left-up
  return Eigen::Quaterniond(R);
}

SplineTrajectory flyTour(const Tour& tour, const FlightSettings& settings) {
  const std::vector<PathSample> samples = samplePath(tour, settings);
  std::vector<SE3> controls;
  controls.reserve(samples.size() - 2);
  for (std::size_t i = 1; i + 1 < samples.size(); ++i) {
    const Eigen::Vector3d acceleration =
        (samples[i - 1].position - 2.0 * samples[i].position + samples[i + 1].position) /
        (kKnotSpacing * kKnotSpacing);
    const Eigen::Vector3d up = (acceleration + settings.gravity * Eigen::Vector3d::UnitZ()).normalized();
    const Eigen::Vector3d course(std::cos(samples[i].heading), std::sin(samples[i].heading), 0.0);
    Eigen::Matrix3d R_world_flu;
    R_world_flu.col(2) = up;
    R_world_flu.col(1) = up.cross(course).normalized();
    R_world_flu.col(0) = R_world_flu.col(1).cross(up);
    controls.emplace_back(Eigen::Quaterniond(R_world_flu) * settings.R_flu_body, samples[i].position);
  }
  // Control 0 stands kMargin - kKnotSpacing before zero; the first segment begins 2 controls later.
  const double start = -kMargin + kKnotSpacing * (1.0 + static_cast<double>(SplineTrajectory::kCentreOffset));
  return {start, kKnotSpacing, std::move(controls)};
}

}  // namespace swiftlet
