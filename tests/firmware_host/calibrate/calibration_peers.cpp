// Cameras of a log of checkerboard images calibrated by swiftlet and by OpenCV from the same corners, and
// these corners as mrcal's corners.vnl. Run by hand; docs/experiments/calibration.md has the figures.
//   calibration_peers LOG BOARD.yaml CORNERS.vnl
//   calibration_peers diff WIDTH HEIGHT fx fy cx cy k1 k2 p1 p2 (the same of the other lens)
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <opencv2/calib3d.hpp>
#include <string>
#include <vector>

#include "drivers/target/target_file.hpp"
#include "firmware_host/lab/calibrate/board/log_views.hpp"
#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_files.hpp"
#include "firmware_host/lab/calibrate/cameras/projection_error.hpp"

using namespace swiftlet;

namespace {

struct CvViews {
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> pixels;
};

struct CvCamera {
  cv::Mat K, D;
  double rms = 0;  // px per axis
};

constexpr int kFourTerms = cv::CALIB_FIX_K3;  // k1 k2 p1 p2

CvViews viewsOf(const LogViews& log, const CalibrationTarget& target, std::size_t camera, int half) {
  CvViews out;
  int index = 0;
  for (const BoardView& view : log.views) {
    if (view.camera != camera || view.corners.empty()) continue;
    if (half >= 0 && index++ % 2 != half) continue;
    out.points.emplace_back();
    out.pixels.emplace_back();
    for (const BoardCorner& corner : view.corners) {
      const Eigen::Vector3d p = target.corner(corner.id);
      out.points.back().emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.F);
      out.pixels.back().emplace_back(static_cast<float>(corner.pixel.x()),
                                     static_cast<float>(corner.pixel.y()));
    }
  }
  return out;
}

/// Corners that both cameras saw at one moment.
std::array<CvViews, kMaxCameras> commonViews(const LogViews& log, const CalibrationTarget& target) {
  std::array<CvViews, kMaxCameras> out;
  for (const BoardView& first : log.views) {
    for (const BoardView& second : log.views) {
      if (first.camera != 0 || second.camera != 1 || first.stamp != second.stamp) continue;
      std::array<LogViews, kMaxCameras> one;
      for (const BoardCorner& corner : first.corners) {
        for (const BoardCorner& other : second.corners) {
          if (corner.id != other.id) continue;
          if (one[0].views.empty()) {
            one[0].views.push_back({first.stamp, 0, {}});
            one[1].views.push_back({second.stamp, 1, {}});
          }
          one[0].views[0].corners.push_back(corner);
          one[1].views[0].corners.push_back(other);
        }
      }
      for (std::size_t c = 0; c < 2; ++c) {
        const CvViews view = viewsOf(one[c], target, c, -1);
        out[c].points.insert(out[c].points.end(), view.points.begin(), view.points.end());
        out[c].pixels.insert(out[c].pixels.end(), view.pixels.begin(), view.pixels.end());
      }
    }
  }
  return out;
}

CvCamera calibrate(const CvViews& views, const Eigen::Vector2i& size) {
  CvCamera camera;
  std::vector<cv::Mat> rotations, translations;
  // OpenCV's rms is of the points' distances.
  camera.rms = cv::calibrateCamera(views.points, views.pixels, cv::Size(size.x(), size.y()), camera.K,
                                   camera.D, rotations, translations, kFourTerms) /
               std::sqrt(2.0);
  return camera;
}

CameraModel lensOf(const CvCamera& camera, const Eigen::Vector2i& size) {
  const auto& K = camera.K;
  const auto& D = camera.D;
  return {CameraKind::kPinholeRadtan, size.x(), size.y(),
          Eigen::Vector4d(K.at<double>(0, 0), K.at<double>(1, 1), K.at<double>(0, 2), K.at<double>(1, 2)),
          Eigen::Vector4d(D.at<double>(0), D.at<double>(1), D.at<double>(2), D.at<double>(3))};
}

std::string words(const CameraModel& lens) {
  const Eigen::Vector4d& f = lens.intrinsics();
  const Eigen::Vector4d& k = lens.distortion();
  return fmt::format("{:.3f} {:.3f} {:.3f} {:.3f} {:.6f} {:.6f} {:.6f} {:.6f}", f[0], f[1], f[2], f[3], k[0],
                     k[1], k[2], k[3]);
}

void writeCorners(const LogViews& log, const CalibrationTarget& target, const std::string& path) {
  std::ofstream file(path);
  file << "# filename x y level\n";
  for (const BoardView& view : log.views) {
    const std::string name =
        fmt::format("{}{:02d}.jpg", view.camera == 0 ? "left" : "right", view.stamp.ns / 1'000'000'000);
    if (view.corners.empty()) {
      file << name << " - - -\n";
      continue;
    }
    std::size_t next = 0;
    for (int id = 0; id < target.cornerCount(); ++id) {
      const bool seen = next < view.corners.size() && view.corners[next].id == id;
      if (seen) {
        file << fmt::format("{} {:.5f} {:.5f} 0\n", name, view.corners[next].pixel.x(),
                            view.corners[next].pixel.y());
        ++next;
      } else {
        file << name << " - - -\n";
      }
    }
  }
}

int difference(char** arguments) {
  std::array<CameraModel, 2> lens;
  for (std::size_t i = 0; i < 2; ++i) {
    std::array<double, 8> v{};
    for (std::size_t k = 0; k < 8; ++k) v[k] = std::atof(arguments[4 + 8 * i + k]);
    lens[i] = {CameraKind::kPinholeRadtan, std::atoi(arguments[2]), std::atoi(arguments[3]),
               Eigen::Vector4d(v[0], v[1], v[2], v[3]), Eigen::Vector4d(v[4], v[5], v[6], v[7])};
  }
  const std::vector<ImagePoint> points = projectionDifference(lens[0], lens[1]);
  fmt::print("rms {:.3f} px, median {:.3f} px, 95 % {:.3f} px\n", rms(points), quantile(points, 0.5),
             quantile(points, 0.95));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 20 && std::string(argv[1]) == "diff") return difference(argv);
  if (argc != 4) return 2;
  LogViewsRequest request;
  request.log = argv[1];
  request.target = readTarget(argv[2]);
  const LogViews log = readLogViews(request);
  writeCorners(log, request.target, argv[3]);
  CameraInput input;
  input.target = request.target;
  input.views = log.views;
  input.camera_count = log.camera_count;
  input.image_size = log.image_size;
  const CameraSolution solution = calibrateCameras(input);
  fmt::print("swiftlet\n{}", describe(solution));
  for (const std::string& reason : solution.reasons) fmt::print("repeat: {}\n", reason);
  std::array<CvCamera, kMaxCameras> cameras;
  std::array<CvViews, kMaxCameras> views;
  for (std::size_t c = 0; c < log.camera_count; ++c) {
    fmt::print("camera {} swiftlet {}\n", c, words(solution.camera[c].model));
    views[c] = viewsOf(log, request.target, c, -1);
    cameras[c] = calibrate(views[c], log.image_size[c]);
    const CameraModel lens = lensOf(cameras[c], log.image_size[c]);
    const CameraModel first =
        lensOf(calibrate(viewsOf(log, request.target, c, 0), log.image_size[c]), log.image_size[c]);
    const CameraModel second =
        lensOf(calibrate(viewsOf(log, request.target, c, 1), log.image_size[c]), log.image_size[c]);
    fmt::print(
        "camera {} OpenCV alone {} ({} views), rms {:.4f} px per axis, halves differ by {:.3f} px rms, 95 % "
        "{:.3f}; beside swiftlet {:.3f} px rms\n",
        c, words(lens), views[c].points.size(), cameras[c].rms, rms(projectionDifference(first, second)),
        quantile(projectionDifference(first, second), 0.95),
        rms(projectionDifference(solution.camera[c].model, lens)));
  }
  if (log.camera_count < 2) return 0;
  const std::array<CvViews, kMaxCameras> common = commonViews(log, request.target);
  cv::Mat R, t, E, F;
  const double found =
      cv::stereoCalibrate(common[0].points, common[0].pixels, common[1].pixels, cameras[0].K, cameras[0].D,
                          cameras[1].K, cameras[1].D, cv::Size(log.image_size[0].x(), log.image_size[0].y()),
                          R, t, E, F, cv::CALIB_USE_INTRINSIC_GUESS | kFourTerms);
  fmt::print("OpenCV stereo: {} pairs, rms {:.4f} px per axis, baseline {:.3f} mm\n", common[0].points.size(),
             found / std::sqrt(2.0), cv::norm(t) * 1e3);
  for (std::size_t c = 0; c < 2; ++c) {
    const CameraModel lens = lensOf(cameras[c], log.image_size[c]);
    fmt::print("camera {} OpenCV stereo {}; beside swiftlet {:.3f} px rms\n", c, words(lens),
               rms(projectionDifference(solution.camera[c].model, lens)));
  }
  return 0;
}
