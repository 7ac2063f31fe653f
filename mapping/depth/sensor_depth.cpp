#include "mapping/depth/sensor_depth.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace swiftlet {

SensorDepth::SensorDepth(const PinholeIntrinsics& sensor, const SE3& T_body_sensor,
                         const SensorDepthSettings& settings)
    : sensor_(sensor), T_body_sensor_(T_body_sensor), settings_(settings) {}

DepthBuffer SensorDepth::makeBuffer() const { return DepthBuffer(sensor_); }

// 0 if there is no depth; counts the reason.
float SensorDepth::depthOf(double z) {
  if (!std::isfinite(z)) {
    ++counters_.not_finite;
    return 0;
  }
  if (z == 0) {
    ++counters_.missing;
    return 0;
  }
  if (z < settings_.min_depth) {
    ++counters_.out_of_range;
    return 0;
  }
  return static_cast<float>(z);
}

template <typename Value>
Status SensorDepth::take(const Value* values, int width, int height, int stride, Stamp stamp,
                         DepthBuffer& out) {
  const std::size_t pixels = sensor_.pixels();
  if (values == nullptr || width != sensor_.width || height != sensor_.height || stride < width ||
      out.depth.size() != pixels || out.sigma.size() != pixels) {
    ++counters_.refused;
    return {StatusCode::kInvalidInput,
            "depth: the sensor's image is missing or does not have its camera's size"};
  }
  const double scale = std::is_integral_v<Value> ? settings_.metres_per_count : 1.0;
  std::size_t i = 0;
  for (int y = 0; y < height; ++y) {
    const Value* const row = values + static_cast<std::ptrdiff_t>(y) * stride;
    for (int x = 0; x < width; ++x, ++i) {
      const bool saturated = std::is_integral_v<Value> && row[x] == std::numeric_limits<Value>::max();
      const float z = depthOf(saturated ? 0 : scale * static_cast<double>(row[x]));
      const double beyond = std::max(z - settings_.sigma_knee, 0.0);
      out.depth[i] = z;
      out.sigma[i] =
          z > 0 ? static_cast<float>(settings_.sigma_floor + settings_.sigma_square * beyond * beyond) : 0.0F;
    }
  }
  out.stamp = stamp;
  out.camera = sensor_;
  out.T_body_camera = T_body_sensor_;
  out.has_intensity = false;
  out.has_labels = false;
  ++counters_.images;
  counters_.pixels += pixels;
  return okStatus();
}

Status SensorDepth::step(const std::uint16_t* counts, int width, int height, int stride, Stamp stamp,
                         DepthBuffer& out) {
  return take(counts, width, height, stride, stamp, out);
}

Status SensorDepth::step(const float* metres, int width, int height, int stride, Stamp stamp,
                         DepthBuffer& out) {
  return take(metres, width, height, stride, stamp, out);
}

}  // namespace swiftlet
