#pragma once
// Writes a simulated flight as an EuRoC/ASL folder.
//
//   mav0/cam0, cam1        data.csv, sensor.yaml, data/<stamp>.png or .jpg
//   mav0/imu0              data.csv, sensor.yaml
//   mav0/state_groundtruth_estimate0   data.csv: 17 columns at IMU rate, exact, biases included
//   mav0/depth0            16 bit PNG [mm] of an ideal pinhole camera at cam0's true pose, 0: none
//                          or beyond 10 m
//   mav0/labels0           8 bit PNG in cam0's own (distorted) geometry; labels.csv: id, name
//   truth/mesh.ply         the surface, with labels; truth/observed.ply: its points that a depth
//                          image saw within 10 m, one per 3 cm cell
//   truth/cam0.yaml ...    the true calibration, if the given one was rotated or shifted
//   truth/simulation.yaml  the settings
// Stamps are whole nanoseconds. Depth and label images carry the true stamp of their instant plus the image
// stamp offset, like the images.

#include <functional>
#include <string>

#include "drivers/simulated/simulation_settings.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

/// Called after each image (or frame of tracks) with the number done and the total.
using SimulationProgress = std::function<void(int done, int total)>;

/// Called with each frame of feature tracks. Throw std::exception if it cannot be written.
using TrackSink = std::function<void(const TrackedFrame& frame)>;

/// Simulates the flight and writes it; existing files of the same names are replaced. kInvalidInput for an
/// invalid setting, kFailed if a file cannot be read or written; `message`, if given, names the setting or
/// the file. Cost: 10 pairs of 752 x 480 per second on two idle cores with JPEG.
Status simulateToFolder(const SimulationSettings& settings, const std::string& folder,
                        const SimulationProgress& progress = {}, std::string* message = nullptr);

/// The same without rendering: feature tracks go to `sink`, which chooses the file format; images, depth and
/// labels are not written. Frames in which no camera took an image are omitted. Also kFailed if the folder
/// holds images, since these would be from another flight.
Status simulateTracksToFolder(const SimulationSettings& settings, const std::string& folder,
                              const TrackSink& sink, const SimulationProgress& progress = {},
                              std::string* message = nullptr);

}  // namespace swiftlet
