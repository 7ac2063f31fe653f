#pragma once
// A EuRoC/ASL folder: <sequence>/mav0/{cam0,cam1,imu0,state_groundtruth_estimate0}, or relatives that
// differ in names and file kinds (png or jpg, 8 or 16 bit, Kalibr calibration beside the data).
// See docs/formats.md for the columns and for what is tolerated.

#include <memory>
#include <string>

#include "drivers/recorded/log_source.hpp"

namespace swiftlet {

/// True when `path` is such a folder (the sequence or its mav0).
bool isAslFolder(const std::string& path);

/// Opens it. Without any image, feature tracks (tracks0/data.csv) take their place. InputError when
/// there is no IMU, no calibration, or neither images nor tracks (unless LogOptions::without_images).
std::unique_ptr<LogSource> openAslFolder(const std::string& path, const LogOptions& options = {});

}  // namespace swiftlet
