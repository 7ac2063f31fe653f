#pragma once
// Writes a calibration session as an EuRoC/ASL folder: the recording of an uncalibrated rig in front of a
// board.
//
//   mav0/cam0, cam1       data.csv, data/<stamp>.jpg or .png; sensor.yaml only if requested
//   mav0/imu0             data.csv, sensor.yaml with the noise
//   mav0/state_groundtruth_estimate0   as for a simulated flight (folder_writer.hpp)
//   truth/calibration     the true calibration as EuRoC files, including time shift and readout
//   truth/board.yaml      the board
//   truth/session.yaml    the settings, the IMU's matrices and the board's pose
// The board hangs in a furnished room. Images have lens blur, motion blur, noise and vignetting.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/simulated/board_renderer.hpp"
#include "drivers/simulated/calibration_session.hpp"
#include "drivers/simulated/camera_renderer.hpp"
#include "drivers/simulated/folder_writer.hpp"
#include "drivers/simulated/image_sensor.hpp"
#include "drivers/simulated/rig_presets.hpp"
#include "drivers/simulated/simulation_settings.hpp"
#include "drivers/simulated/textured_world.hpp"
#include "drivers/simulated/world.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/core/status.hpp"

namespace swiftlet {

struct SessionFolderSettings {
  RigKind rig = RigKind::kEuroc;
  std::uint64_t rig_seed = 1;  ///< of a random rig
  bool mono = false;           ///< camera 0 only
  /// For rigs that are not random: offset added to the image stamps, and the rolling shutter's readout.
  Duration image_stamp_offset;
  Duration readout;
  SessionSettings session;
  double exposure = 0.004;                    ///< s
  std::array<double, 2> lens_blur{0.5, 0.5};  ///< px, sigma of a Gaussian, for each camera
  SensorSettings sensor;
  ImageFormat format = ImageFormat::kJpeg;
  int jpeg_quality = 92;
  bool calibrated = false;  ///< write the cameras' true sensor.yaml into the log
  int threads = 2;
};

/// Errors as in simulateToFolder(). Cost: 5 pairs of 752 x 480 per second on two idle cores.
Status simulateSessionToFolder(const CalibrationTarget& target, const SessionFolderSettings& settings,
                               const std::string& folder, const SimulationProgress& progress = {},
                               std::string* message = nullptr);

/// Images of one camera of a session, without files; for tests.
class SessionCamera {
 public:
  /// The session and the world must outlive this.
  SessionCamera(const CalibrationSession& session, const TexturedWorld& world, std::size_t camera,
                const SessionFolderSettings& settings);
  /// Image k as radiance per pixel, before the sensor model.
  void render(int k, std::vector<float>& radiance) const;

 private:
  const CalibrationSession* session_;
  CameraRenderer room_;
  BoardRenderer board_;
  RenderSettings render_;
  double blur_;
};

/// A furnished room that contains only the session's cameras and board.
World sessionRoom(const CalibrationSession& session);

}  // namespace swiftlet
