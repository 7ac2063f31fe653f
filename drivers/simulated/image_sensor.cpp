#include "drivers/simulated/image_sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "drivers/simulated/parallel.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

constexpr double kWhite = 255.0;
constexpr std::uint64_t kNoiseStream = 71;

// Normal random numbers drawn once: a random position in the table costs a tenth of a new number.
class NormalTable {
 public:
  static constexpr std::uint32_t kSize = 1U << 14U;
  NormalTable() {
    Random random(12345, kNoiseStream);
    double mean = 0;
    for (float& v : value_) {
      v = static_cast<float>(random.normal());
      mean += static_cast<double>(v) / kSize;
    }
    for (float& v : value_) v -= static_cast<float>(mean);
  }
  [[nodiscard]] float at(std::uint32_t bits) const { return value_[bits & (kSize - 1U)]; }

 private:
  std::array<float, kSize> value_{};
};

const NormalTable& normalTable() {
  static const NormalTable table;
  return table;
}

}  // namespace

void GainControl::start(double mean_radiance) {
  const double right = settings_.target_mean / (kWhite * settings_.light * std::max(mean_radiance, 1e-4));
  gain_ = std::min(settings_.start_error * right, settings_.max_gain);
  started_ = true;
}

void GainControl::update(double mean, double seconds) {
  // Limit one step to a factor of eight, for instance for a black image.
  const double ratio = std::clamp(settings_.target_mean / std::max(mean, 1.0), 0.125, 8.0);
  const double share = 1.0 - std::exp(-seconds / settings_.settle_time);
  gain_ = std::clamp(gain_ * std::pow(ratio, share), 0.01, settings_.max_gain);
}

double meanRadiance(const std::vector<float>& radiance, int width, int height) {
  constexpr int kStep = 8;
  double sum = 0;
  int count = 0;
  for (int y = kStep / 2; y < height; y += kStep) {
    for (int x = kStep / 2; x < width; x += kStep) {
      sum += static_cast<double>(radiance[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                          static_cast<std::size_t>(x)]);
      ++count;
    }
  }
  return count > 0 ? sum / count : 0.0;
}

double exposeImage(const std::vector<float>& radiance, int width, int height, const SensorSettings& settings,
                   double gain, std::uint64_t frame, std::uint32_t camera, int threads, std::uint8_t* grey) {
  const NormalTable& normals = normalTable();
  const double own_gain = gain * (camera == 1 ? settings.right_gain : 1.0);
  const auto scale = static_cast<float>(kWhite * own_gain * settings.light);
  const auto read_variance =
      static_cast<float>(settings.read_noise * settings.read_noise * own_gain * own_gain);
  const auto shot = static_cast<float>(settings.shot_noise * own_gain);
  const float half_x = 0.5F * static_cast<float>(width);
  const float half_y = 0.5F * static_cast<float>(height);
  const float per_radius = 1.0F / (half_x * half_x + half_y * half_y);
  const auto loss = static_cast<float>(settings.vignette);
  std::vector<std::int64_t> row_sum(static_cast<std::size_t>(height));
  parallelFor(height, threads, [&](int y) {
    Random random(
        settings.seed ^ (frame * 0x9E3779B97F4A7C15ULL),
        kNoiseStream + 2 * static_cast<std::uint64_t>(y) + 65536 * static_cast<std::uint64_t>(camera));
    const float* in = radiance.data() + static_cast<std::ptrdiff_t>(y) * width;
    std::uint8_t* out = grey + static_cast<std::ptrdiff_t>(y) * width;
    const float dy = static_cast<float>(y) - half_y;
    std::int64_t sum = 0;
    for (int x = 0; x < width; ++x) {
      const float dx = static_cast<float>(x) - half_x;
      const float lit = scale * in[x] * (1.0F - loss * (dx * dx + dy * dy) * per_radius);
      const float noise = std::sqrt(read_variance + shot * lit) * normals.at(random.next() >> 8U);
      out[x] = static_cast<std::uint8_t>(std::clamp(lit + noise + 0.5F, 0.0F, 255.0F));
      sum += out[x];
    }
    row_sum[static_cast<std::size_t>(y)] = sum;
  });
  const std::int64_t total = std::accumulate(row_sum.begin(), row_sum.end(), std::int64_t{0});
  return static_cast<double>(total) / (static_cast<double>(width) * height);
}

}  // namespace swiftlet
