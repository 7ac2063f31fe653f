#include "tests/mapping/place_scene.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "mapping/place/hamming.hpp"

namespace swiftlet::testing {
namespace {

// The room's depth camera, and its colour camera 3 cm beside it as the data's page estimates it.
constexpr double kDepthFocal = 585, kDepthCx = 320, kDepthCy = 240;
constexpr double kColourFocal = 525, kColourCx = 323, kColourCy = 238, kColourOffset = 0.03;
constexpr std::size_t kRevisitFrames = 200, kFrameStep = 20;

std::string frameFile(const std::string& folder, std::size_t frame, const char* ending) {
  char name[64];
  std::snprintf(name, sizeof name, "/frame-%06zu.%s", frame, ending);
  return folder + name;
}

cv::Mat depthInColour(const cv::Mat& millimetres) {
  cv::Mat out = cv::Mat::zeros(millimetres.size(), CV_32F);
  for (int v = 0; v < millimetres.rows; ++v) {
    for (int u = 0; u < millimetres.cols; ++u) {
      const auto d = millimetres.at<std::uint16_t>(v, u);
      if (d == 0 || d == 65535) continue;
      const double z = d * 1e-3;
      const double x = (u - kDepthCx) * z / kDepthFocal - kColourOffset;
      const double y = (v - kDepthCy) * z / kDepthFocal;
      const int cu = cvRound(kColourFocal * x / z + kColourCx);
      const int cv = cvRound(kColourFocal * y / z + kColourCy);
      if (cu < 0 || cv < 0 || cu >= out.cols || cv >= out.rows) continue;
      float& old = out.at<float>(cv, cu);
      if (old == 0 || z < old) old = static_cast<float>(z);
    }
  }
  return out;
}

}  // namespace

std::string placeDataFolder() {
  const char* given = std::getenv("SWIFTLET_DATA");
  return (given != nullptr ? std::string(given) : std::string(SWIFTLET_SOURCE_ROOT "/../shared/data")) +
         "/loop_closure";
}

cv::Mat readGrey(const std::string& path) { return cv::imread(path, cv::IMREAD_GRAYSCALE); }

ImageView viewOf(const cv::Mat& grey) {
  return {grey.data, grey.cols, grey.rows, static_cast<int>(grey.step[0])};
}

CameraModel plainCamera(int width, int height) {
  return {CameraKind::kPinholeRadtan, width, height,
          Eigen::Vector4d(0.8 * width, 0.8 * width, 0.5 * width, 0.5 * height), Eigen::Vector4d::Zero()};
}

Kitchen readKitchen() {
  Kitchen kitchen;
  const std::string folder = placeDataFolder() + "/redkitchen_50";
  std::ifstream poses(folder + "/poses_c2w.txt");
  std::string line;
  while (std::getline(poses, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    std::size_t frame = 0;
    double t[3], q[4];
    in >> frame >> t[0] >> t[1] >> t[2] >> q[0] >> q[1] >> q[2] >> q[3];
    SE3 pose;
    pose.translation = {t[0], t[1], t[2]};
    pose.rotation = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized();
    kitchen.T_world_cam.push_back(pose);
    kitchen.grey.push_back(readGrey(frameFile(folder + "/color", frame, "jpg")));
    kitchen.depth.push_back(
        depthInColour(cv::imread(frameFile(folder + "/depth", frame, "png"), cv::IMREAD_UNCHANGED)));
  }
  std::ifstream pairs(folder + "/pairs.csv");
  std::getline(pairs, line);
  while (std::getline(pairs, line)) {
    PairTruth pair;
    double a = 0, b = 0;
    if (std::sscanf(line.c_str(), "%zu,%zu,%lf,%lf", &pair.i, &pair.j, &a, &b) != 4) continue;
    pair.i /= kFrameStep;
    pair.j /= kFrameStep;
    pair.overlap = std::min(a, b);
    pair.overlap_max = std::max(a, b);
    kitchen.pairs.push_back(pair);
  }
  return kitchen;
}

bool Kitchen::transfer(std::size_t i, const Eigen::Vector2d& pixel, std::size_t j,
                       Eigen::Vector2d& to) const {
  const int u = cvRound(pixel.x());
  const int v = cvRound(pixel.y());
  double z = 0;
  for (int dv = -1; dv <= 1; ++dv) {
    for (int du = -1; du <= 1; ++du) {
      if (u + du < 0 || v + dv < 0 || u + du >= depth[i].cols || v + dv >= depth[i].rows) continue;
      const double d = depth[i].at<float>(v + dv, u + du);
      if (d > 0 && (z == 0 || d < z)) z = d;
    }
  }
  if (z == 0) return false;
  const Eigen::Vector3d p_i((pixel.x() - kColourCx) * z / kColourFocal + kColourOffset,
                            (pixel.y() - kColourCy) * z / kColourFocal, z);
  const Eigen::Vector3d p_j = T_world_cam[j].inverse() * (T_world_cam[i] * p_i);
  if (p_j.z() < 0.1) return false;
  to = {kColourFocal * (p_j.x() - kColourOffset) / p_j.z() + kColourCx,
        kColourFocal * p_j.y() / p_j.z() + kColourCy};
  return to.x() >= 0 && to.y() >= 0 && to.x() < depth[j].cols && to.y() < depth[j].rows;
}

bool isRevisit(const PairTruth& pair) {
  constexpr double kCommonView = 0.4;
  return pair.j - pair.i >= kRevisitFrames / kFrameStep && pair.overlap > kCommonView;
}

bool isNegative(const PairTruth& pair) {
  constexpr double kNoCommonView = 0.02;
  return pair.overlap_max < kNoCommonView;
}

Corridor readCorridor() {
  Corridor corridor;
  const std::string folder = placeDataFolder() + "/corridor";
  const auto read = [](const std::string& from) {
    std::vector<cv::Mat> images;
    for (std::size_t i = 0;; ++i) {
      char name[32];
      std::snprintf(name, sizeof name, "/%07zu.jpg", i);
      if (!std::filesystem::exists(from + name)) return images;
      images.push_back(readGrey(from + name));
    }
  };
  corridor.query = read(folder + "/query");
  corridor.reference = read(folder + "/ref");
  corridor.truth.resize(corridor.query.size());
  std::ifstream truth(folder + "/ground_truth.txt");
  std::string line;
  while (std::getline(truth, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    std::size_t query = 0, reference = 0;
    char colon = 0;
    in >> query >> colon;
    while (in >> reference) corridor.truth.at(query).push_back(reference);
  }
  return corridor;
}

std::vector<MutualMatch> mutualMatches(const std::vector<Descriptor>& a, const std::vector<Descriptor>& b) {
  std::vector<int> best_a(a.size(), 257), best_b(b.size(), 257);
  std::vector<std::size_t> to_b(a.size(), 0), to_a(b.size(), 0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      const int d = hammingDistance(a[i], b[j]);
      if (d < best_a[i]) {
        best_a[i] = d;
        to_b[i] = j;
      }
      if (d < best_b[j]) {
        best_b[j] = d;
        to_a[j] = i;
      }
    }
  }
  std::vector<MutualMatch> matches;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (best_a[i] <= 256 && to_a[to_b[i]] == i) matches.push_back({i, to_b[i], best_a[i]});
  }
  return matches;
}

Described describeOurs(PlaceExtractor& extractor, const CameraModel& camera, const cv::Mat& grey,
                       PlaceKeyframe& keyframe) {
  Described out;
  const TrackedFrame none;
  (void)extractor.extract(viewOf(grey), camera, none, keyframe);
  for (const PlaceFeature& f : keyframe.features) {
    out.pixel.push_back(f.pixel.cast<double>());
    out.octave.push_back(f.octave);
    out.descriptor.push_back(f.descriptor);
  }
  return out;
}

Described describeOpenCv(const cv::Mat& grey, int features) {
  Described out;
  const auto orb = cv::ORB::create(features);
  std::vector<cv::KeyPoint> points;
  cv::Mat bits;
  orb->detectAndCompute(grey, cv::noArray(), points, bits);
  for (std::size_t i = 0; i < points.size(); ++i) {
    out.pixel.push_back({points[i].pt.x, points[i].pt.y});
    out.octave.push_back(points[i].octave);
    Descriptor d;
    std::memcpy(d.words.data(), bits.ptr(static_cast<int>(i)), 32);
    out.descriptor.push_back(d);
  }
  return out;
}

Described describeAtOpenCvs(const cv::Mat& grey, int features) {
  Described out = describeOpenCv(grey, features);
  PlacePyramid pyramid(grey.cols, grey.rows, kMaxOctaves);
  (void)pyramid.build(viewOf(grey));
  const SteeredBrief brief;
  for (std::size_t i = 0; i < out.pixel.size(); ++i) {
    const Eigen::Vector2f at = pyramid.toLevel(out.octave[i], out.pixel[i].cast<float>());
    const ImageView level = pyramid.level(out.octave[i]);
    SteeredBrief::Patch patch;
    SteeredBrief::smooth(level.row(cvRound(at.y())) + cvRound(at.x()), level.stride, patch);
    out.descriptor[i] = brief.describe(patch, SteeredBrief::direction(patch));
  }
  return out;
}

}  // namespace swiftlet::testing
