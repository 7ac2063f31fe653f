#include "tests/frontend/log_reader.hpp"

#include <png.h>
#include <turbojpeg.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "estimator/geometry/so3.hpp"

namespace swiftlet::testing {
namespace {

std::vector<std::vector<std::string>> readCsv(const std::string& path) {
  std::vector<std::vector<std::string>> rows;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> row;
    std::stringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ',');) {
      while (!cell.empty() && (cell.back() == '\r' || cell.back() == ' ')) cell.pop_back();
      row.push_back(cell);
    }
    rows.push_back(row);
  }
  return rows;
}

Eigen::Vector3d vectorAt(const std::vector<std::string>& row, std::size_t first) {
  return {std::stod(row[first]), std::stod(row[first + 1]), std::stod(row[first + 2])};
}

std::vector<std::uint8_t> readBytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

EurocLog EurocLog::open(const std::string& folder) {
  EurocLog log;
  log.folder = folder + "/mav0/";
  if (!std::filesystem::exists(log.folder)) return log;
  for (std::size_t c = 0; c < 2; ++c) {
    const YAML::Node yaml = YAML::LoadFile(log.folder + "cam" + std::to_string(c) + "/sensor.yaml");
    Eigen::Vector4d intrinsics;
    Eigen::Vector4d distortion;
    for (int i = 0; i < 4; ++i) {
      intrinsics[i] = yaml["intrinsics"][i].as<double>();
      distortion[i] = yaml["distortion_coefficients"][i].as<double>();
    }
    log.rig.camera[c] = CameraModel(CameraKind::kPinholeRadtan, yaml["resolution"][0].as<int>(),
                                    yaml["resolution"][1].as<int>(), intrinsics, distortion);
    Eigen::Matrix4d T;
    for (int i = 0; i < 16; ++i) T(i / 4, i % 4) = yaml["T_BS"]["data"][i].as<double>();
    log.rig.T_body_cam[c] = SE3(Eigen::Matrix3d(T.topLeftCorner<3, 3>()), T.topRightCorner<3, 1>());
  }
  log.rig.camera_count = 2;
  std::vector<std::int64_t> right;
  for (const auto& row : readCsv(log.folder + "cam1/data.csv")) right.push_back(std::stoll(row[0]));
  for (const auto& row : readCsv(log.folder + "cam0/data.csv")) {
    const std::int64_t stamp = std::stoll(row[0]);
    if (std::find(right.begin(), right.end(), stamp) != right.end()) log.stamps.push_back(stamp);
  }
  for (const auto& row : readCsv(log.folder + "state_groundtruth_estimate0/data.csv")) {
    TruthPose pose;
    pose.stamp = std::stoll(row[0]);
    const Eigen::Quaterniond q(std::stod(row[4]), std::stod(row[5]), std::stod(row[6]), std::stod(row[7]));
    pose.T_world_body = SE3(q, vectorAt(row, 1));
    pose.bias_gyro = vectorAt(row, 11);
    log.truth.push_back(pose);
  }
  for (const auto& row : readCsv(log.folder + "imu0/data.csv")) {
    log.gyro.push_back({std::stoll(row[0]), vectorAt(row, 1)});
  }
  return log;
}

GreyImage EurocLog::image(std::size_t camera, std::int64_t stamp) const {
  GreyImage image;
  const std::string base = folder + "cam" + std::to_string(camera) + "/data/" + std::to_string(stamp);
  const std::vector<std::uint8_t> bytes = readBytes(base + ".jpg");
  if (bytes.empty()) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    if (png_image_begin_read_from_file(&png, (base + ".png").c_str()) == 0) return image;
    png.format = PNG_FORMAT_GRAY;
    image.width = static_cast<int>(png.width);
    image.height = static_cast<int>(png.height);
    image.pixels.resize(PNG_IMAGE_SIZE(png));
    png_image_finish_read(&png, nullptr, image.pixels.data(), 0, nullptr);
    return image;
  }
  const tjhandle handle = tjInitDecompress();
  int subsampling = 0;
  int colour = 0;
  if (tjDecompressHeader3(handle, bytes.data(), bytes.size(), &image.width, &image.height, &subsampling,
                          &colour) == 0) {
    image.pixels.resize(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
    tjDecompress2(handle, bytes.data(), bytes.size(), image.pixels.data(), image.width, 0, image.height,
                  TJPF_GRAY, 0);
  }
  tjDestroy(handle);
  return image;
}

DepthImage EurocLog::depth(std::int64_t stamp) const {
  DepthImage depth;
  const std::string path = folder + "depth0/data/" + std::to_string(stamp) + ".png";
  if (!std::filesystem::exists(path)) return depth;
  // The simplified interface would apply a gamma to 16-bit grey; the full one gives the raw values.
  FILE* file = std::fopen(path.c_str(), "rb");
  png_structp reader = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(reader);
  png_init_io(reader, file);
  png_read_png(reader, info, PNG_TRANSFORM_SWAP_ENDIAN, nullptr);
  depth.width = static_cast<int>(png_get_image_width(reader, info));
  depth.height = static_cast<int>(png_get_image_height(reader, info));
  png_bytepp rows = png_get_rows(reader, info);
  for (int y = 0; y < depth.height; ++y) {
    const auto* row = reinterpret_cast<const std::uint16_t*>(rows[y]);
    depth.millimetres.insert(depth.millimetres.end(), row, row + depth.width);
  }
  png_destroy_read_struct(&reader, &info, nullptr);
  std::fclose(file);
  return depth;
}

bool EurocLog::pose(std::int64_t stamp, SE3& T_world_body) const {
  const auto after = std::lower_bound(truth.begin(), truth.end(), stamp,
                                      [](const TruthPose& p, std::int64_t s) { return p.stamp < s; });
  if (after == truth.end()) return false;
  if (after->stamp == stamp) {
    T_world_body = after->T_world_body;
    return true;
  }
  if (after == truth.begin()) return false;
  const auto before = after - 1;
  const double t =
      static_cast<double>(stamp - before->stamp) / static_cast<double>(after->stamp - before->stamp);
  T_world_body = SE3(before->T_world_body.rotation.slerp(t, after->T_world_body.rotation),
                     (1 - t) * before->T_world_body.translation + t * after->T_world_body.translation);
  return true;
}

Eigen::Quaterniond EurocLog::rotation(std::int64_t from, std::int64_t to, const Eigen::Vector3d& bias) const {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  auto sample = std::lower_bound(gyro.begin(), gyro.end(), from,
                                 [](const GyroSample& g, std::int64_t s) { return g.stamp < s; });
  for (; sample != gyro.end() && sample + 1 != gyro.end() && sample->stamp < to; ++sample) {
    const std::int64_t end = std::min((sample + 1)->stamp, to);
    const double dt = static_cast<double>(end - sample->stamp) * 1e-9;
    const Eigen::Vector3d rate = 0.5 * (sample->rate + (sample + 1)->rate) - bias;
    q = q * expSo3(rate * dt);
  }
  return q.normalized();
}

std::string dataFolder() {
  const char* set = std::getenv("SWIFTLET_DATA");
  return set != nullptr ? set : SWIFTLET_SOURCE_ROOT "/../shared/data";
}

}  // namespace swiftlet::testing
