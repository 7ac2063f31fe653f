#pragma once
// Converts radiance to grey values: gain control, vignette, shot and read noise, eight bits.
//
// grey = 255 gain light vignette radiance + noise, noise variance = read^2 g^2 + shot g grey with g = gain /
// nominal gain: read noise and the grey value of one electron both grow with the amplifier. The gain follows
// the mean grey value of camera 0 (first order in time), so a flight's first images are too dark; it settles
// within about a second. Source of the noise model: EMVA standard 1288, release 4.0, section 2.

#include <cstdint>
#include <vector>

namespace swiftlet {

struct SensorSettings {
  double light = 1.0;         ///< scene light; 0.05: a dim room
  double read_noise = 0.7;    ///< grey values at nominal gain
  double shot_noise = 0.018;  ///< grey values squared per grey value at nominal gain
  double vignette = 0.35;     ///< light lost in the image's corners
  double target_mean = 100;   ///< target of the gain control [grey value]
  double settle_time = 0.25;  ///< s, time constant of the gain control
  double start_error = 0.45;  ///< gain at the first image relative to the right one
  double max_gain = 24;       ///< relative to nominal
  double right_gain = 0.96;   ///< sensitivity of camera 1 relative to camera 0
  std::uint64_t seed = 1;
};

/// One gain for both cameras.
class GainControl {
 public:
  explicit GainControl(const SensorSettings& settings) : settings_(settings) {}
  [[nodiscard]] double gain() const { return gain_; }
  /// Call before the first image: sets the starting gain from the radiance seen by camera 0.
  void start(double mean_radiance);
  /// Call after an image of mean grey value `mean`, `seconds` before the next.
  void update(double mean, double seconds);
  [[nodiscard]] bool started() const { return started_; }

 private:
  SensorSettings settings_;
  double gain_ = 1;
  bool started_ = false;
};

/// Mean of the radiance (times light), every 8th pixel of every 8th row.
double meanRadiance(const std::vector<float>& radiance, int width, int height);

/// Fills `grey` (width x height) and returns its mean. The noise depends on the settings' seed, `frame` and
/// `camera`, not on the number of threads.
double exposeImage(const std::vector<float>& radiance, int width, int height, const SensorSettings& settings,
                   double gain, std::uint64_t frame, std::uint32_t camera, int threads, std::uint8_t* grey);

}  // namespace swiftlet
