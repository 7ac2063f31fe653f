#include "tests/mapping/loop_sets.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "drivers/calibration/calibration.hpp"
#include "tests/mapping/loop_sets_depth.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::loop_sets {
namespace {

constexpr double kRevisitOverlap = 0.4;

SE3 poseFrom(std::istream& in) {
  Eigen::Vector3d t;
  Eigen::Quaterniond q;
  in >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w();
  return {q, t};
}

void setKinds(ImageSet& set, PairKind kind) {
  set.kind.assign(set.shots.size(), std::vector<PairKind>(set.shots.size(), kind));
}

}  // namespace

std::string dataFolder() {
  const char* set = std::getenv("SWIFTLET_DATA");
  return set != nullptr ? set : SWIFTLET_SOURCE_ROOT "/../shared/data";
}

std::optional<ImageSet> readKimera(const std::string& data) {
  const std::string folder = data + "/loop_closure/kimera_lcd/";
  if (!std::filesystem::exists(folder + "poses.txt")) return std::nullopt;
  ImageSet set;
  set.name = "kimera_lcd";
  const std::string left = test::textOf(folder + "sensorLeft.yaml");
  const std::string right = test::textOf(folder + "sensorRight.yaml");
  // The IMU does not matter here: EuRoC's own densities.
  const std::string imu =
      "sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]\nrate_hz: "
      "200\n"
      "gyroscope_noise_density: 1.6968e-04\ngyroscope_random_walk: 1.9393e-05\n"
      "accelerometer_noise_density: 2.0e-3\naccelerometer_random_walk: 3.0e-3\n";
  set.rig = parseEurocCalibration({{"sensorLeft.yaml", left}, {"sensorRight.yaml", right}}, {"imu", imu}).rig;
  set.shots.resize(4);
  std::ifstream poses(folder + "poses.txt");
  for (std::string line; std::getline(poses, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    std::size_t image = 0;
    long long stamp = 0;
    int source = 0;
    in >> image >> stamp >> source;
    if (source != 1) continue;
    set.shots.at(image).T_world_body = poseFrom(in);
    set.shots.at(image).seconds = static_cast<double>(stamp) * 1e-9;
  }
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    set.shots[i].grey[0] = cv::imread(folder + "left_" + std::to_string(i) + ".png", cv::IMREAD_GRAYSCALE);
    set.shots[i].grey[1] = cv::imread(folder + "right_" + std::to_string(i) + ".png", cv::IMREAD_GRAYSCALE);
  }
  setKinds(set, PairKind::kApart);
  set.kind[0][1] = PairKind::kRevisit;
  set.kind[2][3] = PairKind::kRevisit;
  return set;
}

std::optional<ImageSet> readKitchen(const std::string& data) {
  const std::string folder = data + "/loop_closure/redkitchen_50/";
  if (!std::filesystem::exists(folder + "poses_c2w.txt")) return std::nullopt;
  ImageSet set;
  set.name = "redkitchen_50";
  set.exclude_seconds = 9.5 * 20 / 30.0;  // 200 frames at 30 Hz are a revisit
  // Colour beside depth as the data's page estimates it; the body is the depth camera.
  set.rig.camera_count = 1;
  set.rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, 640, 480, Eigen::Vector4d(525, 525, 323, 238),
                                  Eigen::Vector4d::Zero());
  set.rig.T_body_cam[0] = SE3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.03, 0, 0));
  set.depth_camera << 585, 585, 320, 240;
  std::ifstream poses(folder + "poses_c2w.txt");
  for (std::string line; std::getline(poses, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    int frame = 0;
    in >> frame;
    Shot shot;
    shot.T_world_body = poseFrom(in);
    shot.seconds = frame / 30.0;
    std::array<char, 32> name{};
    (void)std::snprintf(name.data(), name.size(), "frame-%06d", frame);
    shot.grey[0] = cv::imread(folder + "color/" + name.data() + ".jpg", cv::IMREAD_GRAYSCALE);
    shot.depth = depthInMetres(folder + "depth/" + name.data() + ".png");
    set.shots.push_back(shot);
  }
  setKinds(set, PairKind::kUnclear);
  std::ifstream pairs(folder + "pairs.csv");
  std::string line;
  std::getline(pairs, line);
  while (std::getline(pairs, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream in(line);
    std::size_t i = 0;
    std::size_t j = 0;
    double ij = 0;
    double ji = 0;
    in >> i >> j >> ij >> ji;
    PairKind& kind = set.kind.at(i / 20).at(j / 20);
    if (std::min(ij, ji) > kRevisitOverlap) kind = PairKind::kRevisit;
    if (std::max(ij, ji) < 0.02) kind = PairKind::kApart;
  }
  return set;
}

std::optional<ImageSet> readDbowDemo(const std::string& data) {
  const std::string folder = data + "/loop_closure/dbow2_demo";
  if (!std::filesystem::exists(folder)) return std::nullopt;
  ImageSet set;
  set.name = "dbow2_demo";
  set.has_truth = false;
  set.rig.camera_count = 1;
  // No calibration is known: a focal length of a usual lens.
  set.rig.camera[0] = CameraModel(CameraKind::kPinholeRadtan, 640, 480, Eigen::Vector4d(600, 600, 320, 240),
                                  Eigen::Vector4d::Zero());
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  for (const std::string& file : files) {
    Shot shot;
    shot.grey[0] = cv::imread(file, cv::IMREAD_GRAYSCALE);
    if (!shot.grey[0].empty()) set.shots.push_back(shot);
  }
  setKinds(set, PairKind::kApart);
  if (set.shots.size() == 4) {
    set.kind[1][3] = PairKind::kRevisit;
    set.kind[1][2] = set.kind[2][3] = PairKind::kUnclear;
  }
  return set;
}

void extractOrb(const ImageSet& set, std::size_t shot, int features, PlaceKeyframe& keyframe) {
  static const cv::Ptr<cv::ORB> kOrb = cv::ORB::create(500);
  kOrb->setMaxFeatures(features);
  std::vector<cv::KeyPoint> points;
  cv::Mat descriptors;
  kOrb->detectAndCompute(set.shots[shot].grey[0], cv::noArray(), points, descriptors);
  keyframe.features.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    PlaceFeature f;
    const uchar* row = descriptors.ptr<uchar>(static_cast<int>(i));
    for (std::size_t byte = 0; byte < 32; ++byte) {
      f.descriptor.words[byte / 8] |= std::uint64_t{row[byte]} << (8 * (byte % 8));
    }
    f.pixel = Eigen::Vector2f(points[i].pt.x, points[i].pt.y);
    Eigen::Vector3d bearing;
    if (!set.rig.camera[0].unproject(f.pixel.cast<double>(), bearing)) continue;
    f.bearing = bearing.cast<float>();
    f.octave = static_cast<std::int8_t>(points[i].octave);
    (void)keyframe.features.tryPushBack(f);
  }
}

void fillFromDepthImage(const ImageSet& set, std::size_t shot, PlaceKeyframe& keyframe) {
  // Depth and colour are registered to some 2 px: a depth must hold around the pixel, and is then
  // known to 1 % and 1 cm.
  constexpr int kAround = 4;
  constexpr float kMaxSpread = 0.05F;
  const cv::Mat& depth = set.shots[shot].depth;
  const SE3 T_cam_depth = set.rig.T_body_cam[0].inverse() * set.T_body_depth;
  const Eigen::Vector4d& k = set.depth_camera;
  const cv::Size size = set.shots[shot].grey[0].size();
  cv::Mat seen(size, CV_32F, cv::Scalar(0));
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const double z = depth.at<float>(y, x);
      if (!(z > 0)) continue;
      const Eigen::Vector3d p =
          T_cam_depth * Eigen::Vector3d((x - k[2]) / k[0] * z, (y - k[3]) / k[1] * z, z);
      Eigen::Vector2d pixel;
      if (!set.rig.camera[0].project(p, pixel) || !set.rig.camera[0].inImage(pixel, 1)) continue;
      float& at =
          seen.at<float>(static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x())));
      const auto distance = static_cast<float>(p.norm());
      if (at == 0 || distance < at) at = distance;
    }
  }
  for (PlaceFeature& f : keyframe.features) {
    const int cx = static_cast<int>(std::lround(f.pixel.x()));
    const int cy = static_cast<int>(std::lround(f.pixel.y()));
    std::vector<float> near;
    for (int y = std::max(0, cy - kAround); y <= std::min(size.height - 1, cy + kAround); ++y) {
      for (int x = std::max(0, cx - kAround); x <= std::min(size.width - 1, cx + kAround); ++x) {
        if (seen.at<float>(y, x) > 0) near.push_back(seen.at<float>(y, x));
      }
    }
    if (near.size() < 20) continue;
    std::sort(near.begin(), near.end());
    const float middle = near[near.size() / 2];
    if (near[near.size() * 9 / 10] - near[near.size() / 10] > kMaxSpread * middle) continue;
    f.inverse_depth = 1.0F / middle;
    f.inverse_depth_sigma = (0.01F + 0.01F * middle) / (middle * middle);
  }
}

double trueInverseDistance(const ImageSet& set, std::size_t shot, const Eigen::Vector2d& pixel) {
  const cv::Mat& depth = set.shots[shot].depth;
  Eigen::Vector3d bearing;
  if (depth.empty() || !set.rig.camera[0].unproject(pixel, bearing)) return 0;
  const Eigen::Vector4d& k = set.depth_camera;
  const double u = k[0] * bearing.x() / bearing.z() + k[2];
  const double v = k[1] * bearing.y() / bearing.z() + k[3];
  const int x = static_cast<int>(std::lround(u));
  const int y = static_cast<int>(std::lround(v));
  if (x < 2 || y < 2 || x >= depth.cols - 2 || y >= depth.rows - 2) return 0;
  double low = 1e9;
  double high = 0;
  for (int dy = -2; dy <= 2; ++dy) {
    for (int dx = -2; dx <= 2; ++dx) {
      low = std::min<double>(low, depth.at<float>(y + dy, x + dx));
      high = std::max<double>(high, depth.at<float>(y + dy, x + dx));
    }
  }
  // At an edge the true one is a matter of a pixel.
  if (!(low > 0) || high > 1.03 * low) return 0;
  return bearing.z() / depth.at<float>(y, x);
}

}  // namespace swiftlet::loop_sets
