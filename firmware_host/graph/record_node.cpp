#include "firmware_host/graph/record_node.hpp"

#include "firmware_host/graph/sensor_node.hpp"

namespace swiftlet {

RecordNode::RecordNode(FlightRecorder& recorder, const SensorNode& sensors)
    : Node("record", Rank::kLow),
      images{RecordedImageIn(*this, "camera_0_unrecorded", Arrow::kWaits),
             RecordedImageIn(*this, "camera_1_unrecorded", Arrow::kWaits)},
      recorder_(recorder),
      sensors_(sensors) {}

/// Writes the earliest arrival; at equal arrivals the sample first, then camera 0. Samples are read first:
/// everything that arrived before a visible sample is visible too.
bool RecordNode::writeNext() {
  const ImuArrival* sample = samples.front();
  std::size_t earliest = kMaxCameras;
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    if (!head_[c] && !images[c].tryPop(head_[c])) continue;
    if (earliest == kMaxCameras || head_[c]->frame.arrival < head_[earliest]->frame.arrival) earliest = c;
  }
  if (sample != nullptr && (earliest == kMaxCameras || sample->arrival <= head_[earliest]->frame.arrival)) {
    recorder_.write(*sample);
    samples.pop();
    return true;
  }
  if (earliest == kMaxCameras) return false;
  recorder_.write(head_[earliest]->frame);
  head_[earliest].reset();
  return true;
}

template <typename Queue>
bool RecordNode::writeSteps(Queue& queue) {
  bool any = false;
  while (const auto* step = queue.front()) {
    recorder_.write(*step);
    queue.pop();
    any = true;
  }
  return any;
}

bool RecordNode::turn() {
  const bool ended = inputEnded();
  bool any = false;
  while (writeNext()) any = true;
  any = writeSteps(propagate) || any;
  any = writeSteps(track) || any;
  any = writeSteps(smooth) || any;
  any = writeSteps(mesh) || any;
  any = writeSteps(loop) || any;
  any = writeSteps(map) || any;
  recorder_.noteLost({propagate.lost(), track.lost(), smooth.lost(), mesh.lost(), loop.lost(), map.lost()});
  recorder_.keepUp();
  if (ended && !any && !done()) {
    recorder_.end(sensors_.counters().samples, sensors_.counters().images);
    finish();
  }
  return any;
}

std::uint64_t RecordNode::lost() const {
  std::uint64_t lost = samples.lost() + propagate.lost() + track.lost() + smooth.lost() + mesh.lost() +
                       loop.lost() + map.lost();
  for (const RecordedImageIn& camera : images) lost += camera.lost();
  return lost;
}

}  // namespace swiftlet
