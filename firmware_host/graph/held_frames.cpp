#include "firmware_host/graph/held_frames.hpp"

#include <algorithm>

#include "firmware_host/interfaces/packed_copy.hpp"

namespace swiftlet {

HeldFrames::HeldFrames(LabelExchange& exchange, const std::array<std::size_t, kMaxCameras>& pixels,
                       std::size_t depth_pixels)
    : exchange_(exchange) {
  for (Frame& frame : frames_) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) frame.pixels[c].resize(pixels[c]);
    frame.depth.resize(depth_pixels);
    frame.labels.resize(pixels[0]);
  }
}

std::int64_t HeldFrames::bytes() const {
  const Frame& frame = frames_[0];
  std::size_t bytes = frame.depth.size() * sizeof(float) + frame.labels.size();
  for (const auto& pixels : frame.pixels) bytes += pixels.size();
  return static_cast<std::int64_t>(frames_.size() * bytes);
}

void HeldFrames::hold(const MapMessage& message, const KeyframeImages* images, const SceneImages& scene,
                      double now) {
  Frame& frame = frames_[(first_ + count_++) % frames_.size()];
  frame.message = message;
  frame.has_images = images != nullptr;
  frame.since = now;
  frame.place = -1;
  frame.scene = SceneImages{};
  frame.scene.stamp = message.stamp;
  frame.number = {};
  if (images == nullptr) return;
  frame.number = images->number;
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    frame.image[c] = packedCopy(images->image[c], frame.pixels[c].data());
  }
  if (scene.depth.depth != nullptr) {
    std::copy_n(scene.depth.depth, frame.depth.size(), frame.depth.begin());
    frame.scene.depth = scene.depth;
    frame.scene.depth.depth = frame.depth.data();
  }
  frame.scene.labels = packedCopy(scene.labels, frame.labels.data());
  if (frame.scene.labels.empty() && !frame.image[0].empty()) {
    frame.place = exchange_.open(message.stamp, frame.image[0]);
  }
}

const HeldFrames::Frame* HeldFrames::due(double now) {
  if (empty()) return nullptr;
  Frame& frame = frames_[first_];
  if (frame.place < 0 || taken_) return &frame;
  const bool labelled = exchange_.isLabelled(frame.place);
  const bool nobody = !exchange_.hasLabeller();
  const bool late = now - frame.since > exchange_.patience().seconds();
  if (!labelled && !nobody && !late && !full()) return nullptr;
  if (!exchange_.tryClose(frame.place)) return nullptr;  // labels are being written right now
  frame.scene.labels = exchange_.labels(frame.place);
  // The labels may have arrived since isLabelled().
  ++(!frame.scene.labels.empty() ? counters_.labelled
     : nobody                    ? counters_.nobody
     : late                      ? counters_.late
                                 : counters_.no_room);
  counters_.longest_ms =
      std::max(counters_.longest_ms, static_cast<std::uint64_t>(1e3 * std::max(now - frame.since, 0.0)));
  taken_ = true;
  return &frame;
}

void HeldFrames::drop() {
  Frame& frame = frames_[first_];
  if (frame.place >= 0) exchange_.free(frame.place);
  taken_ = false;
  first_ = (first_ + 1) % frames_.size();
  --count_;
}

}  // namespace swiftlet
