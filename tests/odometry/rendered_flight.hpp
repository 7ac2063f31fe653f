#pragma once
// A simulated flight as the front-end sees it: images, IMU samples and the truth. Images are rendered once
// into a folder and read again from there, so that many runs share them. For figures made by hand.

#include <string>
#include <vector>

#include "drivers/simulated/simulated_flight.hpp"
#include "estimator/messages/frames.hpp"
#include "tests/odometry/faulty_flight.hpp"
#include "tests/odometry/odometry_run.hpp"

namespace swiftlet::test {

/// Rate and densities of the IMU of the log imu_broad, from its second of least motion.
ImuNoise broadImu();

class RenderedFlight {
 public:
  /// `folder`: where this flight's images are, or will be once they are rendered: a folder that is there is
  /// whole. All images are held decoded: 29 MB a second for 752 x 480 stereo at 20 Hz.
  RenderedFlight(const SimulationSettings& settings, const std::string& folder);

  RenderedFlight(const RenderedFlight&) = delete;
  RenderedFlight& operator=(const RenderedFlight&) = delete;

  [[nodiscard]] const SimulatedFlight& flight() const { return flight_; }
  [[nodiscard]] std::size_t frameCount() const { return frames_.size(); }
  /// Seconds of the trajectory at which frame k was taken.
  [[nodiscard]] double seconds(std::size_t k) const { return flight_.imageTime(static_cast<int>(k)); }
  [[nodiscard]] GivenFlight given() const;
  /// The same flight with another IMU on board.
  [[nodiscard]] GivenFlight givenWithImu(const ImuNoise& noise, std::uint64_t seed) const;
  /// The true motion at frame k, biases left zero.
  [[nodiscard]] BodyState truth(std::size_t k) const;

  /// Front-end and back-end on the frames from `first` up to but not including `last`, and on the samples
  /// from half a second before. Times are since the first of these frames.
  [[nodiscard]] std::vector<RunFrame> fly(const GivenFlight& given, const OdometrySettings& settings,
                                          std::size_t first = 0, std::size_t last = ~std::size_t{0}) const;

 private:
  SimulatedFlight flight_;
  std::vector<StereoFrame> frames_;
  std::vector<std::vector<std::uint8_t>> pixels_;
};

}  // namespace swiftlet::test
