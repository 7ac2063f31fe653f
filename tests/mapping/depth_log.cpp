#include "tests/mapping/depth_log.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "drivers/calibration/calibration.hpp"
#include "drivers/recorded/image_list.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"

namespace swiftlet::testing {
namespace {

namespace fs = std::filesystem;

void readSensor(const std::string& file, DepthLog& log, double& unit) {
  const YAML::Node sensor = YAML::LoadFile(file);
  const auto intrinsics = sensor["intrinsics"].as<std::vector<double>>();
  const auto resolution = sensor["resolution"].as<std::vector<int>>();
  const auto T = sensor["T_BS"]["data"].as<std::vector<double>>();
  log.camera = {intrinsics.at(0), intrinsics.at(1), intrinsics.at(2),
                intrinsics.at(3), resolution.at(0), resolution.at(1)};
  Eigen::Matrix3d R;
  Eigen::Vector3d p;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R(r, c) = T.at(static_cast<std::size_t>(4 * r + c));
    p[r] = T.at(static_cast<std::size_t>(4 * r + 3));
  }
  log.T_body_camera = SE3(R, p);
  unit = sensor["depth_unit_m"].as<double>();
}

cv::Mat readImage(const std::string& file, int type, const PinholeIntrinsics& camera) {
  const cv::Mat image = cv::imread(file, type == CV_8U ? cv::IMREAD_GRAYSCALE : cv::IMREAD_UNCHANGED);
  if (image.empty() || image.type() != type || image.cols != camera.width || image.rows != camera.height) {
    throw std::runtime_error("not the image expected: " + file);
  }
  return image;
}

/// Which raw pixel of camera 0 the depth camera's pixels see; -1: none.
std::vector<int> rawPixels(const PinholeIntrinsics& depth, const CameraModel& raw) {
  std::vector<int> map(depth.pixels(), -1);
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      const Eigen::Vector3d ray((u - depth.cx) / depth.fx, (v - depth.cy) / depth.fy, 1);
      Eigen::Vector2d pixel;
      if (!raw.project(ray, pixel) || !raw.inImage(pixel)) continue;
      map[static_cast<std::size_t>(v * depth.width + u)] =
          static_cast<int>(std::lround(pixel.y())) * raw.width() + static_cast<int>(std::lround(pixel.x()));
    }
  }
  return map;
}

std::vector<std::uint8_t> moved(const cv::Mat& image, const std::vector<int>& from, std::uint8_t nothing) {
  std::vector<std::uint8_t> result(from.size(), nothing);
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (from[i] >= 0) result[i] = image.data[from[i]];
  }
  return result;
}

/// The pose at a stamp between two of the trajectory's: rotation and translation at constant rates.
std::optional<SE3> poseAt(const Trajectory& trajectory, Stamp stamp) {
  const auto after = std::ranges::lower_bound(trajectory, stamp, {}, &TrajectoryPoint::stamp);
  if (after == trajectory.end()) return std::nullopt;
  if (after->stamp == stamp) return after->T_world_body;
  if (after == trajectory.begin()) return std::nullopt;
  const TrajectoryPoint& before = *std::prev(after);
  const double share = (stamp - before.stamp).seconds() / (after->stamp - before.stamp).seconds();
  const SE3& a = before.T_world_body;
  const SE3& b = after->T_world_body;
  return SE3(a.rotation.slerp(share, b.rotation), a.translation + share * (b.translation - a.translation));
}

/// A camera's image has any of these endings.
std::string existing(const std::string& stem) {
  for (const char* ending : {".png", ".jpg"}) {
    if (fs::exists(stem + ending)) return stem + ending;
  }
  return {};
}

}  // namespace

DepthImageView DepthLog::view(std::size_t i, bool with_labels) const {
  const DepthFrame& frame = frames[i];
  return {frame.stamp,
          camera,
          T_body_camera,
          frame.depth.data(),
          nullptr,
          frame.grey.data(),
          with_labels && !frame.labels.empty() ? frame.labels.data() : nullptr};
}

std::optional<std::string> findDepthLog(const std::string& name) {
  const char* given = std::getenv("SWIFTLET_DATA");
  const std::string folder =
      (given != nullptr ? given : SWIFTLET_SOURCE_ROOT "/../shared/data") + ("/" + name);
  if (fs::exists(folder + "/mav0/depth0/data.csv")) return folder;
  std::fprintf(stderr, "no log %s: left out (SWIFTLET_DATA names the folder)\n", folder.c_str());
  return std::nullopt;
}

DepthLog readDepthLog(const std::string& folder) {
  const std::string mav = folder + "/mav0";
  DepthLog log;
  log.name = fs::path(folder).filename().string();
  double unit = 0;
  readSensor(mav + "/depth0/sensor.yaml", log, unit);
  LogCounters counters;
  LogWarnings warnings;
  const Trajectory truth = readTrajectory(mav + "/state_groundtruth_estimate0/data.csv", counters, warnings);
  const Calibration calibration = readCalibration(mav);
  const std::vector<int> raw = rawPixels(log.camera, calibration.rig.camera[0]);
  for (const ImageRow& row : readImageList(mav + "/depth0/data.csv", counters, warnings)) {
    const std::optional<SE3> pose = poseAt(truth, row.stamp);
    if (!pose) continue;
    const cv::Mat depth = readImage(mav + "/depth0/data/" + row.file, CV_16U, log.camera);
    DepthFrame frame{row.stamp, *pose, {}, {}, {}};
    frame.depth.resize(log.camera.pixels());
    for (std::size_t i = 0; i < frame.depth.size(); ++i) {
      frame.depth[i] = static_cast<float>(unit * depth.at<std::uint16_t>(static_cast<int>(i)));
    }
    const std::string labels = mav + "/labels0/data/" + row.file;
    if (fs::exists(labels)) frame.labels = moved(readImage(labels, CV_8U, log.camera), raw, 0);
    const std::string image = existing(mav + "/cam0/data/" + std::to_string(row.stamp.ns));
    if (!image.empty())
      frame.grey = moved(readImage(image, CV_8U, log.camera), raw, 0);
    else
      frame.grey.assign(log.camera.pixels(), 128);
    log.frames.push_back(std::move(frame));
  }
  log.truth = readPly(folder + "/truth/mesh.ply");
  log.observed = readPly(folder + "/truth/observed.ply").vertices;
  return log;
}

}  // namespace swiftlet::testing
