#include "mapping/depth/unrolled_depth.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace swiftlet {
namespace {

// Depth assumed for a pixel without one: the rotation moves it most.
constexpr double kFar = 100;  // m
constexpr int kRounds = 2;

}  // namespace

UnrolledDepth::UnrolledDepth(const Rig& rig, const StereoRectification& ideal)
    : camera_(ideal.intrinsics()),
      T_body_camera_(ideal.T_body_camera()),
      baseline_(ideal.baseline()),
      readout_(rig.readout.seconds()),
      result_(camera_) {
  for (std::size_t c = 0; c < kMaxCameras; ++c) band_[c] = bandsOf(rig, c, ideal.R_cam_rectified(c));
}

std::vector<std::uint8_t> UnrolledDepth::bandsOf(const Rig& rig, std::size_t c,
                                                 const Eigen::Matrix3d& R_cam_ideal) const {
  std::vector<std::uint8_t> bands(camera_.pixels(), kBands / 2);
  const auto width = static_cast<std::size_t>(camera_.width);
  for (std::size_t i = 0; i < bands.size(); ++i) {
    Eigen::Vector2d pixel;
    if (!rig.camera[c].project(R_cam_ideal * rayAt(i % width, i / width), pixel)) continue;
    const double row = std::clamp(rig.row(c, pixel.y()), -0.5, 0.5);
    bands[i] = static_cast<std::uint8_t>(std::lround((row + 0.5) * (kBands - 1)));
  }
  return bands;
}

Eigen::Vector3d UnrolledDepth::rayAt(std::size_t x, std::size_t y) const {
  return {(static_cast<double>(x) - camera_.cx) / camera_.fx,
          (static_cast<double>(y) - camera_.cy) / camera_.fy, 1};
}

// Depth of a pixel, with the right image's point moved to the time when the left image's row was read.
double UnrolledDepth::corrected(double z, std::size_t pixel, const CameraScan& scan) const {
  const auto width = static_cast<std::size_t>(camera_.width);
  const std::size_t x = pixel % width;
  const double disparity = camera_.fx * baseline_ / z;
  const double in_right = static_cast<double>(x) - disparity;
  if (in_right < 0) return z;
  const std::size_t right = pixel - x + static_cast<std::size_t>(in_right);
  const double later = bands_[band_[1][right]].seconds - bands_[band_[0][pixel]].seconds;
  const Eigen::Vector3d p = z * rayAt(x, pixel / width);
  const Eigen::Vector3d flow = scan.flow(p);
  const double speed = camera_.fx * (flow.x() - (p.x() - baseline_) / z * flow.z()) / z;  // px/s
  const double put_right = disparity + later * speed;
  return put_right > 0 ? camera_.fx * baseline_ / put_right : z;
}

void UnrolledDepth::apply(const ScanMotion& motion, DepthBuffer& depth) {
  const CameraScan scan(T_body_camera_, motion);
  for (std::size_t b = 0; b < kBands; ++b) {
    const double seconds = readout_ * (static_cast<double>(b) / (kBands - 1) - 0.5);
    bands_[b] = {seconds, scan.turnAt(seconds).toRotationMatrix(),
                 scan.fromRow(Eigen::Vector3d::Zero(), seconds)};
  }
  const auto width = static_cast<std::size_t>(camera_.width);
  for (std::size_t i = 0; i < band_[0].size(); ++i) {
    const Eigen::Vector3d ray = rayAt(i % width, i / width);
    std::size_t from = i;
    double z = depth.depth[i] > 0 ? static_cast<double>(depth.depth[i]) : kFar;
    for (int round = 0; round < kRounds && z > 0; ++round) {
      const Band& at = bands_[band_[0][from]];
      const Eigen::Vector3d p = at.R_middle_row.transpose() * (z * ray - at.moved);
      const double x = std::round(camera_.fx * p.x() / p.z() + camera_.cx);
      const double y = std::round(camera_.fy * p.y() / p.z() + camera_.cy);
      z = 0;
      if (!(p.z() > 0 && x >= 0 && y >= 0 && x < camera_.width && y < camera_.height)) break;
      from = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
      if (!(depth.depth[from] > 0)) break;
      const double measured = corrected(static_cast<double>(depth.depth[from]), from, scan);
      const Band& there = bands_[band_[0][from]];
      z = there.R_middle_row.row(2).dot(measured * rayAt(from % width, from / width)) + there.moved.z();
    }
    result_.depth[i] = z > 0 ? static_cast<float>(z) : 0.0F;
    result_.sigma[i] = depth.sigma[from];
    result_.intensity[i] = depth.intensity[from];
    result_.labels[i] = depth.labels[from];
  }
  std::swap(depth.depth, result_.depth);
  std::swap(depth.sigma, result_.sigma);
  std::swap(depth.intensity, result_.intensity);
  std::swap(depth.labels, result_.labels);
}

}  // namespace swiftlet
