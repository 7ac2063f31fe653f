// ROS's camera_info YAML, as camera_calibration writes it.

#include <algorithm>
#include <span>
#include <utility>

#include "drivers/calibration/bare_cameras.hpp"
#include "drivers/calibration/camera_info.hpp"

namespace swiftlet {
namespace {

void readArray(const YamlField& root, const std::string& key, std::size_t columns, std::span<double> out) {
  const YamlField field = root.at(key, "Give the file as written by camera_calibration");
  const std::vector<double> values = readMatrix(field, out.size() / columns, columns);
  std::copy(values.begin(), values.end(), out.begin());
}

struct InfoFile {
  CameraInfo info;
  std::string file;
  InputPlace pair;  ///< where a second camera states its pose relative to the first
};

InfoFile readInfo(const NamedText& text) {
  const YamlField root = YamlField::parse(text.name, text.text);
  InfoFile out;
  out.file = text.name;
  CameraInfo& info = out.info;
  const char* const size_remedy = "Give the size in pixels of the calibrated images";
  const YamlField width = root.at("image_width", size_remedy);
  const double height = root.at("image_height", size_remedy).number();
  checkResolution(width.place(), width.number(), height);
  info.width = static_cast<int>(width.number());
  info.height = static_cast<int>(height);
  info.distortion_model =
      root.has("distortion_model") ? root.at("distortion_model").text() : std::string("plumb_bob");
  info.D = readNumbers(root.at("distortion_coefficients", "Give k1, k2, p1, p2, k3"));
  readArray(root, "camera_matrix", 3, info.K);
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  if (root.has("rectification_matrix")) readArray(root, "rectification_matrix", 3, info.R);
  if (root.has("projection_matrix")) {
    readArray(root, "projection_matrix", 4, info.P);
    out.pair = root.at("projection_matrix").place();
  }
  return out;
}

}  // namespace

Calibration parseCameraInfoCalibration(const std::vector<NamedText>& cameras, const NamedText& imu,
                                       const CalibrationOptions& options) {
  const YamlField imu_root = parseImu(imu);
  const bool rectified = readsRectified(imu_root);
  std::vector<InfoFile> files;
  files.reserve(cameras.size());
  for (const NamedText& camera : cameras) files.push_back(readInfo(camera));
  // The camera with a baseline in P is the second one, whatever the files are called.
  if (files.size() == 2 && files[0].info.P[3] != 0 && files[1].info.P[3] == 0) std::swap(files[0], files[1]);
  BareCameras bare;
  bare.form = "ROS CameraInfo";
  Warnings warnings;
  for (const InfoFile& file : files) {
    CameraEntry entry;
    if (rectified) {
      entry.lens.model = rectifiedLens(file.info, file.file, warnings);
    } else {
      entry.lens = rawLensFit(file.info, file.file, warnings);
    }
    entry.file = file.file;
    entry.line = file.pair.line;
    entry.field = file.pair.field;
    bare.cameras.push_back(entry);
  }
  if (files.size() == 2 && files[1].info.P[3] != 0) {
    bare.T_cam1_cam0 = rectified ? rectifiedPair(files[1].info, files[1].file)
                                 : rawPair(files[0].info, files[1].info, files[1].file);
  }
  return joinToImu(bare, imu_root, std::move(warnings), options);
}

}  // namespace swiftlet
