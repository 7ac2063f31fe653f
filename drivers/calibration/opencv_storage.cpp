// OpenCV's FileStorage in YAML, as written by its sample programs for camera and stereo calibration.

#include <algorithm>
#include <array>

#include "drivers/calibration/bare_cameras.hpp"

namespace swiftlet {
namespace {

using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// OpenCV has no fixed names: these are those of its samples and common hand-written ones.
constexpr std::array<const char*, 4> kMatrix = {"camera_matrix", "Camera_Matrix", "cameraMatrix", "K"};
constexpr std::array<const char*, 4> kDistortion = {"distortion_coefficients", "Distortion_Coefficients",
                                                    "distCoeffs", "D"};
constexpr std::array<const char*, 3> kPairMatrix = {"M", "K", "cameraMatrix"};
constexpr std::array<const char*, 3> kPairDistortion = {"D", "D", "distCoeffs"};

/// The first value under one of several names, searched in all files.
template <typename Names>
std::optional<YamlField> find(const std::vector<YamlField>& files, const Names& names,
                              const std::string& suffix) {
  for (const char* name : names) {
    for (const YamlField& file : files) {
      if (file.has(name + suffix)) return file.at(name + suffix);
    }
  }
  return std::nullopt;
}

std::array<int, 2> sizeOf(const std::vector<YamlField>& files) {
  constexpr std::array<const char*, 3> kSize = {"image_size", "imageSize", "size"};
  if (const auto size = find(files, kSize, "")) return readResolution(*size);
  const auto width = find(files, std::array{"image_width", "image_Width"}, "");
  const auto height = find(files, std::array{"image_height", "image_Height"}, "");
  if (!width || !height) {
    throw files.front().error(
        "the image size is missing",
        "Add a line `image_size: [width, height]` with the size of the calibrated images");
  }
  checkResolution(width->place(), width->number(), height->number());
  return {static_cast<int>(width->number()), static_cast<int>(height->number())};
}

bool isFisheye(const std::vector<YamlField>& files) {
  const auto field = find(files, std::array{"fisheye_model", "fisheye"}, "");
  return field && field->text() != "0" && field->text() != "false";
}

LensFit storedLens(const YamlField& K_field, const YamlField& D_field, const std::vector<YamlField>& files,
                   Warnings& warnings) {
  SourceLens lens;
  const auto [width, height] = sizeOf(files);
  lens.width = width;
  lens.height = height;
  const std::vector<double> K = readMatrix(K_field, 3, 3);
  lens.intrinsics = readIntrinsics(K_field.place(), Eigen::Map<const RowMatrix>(K.data()));
  const std::vector<double> D = readNumbers(D_field);
  if (isFisheye(files)) {
    lens.name = "fisheye";
    setEquidistant(D_field.place(), D, lens);
  } else {
    lens.name = "OpenCV";
    setBrown(D_field.place(), D, lens);
    if (D.size() == 4 && !find(files, std::array{"fisheye_model", "fisheye"}, "")) {
      warnings.push_back(D_field.where() +
                         ": four coefficients are read as k1, k2, p1, p2; if they come from cv::fisheye, add "
                         "a line `fisheye_model: 1`");
    }
  }
  return acceptLens(K_field.place(), lens, warnings);
}

}  // namespace

Calibration parseOpenCvCalibration(const std::vector<NamedText>& texts, const NamedText& imu,
                                   const CalibrationOptions& options) {
  std::vector<YamlField> files;
  files.reserve(texts.size());
  for (const NamedText& text : texts) files.push_back(YamlField::parse(text.name, text.text));
  const YamlField imu_root = parseImu(imu);
  BareCameras bare;
  bare.form = "OpenCV";
  Warnings warnings;
  const auto add = [&](const std::optional<YamlField>& K, const std::optional<YamlField>& D) {
    if (!K) return;
    if (!D)
      throw K->error("camera matrix without distortion coefficients",
                     "Give both; use zeros for no distortion");
    CameraEntry entry;
    entry.lens = storedLens(*K, *D, files, warnings);
    entry.file = K->file();
    entry.line = K->line();
    entry.field = K->name();
    bare.cameras.push_back(entry);
  };
  for (const char* side : {"1", "2"}) add(find(files, kPairMatrix, side), find(files, kPairDistortion, side));
  if (bare.cameras.empty()) add(find(files, kMatrix, ""), find(files, kDistortion, ""));
  if (bare.cameras.empty()) {
    throw files.front().error("no camera matrix",
                              "Give M1, D1 (and M2, D2, R, T), or camera_matrix and "
                              "distortion_coefficients");
  }
  if (bare.cameras.size() == 2) {
    const auto R_field = find(files, std::array{"R"}, "");
    const auto T_field = find(files, std::array{"T"}, "");
    if (R_field && T_field) {
      const std::vector<double> R = readMatrix(*R_field, 3, 3);
      const std::vector<double> T = readMatrix(*T_field, 3, 1);
      bare.T_cam1_cam0 = checkedTransform(T_field->place(), Eigen::Map<const RowMatrix>(R.data()),
                                          Eigen::Vector3d(T.data()), warnings);
      bare.cameras[1].file = T_field->file();
      bare.cameras[1].line = T_field->line();
      bare.cameras[1].field = T_field->name();
    }
  }
  return joinToImu(bare, imu_root, std::move(warnings), options);
}

}  // namespace swiftlet
