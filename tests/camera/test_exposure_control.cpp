// The control of exposure and gain on a camera that is a straight line with noise, white at 255, and on
// images whose grey is known.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <deque>
#include <functional>
#include <vector>

#include "estimator/camera/exposure_control.hpp"
#include "estimator/core/random.hpp"
#include "tests/support/counted_malloc.hpp"

namespace swiftlet::test {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr double kFocal = 450;
constexpr Duration kPeriod = Duration::fromMilliseconds(50);
constexpr double kSlowTurn = 0.5;  // rad/s
const ExposureRange kRange{Duration{20'000}, Duration::fromMilliseconds(40), 16};
const ExposureSetting kStart{Duration::fromMilliseconds(4), 1};

struct Picture {
  std::vector<std::uint8_t> grey = std::vector<std::uint8_t>(kWidth * kHeight);
  [[nodiscard]] ImageView view() const { return {grey.data(), kWidth, kHeight, kWidth}; }
};

Picture flat(int level) {
  Picture picture;
  std::ranges::fill(picture.grey, static_cast<std::uint8_t>(level));
  return picture;
}

/// A camera that takes each request `delay` images later. Its scene has reflectances from 0.1 to 1.
class BenchCamera {
 public:
  BenchCamera(std::size_t delay, double noise) : noise_(noise), waiting_(delay, kStart) {}

  Picture take(double radiance) {
    in_force_ = waiting_.front();
    waiting_.pop_front();
    const double scale = 255 * radiance * in_force_.exposure.seconds() * in_force_.gain;
    Picture picture;
    double sum = 0;
    for (std::size_t i = 0; i < picture.grey.size(); ++i) {
      const double reflectance = 0.1 + 0.9 * static_cast<double>(i % 97) / 96;
      const double value = scale * reflectance + noise_ * random_.normal();
      picture.grey[i] = static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
      sum += picture.grey[i];
    }
    mean_ = sum / static_cast<double>(picture.grey.size());
    return picture;
  }
  void ask(const ExposureSetting& setting) { waiting_.push_back(setting); }

  [[nodiscard]] const ExposureSetting& inForce() const { return in_force_; }
  [[nodiscard]] double mean() const { return mean_; }

 private:
  double noise_;
  std::deque<ExposureSetting> waiting_;
  ExposureSetting in_force_;
  double mean_ = 0;
  Random random_{7, 1};
};

/// Mean reflectance 0.55: at this radiance kStart is right.
constexpr double kRight = 102 / (255 * 0.55 * 0.004);

struct Flown {
  std::vector<double> mean;
  std::vector<ExposureSetting> asked;
  std::vector<ExposureSetting> in_force;
};

Flown fly(
    std::size_t delay, double noise, int frames, const std::function<double(int)>& radiance,
    const std::function<double(int)>& turn = [](int) { return kSlowTurn; }) {
  ExposureControl control(kRange, kFocal, kPeriod, kStart);
  BenchCamera camera(delay, noise);
  Flown flown;
  for (int k = 0; k < frames; ++k) {
    const Picture picture = camera.take(radiance(k));
    const auto frame = static_cast<std::uint64_t>(k);
    flown.mean.push_back(camera.mean());
    flown.in_force.push_back(camera.inForce());
    flown.asked.push_back(control.update(frame, meterImage(picture.view()), turn(k)));
    camera.ask(flown.asked.back());
  }
  return flown;
}

/// The first image from which on all are within `share` of the target.
int settled(const Flown& flown, double share) {
  int first = static_cast<int>(flown.mean.size());
  while (first > 0 &&
         std::abs(flown.mean[static_cast<std::size_t>(first - 1)] / ExposureControl::kTargetMean - 1) <=
             share)
    --first;
  return first;
}

}  // namespace

TEST_CASE("the meter asks for what is missing to the mean") {
  CHECK(meterImage(flat(102).view()) == Approx(1.0));
  CHECK(meterImage(flat(51).view()) == Approx(2.0));
  CHECK(meterImage(flat(204).view()) == Approx(0.5));
  CHECK(meterImage(flat(0).view()) == Approx(10.0));
  CHECK(meterImage(flat(255).view()) < 0.25);
  CHECK(meterImage(ImageView{}) == 1.0);
}

TEST_CASE("lamps may be white, large windows may not") {
  const auto with_white = [](double share) {
    Picture picture = flat(60);
    for (int y = 0; y < kHeight; ++y) {
      std::fill_n(picture.grey.begin() + y * kWidth, std::lround(share * kWidth), std::uint8_t{255});
    }
    return meterImage(picture.view());
  };
  CHECK(with_white(0.04) > 1.4);
  CHECK(with_white(0.08) < 0.95);
  // The more white there is, the farther down: no leap on the way.
  double last = with_white(0.08);
  for (double share = 0.1; share <= 1.0; share += 0.02) {
    const double now = with_white(share);
    CHECK(now <= last + 1e-9);
    CHECK(now >= last - 0.05);
    last = now;
  }
}

TEST_CASE("a step of the light by twenty settles within a second, without overshoot") {
  for (const std::size_t delay : {1U, 2U, 3U}) {
    for (const double factor : {20.0, 0.05}) {
      INFO("delay " << delay << ", light times " << factor);
      const Flown flown = fly(delay, 1.0, 120, [&](int k) { return kRight * (k < 40 ? 1 : factor); });
      CHECK(settled(flown, 0.13) <= 40 + 20 + static_cast<int>(delay));
      double beyond = 0;
      for (std::size_t k = 41 + delay; k < flown.mean.size(); ++k) {
        const double error = flown.mean[k] / ExposureControl::kTargetMean - 1;
        beyond = std::max(beyond, factor > 1 ? -error : error);
      }
      CHECK(beyond < (delay == ExposureControl::kActingDelay ? 0.12 : 0.3));
    }
  }
}

TEST_CASE("a ramp of the light by twenty within two seconds is followed") {
  for (const std::size_t delay : {2U, 3U}) {
    for (const double direction : {1.0, -1.0}) {
      const Flown flown = fly(delay, 1.0, 120, [&](int k) {
        const double share = std::clamp((k - 40) / 40.0, 0.0, 1.0);
        // From the middle of what the camera can reach.
        return kRight * std::pow(20.0, direction * (share - 0.5));
      });
      INFO("delay " << delay << ", direction " << direction);
      for (std::size_t k = 40; k < flown.mean.size(); ++k) {
        CHECK(flown.mean[k] > 0.6 * ExposureControl::kTargetMean);
        CHECK(flown.mean[k] < 1.6 * ExposureControl::kTargetMean);
      }
      CHECK(settled(flown, 0.13) <= 90);
    }
  }
}

TEST_CASE("noise does not make it pump") {
  const Flown flown = fly(2, 12.0, 400, [](int k) { return kRight * (1 + 0.06 * std::sin(0.7 * k)); });
  int changes = 0;
  for (std::size_t k = 60; k < flown.asked.size(); ++k) {
    if (flown.asked[k] != flown.asked[k - 1]) ++changes;
  }
  CHECK(changes == 0);
}

TEST_CASE("coarse steps of the exposure do not make it pump") {
  // A webcam in the sun: multiples of 100 us, without a gain. And one with a gain, which makes up for it.
  for (const double most_gain : {1.0, 8.0}) {
    const ExposureRange coarse{Duration{100'000}, Duration::fromMilliseconds(40), most_gain, 1e-4};
    const ExposureSetting start{Duration{300'000}, 1};
    ExposureControl control(coarse, kFocal, kPeriod, start);
    std::deque<ExposureSetting> waiting(ExposureControl::kActingDelay, start);
    int changes = 0;
    double grey = 0;
    for (std::uint64_t k = 0; k < 200; ++k) {
      const ExposureSetting in_force = waiting.front();
      waiting.pop_front();
      const double light = k < 60 ? 1.0 : 0.55;
      grey = 102 / 0.00025 * light * in_force.exposure.seconds() * in_force.gain;
      const ExposureSetting before = control.asked();
      waiting.push_back(control.update(k, meterImage(flat(static_cast<int>(grey)).view()), kSlowTurn));
      CHECK(std::abs(waiting.back().exposure.ns % 100'000) == 0);
      changes += k > 100 && control.asked() != before ? 1 : 0;
    }
    INFO("gain up to " << most_gain);
    CHECK(changes == 0);
    CHECK(grey == Approx(102).epsilon(most_gain > 1 ? 0.13 : 0.34));
  }
}

TEST_CASE("near the target no step is larger than a tenth") {
  const Flown flown = fly(2, 2.0, 200, [](int k) { return kRight * (k < 40 ? 1.0 : 1.35); });
  for (std::size_t k = 41; k < flown.asked.size(); ++k) {
    const double before = flown.asked[k - 1].exposure.seconds() * flown.asked[k - 1].gain;
    const double after = flown.asked[k].exposure.seconds() * flown.asked[k].gain;
    CHECK(std::abs(std::log(after / before)) < 0.1001);
  }
  CHECK(settled(flown, 0.13) <= 60);
}

TEST_CASE("exposure is bounded by blur, and the gain takes the rest") {
  constexpr double kTurn = 2.0;
  const Flown flown = fly(
      2, 1.0, 200, [](int) { return kRight / 4; }, [](int k) { return k < 100 ? kSlowTurn : kTurn; });
  const auto blur = [](const ExposureSetting& setting, double turn) {
    return setting.exposure.seconds() * kFocal * turn;
  };
  CHECK(blur(flown.asked[99], kSlowTurn) == Approx(ExposureControl::kBlur).epsilon(0.01));
  CHECK(flown.asked[99].gain > 1.5);
  CHECK(blur(flown.asked[130], kTurn) <= 1.001 * ExposureControl::kBlur);
  CHECK(flown.asked[130].gain > 6);
  // What the exposure loses the gain gives, in the same image.
  for (std::size_t k = 100; k < flown.mean.size(); ++k) {
    CHECK(flown.mean[k] == Approx(ExposureControl::kTargetMean).epsilon(0.13));
  }
  // And a turn is remembered for a while: no change to and fro at each swing.
  ExposureControl control(kRange, kFocal, kPeriod, kStart);
  for (int k = 0; k < 60; ++k) control.update(static_cast<std::uint64_t>(k), 1.0, k % 6 == 0 ? 2.0 : 0.0);
  CHECK(control.asked().exposure.seconds() * kFocal * 2.0 < 1.4 * ExposureControl::kBlur);
}

TEST_CASE("at the end of the gain the exposure grows, and nothing winds up in the dark") {
  const Flown flown = fly(2, 1.0, 300, [](int k) { return k < 150 ? kRight / 2000 : kRight; });
  const ExposureSetting& dark = flown.asked[149];
  CHECK(dark.gain == Approx(kRange.most_gain));
  CHECK(dark.exposure.seconds() * kFocal * kSlowTurn == Approx(ExposureControl::kDarkBlur).epsilon(0.01));
  CHECK(settled(flown, 0.13) <= 150 + 30);
  // A camera that has no gain, and one whose shortest exposure is too long.
  ExposureControl plain({Duration{20'000}, Duration::fromMilliseconds(40), 1}, kFocal, kPeriod, kStart);
  for (std::uint64_t k = 0; k < 50; ++k) plain.update(k, 3.0, 1.0);
  CHECK(plain.asked().gain == 1.0);
  for (std::uint64_t k = 50; k < 200; ++k) plain.update(k, 0.2, 1.0);
  CHECK(plain.asked().exposure == Duration{20'000});
}

TEST_CASE("an image is taken with what was asked two images before") {
  ExposureControl control(kRange, kFocal, kPeriod, kStart);
  const Flown flown =
      fly(ExposureControl::kActingDelay, 1.0, 60, [](int k) { return kRight * (k < 20 ? 1 : 6); });
  for (std::uint64_t k = 0; k < 60; ++k) {
    CHECK(control.inForce(k) == flown.in_force[k]);
    control.follow(k, flown.asked[k]);
  }
  // Lost images are counted by their numbers.
  ExposureControl holes(kRange, kFocal, kPeriod, kStart);
  const ExposureSetting other{Duration::fromMilliseconds(2), 1};
  holes.follow(10, other);
  CHECK(holes.inForce(11) == kStart);
  CHECK(holes.inForce(15) == other);
}

TEST_CASE("a second camera follows, and takes over where the first left off") {
  ExposureControl first(kRange, kFocal, kPeriod, kStart);
  ExposureControl second(kRange, kFocal, kPeriod, kStart);
  for (std::uint64_t k = 0; k < 30; ++k) {
    second.follow(k, first.update(k, k < 20 ? 0.6 : 1.0, 1.0));
    CHECK(second.asked() == first.asked());
    CHECK(second.inForce(k) == first.inForce(k));
  }
  CHECK(second.update(30, 1.0, 1.0) == first.asked());
}

TEST_CASE("exposure control allocates nothing") {
  const Picture picture = flat(40);
  ExposureControl control(kRange, kFocal, kPeriod, kStart);
  const long before = malloc_calls;
  double sum = 0;
  for (std::uint64_t k = 0; k < 50; ++k) {
    sum += control.update(k, meterImage(picture.view()), 1.0).gain + control.inForce(k).gain;
  }
  CHECK(malloc_calls == before);
  CHECK(sum > 0);
#ifdef SWIFTLET_COUNTS_MALLOC
  CHECK(mallocIsCounted());
#endif
}

}  // namespace swiftlet::test
