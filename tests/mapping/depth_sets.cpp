#include "tests/mapping/depth_sets.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "drivers/calibration/calibration.hpp"
#include "mapping/depth/stereo_rectification.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::depth_sets {
namespace {

constexpr float kWrong = 2;  // px

ImageView viewOf(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

cv::Mat readImage(const std::filesystem::path& without_extension) {
  for (const char* extension : {".png", ".jpg"}) {
    const std::filesystem::path file = without_extension.string() + extension;
    if (std::filesystem::exists(file)) return cv::imread(file.string(), cv::IMREAD_UNCHANGED);
  }
  return {};
}

/// `intrinsics: [fx, fy, cx, cy]` of the depth camera.
PinholeIntrinsics depthCamera(const std::string& folder, const cv::Mat& image) {
  const std::string text = test::textOf(folder + "/sensor.yaml");
  const std::string key = "intrinsics: [";
  std::string values = text.substr(text.find(key) + key.size());
  std::replace(values.begin(), values.end(), ',', ' ');
  std::istringstream numbers(values);
  PinholeIntrinsics camera;
  numbers >> camera.fx >> camera.fy >> camera.cx >> camera.cy;
  camera.width = image.cols;
  camera.height = image.rows;
  return camera;
}

/// Disparities of the rectified pair from the depth that the same place's depth camera saw.
cv::Mat trueDisparity(const cv::Mat& depth_mm, const PinholeIntrinsics& depth_camera,
                      const StereoRectification& rectification) {
  const PinholeIntrinsics& k = rectification.intrinsics();
  cv::Mat truth(k.height, k.width, CV_32F, cv::Scalar(0));
  for (int y = 0; y < k.height; ++y) {
    for (int x = 0; x < k.width; ++x) {
      const Eigen::Vector3d ray =
          rectification.R_cam_rectified(0) * Eigen::Vector3d((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1);
      const auto u = std::lround(depth_camera.fx * ray.x() / ray.z() + depth_camera.cx);
      const auto v = std::lround(depth_camera.fy * ray.y() / ray.z() + depth_camera.cy);
      if (u < 0 || v < 0 || u >= depth_camera.width || v >= depth_camera.height) continue;
      const double z = 0.001 * depth_mm.at<std::uint16_t>(static_cast<int>(v), static_cast<int>(u)) / ray.z();
      if (z > 0) truth.at<float>(y, x) = static_cast<float>(k.fx * rectification.baseline() / z);
    }
  }
  return truth;
}

}  // namespace

std::vector<StereoSet> realSets() {
  std::vector<StereoSet> sets;
  const auto folder = findLog("stereo_gt");
  if (!folder) return sets;
  for (const char* name :
       {"tsukuba", "venus", "teddy", "cones", "motorcycle", "adirondack", "kitti2012_000070"}) {
    const std::string at = *folder + "/" + name;
    StereoSet set;
    set.name = name;
    set.left = cv::imread(at + "/left.png", cv::IMREAD_GRAYSCALE);
    set.right = cv::imread(at + "/right.png", cv::IMREAD_GRAYSCALE);
    const cv::Mat truth = cv::imread(at + "/disp_gt_x256.png", cv::IMREAD_UNCHANGED);
    if (set.left.empty() || set.right.empty() || truth.empty()) continue;
    truth.convertTo(set.truth, CV_32F, 1 / 256.0);
    sets.push_back(set);
  }
  return sets;
}

std::vector<StereoSet> renderedSets(const std::string& log, std::size_t count) {
  std::vector<StereoSet> sets;
  const auto folder = findLog(log);
  if (!folder) return sets;
  const std::filesystem::path mav = *folder + "/mav0";
  const StereoRectification rectification(readCalibration(*folder).rig);
  std::vector<std::string> stamps;
  for (const auto& entry : std::filesystem::directory_iterator(mav / "depth0" / "data"))
    stamps.push_back(entry.path().stem().string());
  std::sort(stamps.begin(), stamps.end());
  for (std::size_t i = 0; i < count && rectification.status().ok(); ++i) {
    const std::string& stamp = stamps[(2 * i + 1) * stamps.size() / (2 * count)];
    const cv::Mat left = readImage(mav / "cam0" / "data" / stamp);
    const cv::Mat right = readImage(mav / "cam1" / "data" / stamp);
    const cv::Mat depth = readImage(mav / "depth0" / "data" / stamp);
    if (left.empty() || right.empty() || depth.empty()) continue;
    StereoSet set;
    set.name = log + " " + stamp;
    set.left.create(rectification.intrinsics().height, rectification.intrinsics().width, CV_8U);
    set.right.create(set.left.size(), CV_8U);
    if (!rectification.warp(0).warp(viewOf(left), set.left.data).ok() ||
        !rectification.warp(1).warp(viewOf(right), set.right.data).ok())
      continue;
    set.truth = trueDisparity(depth, depthCamera((mav / "depth0").string(), depth), rectification);
    sets.push_back(set);
  }
  return sets;
}

DisparityScore score(const cv::Mat& disparity, const cv::Mat& sigma, const cv::Mat& truth, int first_column) {
  DisparityScore s;
  double right = 0;
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = first_column; x < truth.cols; ++x) {
      const float t = truth.at<float>(y, x);
      if (!(t > 0) || t > kLargestDisparity) continue;
      ++s.pixels;
      const float d = disparity.at<float>(y, x);
      const float error = d - t;
      if (d >= 0) ++s.given;
      if (d < 0 || std::abs(error) > kWrong) {
        ++s.wrong_or_missing;
        if (d >= 0) ++s.wrong;
        continue;
      }
      ++right;
      s.mean_error += std::abs(error);
      s.bias += error;
      for (int k = 0; k < 3 && !sigma.empty(); ++k) {
        if (std::abs(error) <= static_cast<float>(k + 1) * sigma.at<float>(y, x)) ++s.within_sigma[k];
      }
    }
  }
  s.wrong /= std::max(s.given, 1.0);
  s.given /= std::max(s.pixels, 1.0);
  s.wrong_or_missing /= std::max(s.pixels, 1.0);
  for (double* const sum :
       {&s.mean_error, &s.bias, &s.within_sigma[0], &s.within_sigma[1], &s.within_sigma[2]})
    *sum /= std::max(right, 1.0);
  return s;
}

cv::Mat disparityOf(const DisparityImage& image) {
  cv::Mat out(image.height(), image.width(), CV_32F);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const std::uint16_t d = image.disparity()[i];
    out.ptr<float>()[i] = d == kNoDisparity ? -1.0F : static_cast<float>(d) / kDisparitySteps;
  }
  return out;
}

cv::Mat sigmaOf(const DisparityImage& image) {
  cv::Mat out(image.height(), image.width(), CV_32F);
  for (std::size_t i = 0; i < image.pixels(); ++i)
    out.ptr<float>()[i] = static_cast<float>(image.sigma()[i]) / kDisparitySteps;
  return out;
}

cv::Mat drawDisparity(const cv::Mat& disparity, const StereoSet& set) {
  const auto coloured = [](const cv::Mat& d) {
    cv::Mat grey, colour;
    d.convertTo(grey, CV_8U, 255.0 / kLargestDisparity);
    cv::applyColorMap(grey, colour, cv::COLORMAP_TURBO);
    colour.setTo(cv::Scalar(0, 0, 0), d <= 0);
    return colour;
  };
  // Errors up to 4 px from black to white; red: none given; blue: no truth.
  cv::Mat error;
  cv::Mat(cv::abs(disparity - set.truth)).convertTo(error, CV_8U, 64);
  cv::cvtColor(error, error, cv::COLOR_GRAY2BGR);
  error.setTo(cv::Scalar(0, 0, 160), disparity < 0);
  error.setTo(cv::Scalar(80, 0, 0), set.truth <= 0);
  cv::Mat left, all;
  cv::cvtColor(set.left, left, cv::COLOR_GRAY2BGR);
  cv::Mat top, bottom;
  cv::hconcat(left, coloured(set.truth), top);
  cv::hconcat(error, coloured(disparity), bottom);
  cv::vconcat(top, bottom, all);
  return all;
}

}  // namespace swiftlet::depth_sets
