#pragma once
// Image of a depth sensor to a depth image with standard deviations: 16-bit counts (a log's `depth0`) or
// float metres.
//
// Depth is along the axis of an ideal pinhole camera. Counts 0 and 65535 (some sensors write it for no
// depth), and values that are NaN, infinite, not positive or too near, are no depth; each kind is counted.
// sigma = floor + square (z - knee)^2 for z > knee, floor below; the defaults are Kinect's (Nguyen, Izadi,
// Lovell, 3DIMPVT 2012, eq. 2). mapping/map/view_warp.hpp adds grey values and labels of a camera. Errors:
// kInvalidInput (missing, or of another size), counted; the output is then unchanged. Deterministic.

#include <cstdint>

#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"
#include "mapping/depth/depth_buffer.hpp"

namespace swiftlet {

struct SensorDepthSettings {
  double metres_per_count = 0.001;
  double min_depth = 0.1;        ///< m
  double sigma_floor = 0.0012;   ///< m
  double sigma_square = 0.0019;  ///< 1/m
  double sigma_knee = 0.4;       ///< m
};

struct SensorDepthCounters {
  std::uint64_t images = 0;
  std::uint64_t refused = 0;  ///< images missing or of another size
  std::uint64_t pixels = 0;
  std::uint64_t missing = 0;       ///< count or value 0, or the largest count
  std::uint64_t not_finite = 0;    ///< NaN or infinite
  std::uint64_t out_of_range = 0;  ///< negative, or nearer than min_depth
};

class SensorDepth {
 public:
  SensorDepth(const PinholeIntrinsics& sensor, const SE3& T_body_sensor,
              const SensorDepthSettings& settings = {});

  [[nodiscard]] DepthBuffer makeBuffer() const;

  /// `stride`: values per row. Clears the output's grey values and labels.
  Status step(const std::uint16_t* counts, int width, int height, int stride, Stamp stamp, DepthBuffer& out);
  Status step(const float* metres, int width, int height, int stride, Stamp stamp, DepthBuffer& out);

  [[nodiscard]] const SensorDepthCounters& counters() const { return counters_; }

 private:
  template <typename Value>
  Status take(const Value* values, int width, int height, int stride, Stamp stamp, DepthBuffer& out);
  [[nodiscard]] float depthOf(double z);

  PinholeIntrinsics sensor_;
  SE3 T_body_sensor_;
  SensorDepthSettings settings_;
  SensorDepthCounters counters_;
};

}  // namespace swiftlet
