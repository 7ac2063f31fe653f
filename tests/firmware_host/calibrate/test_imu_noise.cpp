// Noise of an IMU at rest: the Allan variance beside its definition, the fit beside noise of known densities,
// and what is said of logs that are too short, that move or that have holes.

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/lab/calibrate/imu_noise/allan_variance.hpp"
#include "firmware_host/lab/calibrate/imu_noise/imu_noise_run.hpp"
#include "firmware_host/lab/calibrate/imu_noise/noise_fit.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/input_error.hpp"

namespace swiftlet {
namespace {

struct NoiseOf {
  double density;
  double walk;
};

/// Six axes of white noise and a random walk.
class SixAxes {
 public:
  SixAxes(std::uint64_t seed, double rate, std::array<NoiseOf, 6> noise)
      : random_(seed), rate_(rate), noise_(noise) {}
  ImuSix next() {
    ImuSix reading;
    for (int i = 0; i < 6; ++i) {
      const NoiseOf& noise = noise_[static_cast<std::size_t>(i)];
      walk_[i] += noise.walk / std::sqrt(rate_) * random_.normal();
      reading[i] = walk_[i] + noise.density * std::sqrt(rate_) * random_.normal();
    }
    return reading;
  }

 private:
  Random random_;
  double rate_;
  std::array<NoiseOf, 6> noise_;
  ImuSix walk_ = ImuSix::Zero();
};

constexpr std::array<NoiseOf, 6> kEuroc = {
    {{1.7e-4, 2e-5}, {1.7e-4, 2e-5}, {1.7e-4, 2e-5}, {2e-3, 3e-3}, {2e-3, 3e-3}, {2e-3, 3e-3}}};
constexpr std::array<NoiseOf, 6> kConsumer = {
    {{8e-5, 2.2e-6}, {1.2e-4, 4e-6}, {8e-5, 2.2e-6}, {1.4e-3, 8.6e-5}, {1.4e-3, 2e-4}, {3e-3, 8.6e-5}}};

class CsvLog {
 public:
  CsvLog(const std::string& path, double rate) : file_(std::fopen(path.c_str(), "w")), period_(1 / rate) {}
  ~CsvLog() { std::fclose(file_); }
  CsvLog(const CsvLog&) = delete;
  CsvLog& operator=(const CsvLog&) = delete;
  void add(const ImuSix& reading, double jitter = 0) {
    std::fprintf(file_, "%lld",
                 static_cast<long long>(1e18) +
                     std::llround((static_cast<double>(count_++) * period_ + jitter) * 1e9));
    for (int i = 0; i < 6; ++i) std::fprintf(file_, ",%.9g", reading[i] + (i == 5 ? 9.81 : 0));
    std::fprintf(file_, "\n");
  }
  void skip(int samples) { count_ += samples; }

 private:
  std::FILE* file_;
  double period_;
  long long count_ = 0;
};

TEST_CASE("Allan variance is that of its definition, interruptions included") {
  Random random(3);
  constexpr double kPeriod = 0.01;
  AllanVariance variance(kPeriod);
  std::vector<std::vector<double>> stretches = {{}, {}};
  for (int i = 0; i < 700; ++i) {
    std::vector<double>& stretch = stretches[i < 301 ? 0 : 1];
    if (i == 301) variance.interrupt();
    stretch.push_back(5 + random.normal());
    variance.add(ImuSix::Constant(stretch.back()));
  }
  for (const AllanPoint& point : variance.points()) {
    const auto m = static_cast<std::size_t>(std::lround(point.tau / kPeriod));
    const std::size_t stride = std::max<std::size_t>(1, m / 16);
    double sum = 0;
    double terms = 0;
    double pairs = 0;
    for (const auto& stretch : stretches) {
      double last = 0;
      for (std::size_t end = 2 * m; end <= stretch.size(); end += stride) {
        double first_mean = 0;
        double second_mean = 0;
        for (std::size_t k = end - 2 * m; k < end - m; ++k) first_mean += stretch[k] / static_cast<double>(m);
        for (std::size_t k = end - m; k < end; ++k) second_mean += stretch[k] / static_cast<double>(m);
        sum += (second_mean - first_mean) * (second_mean - first_mean) / 2;
        ++terms;
        last = static_cast<double>(end);
      }
      pairs += last / static_cast<double>(2 * m);
    }
    INFO("tau " << point.tau);
    REQUIRE(terms > 0);
    CHECK(point.variance[2] == Approx(sum / terms).epsilon(1e-9));
    CHECK(point.pairs == Approx(pairs).epsilon(1e-9));
  }
}

TEST_CASE("Fitted densities and their sigmas, over seeds") {
  struct Case {
    const char* name;
    std::array<NoiseOf, 6> noise;
    double seconds;
    double least_known;  // part of the axes whose random walk is given
  };
  for (const Case& one :
       {Case{"EuRoC, 20 minutes", kEuroc, 1200, 0.95}, Case{"consumer, 2 hours", kConsumer, 7200, 0}}) {
    constexpr double kRate = 100;
    const std::uint64_t seeds = one.seconds > 3000 ? 8 : 30;
    double density_squares = 0;
    double walk_squares = 0;
    double axes = 0;
    double known = 0;
    double worst_density = 0;
    double beyond = 0;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      SixAxes axis(1000 + seed * 104729, kRate, one.noise);
      AllanVariance variance(1 / kRate);
      for (int i = 0; i < static_cast<int>(one.seconds * kRate); ++i) variance.add(axis.next());
      const std::vector<AllanPoint> points = variance.points();
      for (int i = 0; i < 6; ++i) {
        const AxisNoise found = fitNoise(points, i);
        const NoiseOf& truth = one.noise[static_cast<std::size_t>(i)];
        const double z = (found.density.value - truth.density) / found.density.sigma;
        density_squares += z * z;
        worst_density = std::max(worst_density, std::abs(found.density.value / truth.density - 1));
        ++axes;
        if (!found.walk) {
          CHECK(found.walk_limit > 0);
          continue;
        }
        ++known;
        const double zw = (found.walk->value - truth.walk) / found.walk->sigma;
        walk_squares += zw * zw;
        beyond += std::abs(zw) > 3 ? 1 : 0;
        CHECK(found.walk->sigma < kMostRelativeSigma * found.walk->value);
      }
    }
    const double density_z = std::sqrt(density_squares / axes);
    const double walk_z = std::sqrt(walk_squares / std::max(known, 1.0));
    std::printf(
        "%s: density z RMS %.2f, worst error %.2f %%; walk given for %.0f of %.0f, z RMS %.2f, %.0f beyond 3 "
        "sigma\n",
        one.name, density_z, 100 * worst_density, known, axes, walk_z, beyond);
    CHECK(density_z > 0.5);
    CHECK(density_z < 1.25);
    CHECK(worst_density < 0.02);
    CHECK(known >= one.least_known * axes);
    if (known > 20) CHECK(walk_z < 1.2);
    CHECK(beyond <= 0.03 * known + 1);
  }
}

TEST_CASE("A short log gives white noise alone, and its file says so") {
  const ScratchFolder folder("imu_noise_short");
  {
    CsvLog csv(folder.file("still.csv"), 200);
    SixAxes axis(11, 200, kConsumer);
    for (int i = 0; i < 200 * 60; ++i) csv.add(axis.next());
  }
  const ImuNoiseResult result = measureImuNoise(folder.file("still.csv"));
  CHECK(result.rate_hz == Approx(200).epsilon(1e-6));
  CHECK(result.motions.empty());
  CHECK(result.axis[0].density.value == Approx(8e-5).epsilon(0.05));
  CHECK_FALSE(result.axis[0].walk);
  CHECK(result.axis[0].walk_limit > 2.2e-6);
  const std::string yaml = imuNoiseYaml(result);
  CHECK(yaml.find("\ngyroscope_noise_density: ") != std::string::npos);
  CHECK(yaml.find("\n# gyroscope_random_walk: not measured") != std::string::npos);
  REQUIRE_FALSE(result.remarks.empty());
  CHECK(result.remarks.front().find("too short for the random walk of gyro x") != std::string::npos);
}

TEST_CASE("Motion, holes and jitter in a log at rest") {
  const ScratchFolder folder("imu_noise_moves");
  const std::string path = folder.file("still.csv");
  {
    CsvLog csv(path, 200);
    SixAxes axis(12, 200, kEuroc);
    Random random(5);
    for (int i = 0; i < 200 * 400; ++i) {
      if (i == 20000) csv.skip(200);  // a second is lost
      ImuSix reading = axis.next();
      const double t = i / 200.0;
      if (t > 250.3 && t < 252) reading[1] += 0.05 * std::sin(9 * t);  // somebody touches it
      csv.add(reading, 0.002 * random.uniform());
    }
  }
  const ImuNoiseResult result = measureImuNoise(path);
  CHECK(result.holes == 1);
  REQUIRE(result.motions.size() == 1);
  CHECK(result.motions[0].find("gyro y") != std::string::npos);
  CHECK(result.used_seconds > 390);
  CHECK(result.used_seconds < 399);
  for (std::size_t i = 0; i < 6; ++i)
    CHECK(result.axis[i].density.value == Approx(kEuroc[i].density).epsilon(0.03));

  {
    CsvLog csv(path, 200);
    SixAxes axis(13, 200, kEuroc);
    for (int i = 0; i < 200 * 60; ++i) {
      ImuSix reading = axis.next();
      reading.head<3>().array() += 0.3 * std::sin(i / 60.0);
      csv.add(reading);
    }
  }
  CHECK_THROWS_WITH(measureImuNoise(path), Catch::Contains("is not at rest") && Catch::Contains("gyro"));
  CHECK_THROWS_AS(measureImuNoise(folder.file("none.csv")), InputError);
}

TEST_CASE("A hole at the start of a log does not change its rate") {
  const ScratchFolder folder("imu_noise_hole");
  {
    CsvLog csv(folder.file("still.csv"), 200);
    SixAxes axis(11, 200, kConsumer);
    for (int i = 0; i < 200 * 60; ++i) {
      if (i == 1000) csv.skip(200 * 100);
      csv.add(axis.next());
    }
  }
  const ImuNoiseResult result = measureImuNoise(folder.file("still.csv"));
  CHECK(result.rate_hz == Approx(200).epsilon(1e-6));
  CHECK(result.holes == 1);
}

TEST_CASE("Wrong stamps and dead axes are refused") {
  const ScratchFolder folder("imu_noise_faults");
  const std::string path = folder.file("still.csv");
  const auto complaint = [&path](bool jump, bool dead) {
    {
      CsvLog csv(path, 200);
      SixAxes axis(11, 200, kConsumer);
      for (int i = 0; i < 200 * 60; ++i) {
        if (jump && i == 5) csv.skip(200 * 86400 * 11);
        ImuSix reading = axis.next();
        if (dead) reading[1] = 0.001;
        csv.add(reading);
      }
    }
    return test::messageOf([&] { (void)measureImuNoise(path); });
  };
  CHECK_THAT(complaint(true, false),
             Catch::Contains(path + ": timestamp: jumps from 1000000000.020 to 1000950400.025 s"));
  CHECK_THAT(complaint(false, true), Catch::Contains(path + ": gyro y: never changes"));
}

}  // namespace
}  // namespace swiftlet
