#include "mapping/depth/depth_stage.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace swiftlet {
namespace {

/// Whether all images of the output have the stage's size.
bool fits(const DepthBuffer& out, std::size_t pixels) {
  return out.depth.size() == pixels && out.sigma.size() == pixels && out.intensity.size() == pixels &&
         out.labels.size() == pixels;
}

/// Depth times disparity, the same for all points [m px].
double depthDisparity(const StereoRectification& pair) { return pair.intrinsics().fx * pair.baseline(); }

MatcherSettings matcherFor(const DepthSettings& settings, const StereoRectification& pair) {
  constexpr double kMost = 32 * kMaxDisparityVectors;
  MatcherSettings matcher = settings.matcher;
  const double wanted = std::min(depthDisparity(pair) / settings.wanted_nearest + 1, kMost);
  matcher.disparities = std::max(matcher.disparities, static_cast<int>(std::ceil(wanted)));
  return matcher;
}

}  // namespace

DepthStage::DepthStage(const Rig& rig, const DepthSettings& settings)
    : settings_(settings),
      rectification_(rig),
      matcher_(rectification_.intrinsics().width, rectification_.intrinsics().height,
               matcherFor(settings, rectification_)),
      left_(rectification_.intrinsics().pixels()),
      right_(left_.size()),
      disparity_(rectification_.intrinsics().width, rectification_.intrinsics().height) {
  for (std::size_t i = 0; i < left_.size(); ++i) {
    if (!rectification_.warp(0).covered(i)) uncovered_.push_back(static_cast<std::uint32_t>(i));
  }
}

double DepthStage::nearestDepth() const {
  return depthDisparity(rectification_) / (matcher_.settings().disparities - 1);
}

DepthBuffer DepthStage::makeBuffer() const { return DepthBuffer(rectification_.intrinsics()); }

Status DepthStage::step(const ImageView& left, const ImageView& right, Stamp stamp, const DepthEffort& effort,
                        DepthBuffer& out) {
  Status status = rectification_.status();
  if (status.ok() && !fits(out, left_.size()))
    status = {StatusCode::kInvalidInput,
              "depth: the output does not have the stage's size; use makeBuffer()"};
  if (status.ok()) status = rectification_.warp(0).warp(left, left_.data());
  if (status.ok()) status = rectification_.warp(1).warp(right, right_.data());
  const PinholeIntrinsics& camera = rectification_.intrinsics();
  const auto view = [&](const std::vector<std::uint8_t>& image) {
    return ImageView{image.data(), camera.width, camera.height, camera.width};
  };
  if (status.ok())
    status = matcher_.match(view(left_), view(right_), std::max(effort.disparities, 1), disparity_);
  if (!status.ok()) {
    ++counters_.refused;
    return status;
  }
  for (const std::uint32_t i : uncovered_) disparity_.disparity()[i] = kNoDisparity;
  out.stamp = stamp;
  out.camera = camera;
  out.T_body_camera = rectification_.T_body_camera();
  std::copy(left_.begin(), left_.end(), out.intensity.begin());
  out.has_intensity = true;
  out.has_labels = false;
  fillDepth(out);
  return okStatus();
}

void DepthStage::fillDepth(DepthBuffer& out) {
  const double depth_disparity = depthDisparity(rectification_);
  const auto scale = static_cast<float>(depth_disparity * kDisparitySteps);
  const auto sigma_scale = static_cast<float>(1 / (depth_disparity * kDisparitySteps));
  const auto nearest = static_cast<float>(settings_.min_depth);
  const std::uint16_t* const disparity = disparity_.disparity();
  const std::uint8_t* const sigma = disparity_.sigma();
  float* __restrict const depth_out = out.depth.data();
  float* __restrict const sigma_out = out.sigma.data();
  std::uint32_t known = 0;
  std::uint32_t measured = 0;
  for (std::size_t i = 0; i < disparity_.pixels(); ++i) {
    const bool is_known = disparity[i] != kNoDisparity;
    const float z = scale / static_cast<float>(std::max<int>(disparity[i], 1));
    const bool good = is_known && z >= nearest;
    depth_out[i] = good ? z : 0.0F;
    sigma_out[i] = good ? z * z * sigma_scale * static_cast<float>(sigma[i]) : 0.0F;
    known += is_known ? 1U : 0U;
    measured += good ? 1U : 0U;
  }
  ++counters_.images;
  counters_.pixels += disparity_.pixels();
  counters_.measured += measured;
  counters_.out_of_range += known - measured;
}

Status DepthStage::addLabels(const ImageView& labels, DepthBuffer& out) {
  Status status = rectification_.status();
  if (status.ok() && !fits(out, left_.size()))
    status = {StatusCode::kInvalidInput,
              "depth: the output does not have the stage's size; use makeBuffer()"};
  if (status.ok()) status = rectification_.warp(0).warpLabels(labels, out.labels.data());
  if (!status.ok()) {
    ++counters_.labels_refused;
    return status;
  }
  ++counters_.label_images;
  out.has_labels = true;
  return okStatus();
}

}  // namespace swiftlet
