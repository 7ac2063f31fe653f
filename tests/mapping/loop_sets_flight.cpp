// Flights in EuRoC folders: images, poses of the truth, and which pairs see the same surface.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "drivers/calibration/calibration.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/lab/evaluation/association.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "mapping/place/feature_depth.hpp"
#include "mapping/place/place_extractor.hpp"
#include "tests/mapping/loop_sets.hpp"
#include "tests/mapping/loop_sets_depth.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::loop_sets {
namespace {

constexpr double kRevisitOverlap = 0.4;
constexpr double kApartOverlap = 0.05;
constexpr int kGridColumns = 31;    // of the depth image, for overlaps
constexpr int kMeshDepthScale = 2;  // px of camera 0 for one of depths drawn from a mesh
constexpr double kTruthGap = 0.02;  // s between the poses of the truth around an image

ImageView viewOf(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

using Points = std::vector<Eigen::Vector3d>;

// On a grid of the depth image, in the depth camera.
Points surfaceOf(const ImageSet& set, const Shot& shot) {
  const Eigen::Vector4d& k = set.depth_camera;
  Points points;
  const int step = std::max(1, shot.depth.cols / kGridColumns);
  for (int y = step / 2; y < shot.depth.rows; y += step) {
    for (int x = step / 2; x < shot.depth.cols; x += step) {
      const double z = shot.depth.at<float>(y, x);
      if (z > 0) points.emplace_back((x - k[2]) / k[0] * z, (y - k[3]) / k[1] * z, z);
    }
  }
  return points;
}

// Where there is no depth image: corners that both cameras see.
Points cornersOf(const ImageSet& set, const Shot& shot, PlaceExtractor& extractor, StereoDepth& stereo) {
  const auto keyframe = std::make_unique<PlaceKeyframe>();
  Points points;
  std::size_t found = 0;
  if (!extractor.extract(viewOf(shot.grey[0]), set.rig.camera[0], TrackedFrame{}, *keyframe).ok() ||
      !stereo.fill(viewOf(shot.grey[0]), viewOf(shot.grey[1]), *keyframe, found).ok()) {
    return points;
  }
  for (const PlaceFeature& f : keyframe->features) {
    if (f.inverse_depth > 0)
      points.push_back(f.bearing.cast<double>() / static_cast<double>(f.inverse_depth));
  }
  return points;
}

// Share of a's points that b sees.
double overlap(const ImageSet& set, const Shot& a, const Points& points, const Shot& b) {
  const SE3 T_b_a = (b.T_world_body * set.T_body_depth).inverse() * a.T_world_body * set.T_body_depth;
  const Eigen::Vector4d& k = set.depth_camera;
  const CameraModel& camera = set.rig.camera[0];
  int seen = 0;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d p = T_b_a * point;
    if (!(p.z() > 0.05)) continue;
    if (b.depth.empty()) {
      Eigen::Vector2d pixel;
      if (camera.project(p, pixel) && camera.inImage(pixel, 1)) ++seen;
      continue;
    }
    const auto u = static_cast<int>(std::lround(k[0] * p.x() / p.z() + k[2]));
    const auto v = static_cast<int>(std::lround(k[1] * p.y() / p.z() + k[3]));
    if (u < 0 || v < 0 || u >= b.depth.cols || v >= b.depth.rows) continue;
    if (std::abs(static_cast<double>(b.depth.at<float>(v, u)) - p.z()) < 0.05 + 0.02 * p.z()) ++seen;
  }
  return points.empty() ? 0 : static_cast<double>(seen) / static_cast<double>(points.size());
}

void setFlightKinds(ImageSet& set, double min_seconds) {
  std::vector<Points> points;
  PlaceExtractor extractor(set.rig.camera[0].width(), set.rig.camera[0].height());
  StereoDepth stereo(set.rig);
  for (const Shot& shot : set.shots) {
    points.push_back(shot.depth.empty() ? cornersOf(set, shot, extractor, stereo) : surfaceOf(set, shot));
  }
  set.kind.assign(set.shots.size(), std::vector<PairKind>(set.shots.size(), PairKind::kUnclear));
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    for (std::size_t j = i + 1; j < set.shots.size(); ++j) {
      if (set.shots[j].seconds - set.shots[i].seconds < min_seconds) continue;
      const double forth = overlap(set, set.shots[i], points[i], set.shots[j]);
      const double back = overlap(set, set.shots[j], points[j], set.shots[i]);
      if (std::min(forth, back) > kRevisitOverlap) set.kind[i][j] = PairKind::kRevisit;
      if (std::max(forth, back) < kApartOverlap) set.kind[i][j] = PairKind::kApart;
    }
  }
}

// As they lie in the folder, where every image has one.
bool readDepths(ImageSet& set, const std::vector<std::int64_t>& stamps, const std::string& folder) {
  const std::string text = test::textOf(folder + "/sensor.yaml");
  const std::size_t at = text.find("intrinsics: [");
  if (at == std::string::npos) return false;
  std::istringstream intrinsics(text.substr(at + 13));
  for (int i = 0; i < 4; ++i) {
    char comma = 0;
    intrinsics >> set.depth_camera[i] >> comma;
  }
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    const std::string path = folder + "/data/" + std::to_string(stamps[i]) + ".png";
    if (!std::filesystem::exists(path)) return false;
    set.shots[i].depth = depthInMetres(path);
  }
  return true;
}

void drawDepths(ImageSet& set, const TriangleMesh& mesh) {
  const CameraModel& camera = set.rig.camera[0];
  const cv::Size size(camera.width() / kMeshDepthScale, camera.height() / kMeshDepthScale);
  const double focal = camera.focal() / kMeshDepthScale;
  set.depth_camera << focal, focal, 0.5 * (size.width - 1), 0.5 * (size.height - 1);
  for (Shot& shot : set.shots) {
    shot.depth = drawDepth(mesh, (shot.T_world_body * set.T_body_depth).inverse(), set.depth_camera, size);
  }
}

}  // namespace

std::optional<ImageSet> readFlight(const std::string& folder, double min_seconds, int every) {
  if (!std::filesystem::exists(folder + "/mav0/cam0/data.csv")) return std::nullopt;
  ImageSet set;
  set.name = std::filesystem::path(folder).filename().string();
  set.rig = readCalibration(folder).rig;
  set.exclude_seconds = min_seconds;
  set.T_body_depth = set.rig.T_body_cam[0];
  LogCounters counters;
  LogWarnings warnings;
  const Trajectory truth =
      readTrajectory(folder + "/mav0/state_groundtruth_estimate0/data.csv", counters, warnings);
  std::vector<std::int64_t> stamps;
  std::ifstream list(folder + "/mav0/cam0/data.csv");
  int row = 0;
  for (std::string line; std::getline(list, line);) {
    if (line.empty() || line[0] == '#' || row++ % every != 0) continue;
    const std::int64_t stamp = std::stoll(line);
    std::string file = line.substr(line.find(',') + 1);
    file.erase(file.find_last_not_of(" \r") + 1);
    const std::optional<SE3> pose = interpolate(truth, Stamp{stamp}, Duration::fromSeconds(kTruthGap));
    if (!pose) continue;
    Shot shot;
    shot.T_world_body = *pose;
    shot.seconds = static_cast<double>(stamp) * 1e-9;
    for (std::size_t c = 0; c < 2; ++c) {
      const std::string camera = folder + "/mav0/cam" + std::to_string(c) + "/data/";
      shot.grey[c] = cv::imread(camera + file, cv::IMREAD_GRAYSCALE);
    }
    if (shot.grey[0].empty() || shot.grey[1].empty()) continue;
    set.shots.push_back(shot);
    stamps.push_back(stamp);
  }
  const std::string mesh = folder + "/truth/mesh.ply";
  if (!readDepths(set, stamps, folder + "/mav0/depth0")) {
    for (Shot& shot : set.shots) shot.depth.release();
    if (std::filesystem::exists(mesh)) drawDepths(set, readPly(mesh));
  }
  setFlightKinds(set, min_seconds);
  return set;
}

}  // namespace swiftlet::loop_sets
