#pragma once
// Reads a EuRoC/ASL folder: <sequence>/mav0/{cam0,cam1,imu0,state_groundtruth_estimate0}, or variants with
// other names and file kinds (png or jpg, 8 or 16 bit, Kalibr calibration beside the data); also in an
// archive that is not unpacked. See docs/formats.md for the columns and for accepted deviations.

#include <memory>
#include <string>

#include "drivers/input/file_tree.hpp"
#include "drivers/recorded/log_source.hpp"

namespace swiftlet {

/// Location of such a folder. An archive may have up to two folders around it.
struct AslFiles {
  std::shared_ptr<FileTree> tree;  ///< null: none found
  std::string folder;              ///< within the tree, usually "" or "mav0"

  [[nodiscard]] std::string at(const std::string& path) const {
    return folder.empty() || path.empty() ? folder + path : folder + "/" + path;
  }
};

/// Searches a folder (the sequence or its mav0) or an archive. InputError: the archive is damaged or holds
/// several logs.
AslFiles findAslFiles(const std::string& path);

/// Whether `path` is such a folder (the sequence or its mav0).
bool isAslFolder(const std::string& path);

/// Opens the folder or an archive with one. If there are no images, feature tracks (tracks0/data.csv) are
/// used instead. InputError if there is no IMU, no calibration, or neither images nor tracks (unless
/// LogOptions::without_images).
std::unique_ptr<LogSource> openAslFolder(const std::string& path, const LogOptions& options = {});

}  // namespace swiftlet
