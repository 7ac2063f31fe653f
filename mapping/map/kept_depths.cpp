#include "mapping/map/kept_depths.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace swiftlet {
namespace {

constexpr int kStride = 3;
constexpr std::size_t kBytesPerPixel = 5;
constexpr float kDepthSteps = 65535;
/// What lies beyond the range still says what is free: it is kept as a depth of this many ranges.
constexpr double kBeyond = 1.1;
/// Sigma is kept as a power of 2 in sixteenths, from half a millimetre on (to 31 m).
constexpr float kLeastSigma = 5e-4F;  // m
constexpr float kSigmaSteps = 16;
/// What an image brought, bit by bit.
constexpr unsigned kGrey = 1, kLabels = 2, kSigma = 4;
/// By how far a turn moves what is seen [m/rad]: the depth of a room.
constexpr double kViewArm = 2;

int keptOf(int size) { return (size + kStride - 1) / kStride; }

std::uint8_t packSigma(float sigma) {
  if (!(sigma > kLeastSigma)) return 0;
  return static_cast<std::uint8_t>(
      std::min(std::round(kSigmaSteps * std::log2(sigma / kLeastSigma)), 255.0F));
}

double viewDistance(const KeptFrame& a, const KeptFrame& b) {
  return (a.T_map_fused.translation - b.T_map_fused.translation).norm() +
         kViewArm * a.T_map_fused.rotation.angularDistance(b.T_map_fused.rotation);
}

}  // namespace

KeptDepths::KeptDepths(std::size_t bytes, std::size_t pixels, double most_range)
    // Widths and heights that are no multiples keep a little more than their share.
    : most_range_(most_range), pixels_(pixels / (kStride * kStride) + pixels / 64 + 1) {
  const std::size_t frames = bytes / (kBytesPerPixel * pixels_ + sizeof(KeptFrame));
  if (frames < 2) return;
  frames_.reserve(frames);
  neighbour_.reserve(frames);
  to_newest_.resize(frames);
  depth_.resize(frames * pixels_);
  sigma_.resize(frames * pixels_);
  grey_.resize(frames * pixels_);
  labels_.resize(frames * pixels_);
  contents_.resize(frames);
  scratch_.depth.resize(pixels_);
  scratch_.sigma.resize(pixels_);
}

std::size_t KeptDepths::bytes() const {
  return sizeof(*this) + frames_.capacity() * (sizeof(KeptFrame) + sizeof(Neighbour) + sizeof(double)) +
         depth_.size() * kBytesPerPixel + contents_.size() + pixels_ * 2 * sizeof(float);
}

/// The place for a new frame, and what it changes in who is most like whom.
std::size_t KeptDepths::place(const KeptFrame& newest) {
  std::size_t at = frames_.size();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    to_newest_[i] = viewDistance(frames_[i], newest);
    if (frames_.size() < frames_.capacity()) continue;
    const double alike = std::min(neighbour_[i].distance, to_newest_[i]);
    if (alike < least || (alike == least && frames_[i].frame < frames_[at].frame)) {
      least = alike;
      at = i;
    }
  }
  if (at == frames_.size()) {
    frames_.emplace_back();
    neighbour_.emplace_back();
  } else {
    ++given_up_;
  }
  frames_[at] = newest;
  neighbour_[at] = {};
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    if (i == at) continue;
    if (to_newest_[i] < neighbour_[at].distance) neighbour_[at] = {to_newest_[i], i};
    if (neighbour_[i].at == at) {
      neighbour_[i] = {};
      for (std::size_t k = 0; k < frames_.size(); ++k) {
        const double distance = k == i ? neighbour_[i].distance : viewDistance(frames_[i], frames_[k]);
        if (distance < neighbour_[i].distance) neighbour_[i] = {distance, k};
      }
    } else if (to_newest_[i] < neighbour_[i].distance) {
      neighbour_[i] = {to_newest_[i], at};
    }
  }
  return at;
}

std::size_t KeptDepths::keep(const DepthImageView& image, const KeptFrame& about) {
  const int width = keptOf(image.camera.width), height = keptOf(image.camera.height);
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (frames_.capacity() == 0 || pixels > pixels_) return kNone;
  const std::size_t at = place(about);
  KeptFrame& frame = frames_[at];
  frame.T_body_camera = image.T_body_camera;
  frame.camera = image.camera;
  // Of a kept pixel's centre, which is the centre of the pixel that it was.
  frame.camera.fx /= kStride;
  frame.camera.fy /= kStride;
  frame.camera.cx /= kStride;
  frame.camera.cy /= kStride;
  frame.camera.width = width;
  frame.camera.height = height;
  contents_[at] = static_cast<std::uint8_t>((image.intensity != nullptr ? kGrey : 0U) |
                                            (image.labels != nullptr ? kLabels : 0U) |
                                            (image.sigma != nullptr ? kSigma : 0U));
  const auto steps = static_cast<float>(kDepthSteps / (kBeyond * most_range_));
  double sum = 0;
  std::size_t measured = 0, to = at * pixels_;
  for (int v = 0; v < image.camera.height; v += kStride) {
    const std::size_t row = static_cast<std::size_t>(v) * static_cast<std::size_t>(image.camera.width);
    for (int u = 0; u < image.camera.width; u += kStride, ++to) {
      const std::size_t from = row + static_cast<std::size_t>(u);
      const float depth = image.depth[from];
      const bool valid = depth > 0 && std::isfinite(depth);
      depth_[to] =
          valid ? static_cast<std::uint16_t>(std::clamp(std::round(depth * steps), 1.0F, kDepthSteps)) : 0;
      sigma_[to] = valid && image.sigma != nullptr ? packSigma(image.sigma[from]) : 0;
      grey_[to] = image.intensity != nullptr ? image.intensity[from] : 0;
      labels_[to] = image.labels != nullptr ? image.labels[from] : 0;
      if (!valid) continue;
      sum += static_cast<double>(depth);
      ++measured;
    }
  }
  frame.mean_depth = measured > 0 ? static_cast<float>(sum / static_cast<double>(measured)) : 0;
  return at;
}

void KeptDepths::deepestOf(std::size_t i, DepthTiles& out) const {
  const KeptFrame& frame = frames_[i];
  const auto metres = static_cast<float>(kBeyond * most_range_ / kDepthSteps);
  out.columns = (frame.camera.width + DepthTiles::kSide - 1) / DepthTiles::kSide;
  out.rows = (frame.camera.height + DepthTiles::kSide - 1) / DepthTiles::kSide;
  out.deepest.assign(static_cast<std::size_t>(out.columns * out.rows), 0.0F);
  std::size_t from = i * pixels_;
  for (int v = 0; v < frame.camera.height; ++v) {
    float* const row = out.deepest.data() + (v / DepthTiles::kSide) * out.columns;
    for (int u = 0; u < frame.camera.width; ++u, ++from) {
      float& deepest = row[u / DepthTiles::kSide];
      deepest = std::max(deepest, metres * static_cast<float>(depth_[from]));
    }
  }
}

DepthImageView KeptDepths::read(std::size_t i) {
  const KeptFrame& frame = frames_[i];
  const std::size_t first = i * pixels_;
  const auto metres = static_cast<float>(kBeyond * most_range_ / kDepthSteps);
  for (std::size_t k = 0; k < frame.camera.pixels(); ++k) {
    scratch_.depth[k] = metres * static_cast<float>(depth_[first + k]);
    scratch_.sigma[k] = kLeastSigma * std::exp2(static_cast<float>(sigma_[first + k]) / kSigmaSteps);
  }
  DepthImageView view;
  view.camera = frame.camera;
  view.T_body_camera = frame.T_body_camera;
  view.depth = scratch_.depth.data();
  view.sigma = (contents_[i] & kSigma) != 0 ? scratch_.sigma.data() : nullptr;
  view.intensity = (contents_[i] & kGrey) != 0 ? grey_.data() + first : nullptr;
  view.labels = (contents_[i] & kLabels) != 0 ? labels_.data() + first : nullptr;
  return view;
}

}  // namespace swiftlet
