#pragma once
// A EuRoC/ASL folder: <sequence>/mav0/{cam0,cam1,imu0,state_groundtruth_estimate0}, or relatives that
// differ in names and file kinds (png or jpg, 8 or 16 bit, Kalibr calibration beside the data); also in an
// archive that is not unpacked. See docs/formats.md for the columns and for what is tolerated.

#include <memory>
#include <string>

#include "drivers/input/file_tree.hpp"
#include "drivers/recorded/log_source.hpp"

namespace swiftlet {

/// Where such a folder lies. An archive may have up to two folders around it.
struct AslFiles {
  std::shared_ptr<FileTree> tree;  ///< null: there is none
  std::string folder;              ///< within the tree, "" or "mav0" as a rule

  [[nodiscard]] std::string at(const std::string& path) const {
    return folder.empty() || path.empty() ? folder + path : folder + "/" + path;
  }
};

/// Of a folder (the sequence or its mav0) or an archive. InputError: an archive that is damaged, or that
/// holds several logs.
AslFiles findAslFiles(const std::string& path);

/// True when `path` is such a folder (the sequence or its mav0).
bool isAslFolder(const std::string& path);

/// Opens it, or the one in an archive. Without any image, feature tracks (tracks0/data.csv) take their place.
/// InputError when there is no IMU, no calibration, or neither images nor tracks (unless
/// LogOptions::without_images).
std::unique_ptr<LogSource> openAslFolder(const std::string& path, const LogOptions& options = {});

}  // namespace swiftlet
