#pragma once
// The node `record`: writes everything that entered the estimator, and what each stage used for a step, to
// the flight recorder, in order of arrival.
//
// When it falls behind, records are lost and counted, and the recording notes the position. No thread waits
// for it.

#include <array>

#include "firmware_host/graph/flight_recorder.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/node.hpp"

namespace swiftlet {

class SensorNode;

class RecordNode final : public Node {
 public:
  RecordNode(FlightRecorder& recorder, const SensorNode& sensors);

  QueueIn<ImuArrival, kImuRing> samples{*this, "imu_to_record", Arrow::kWaits};
  std::array<RecordedImageIn, kMaxCameras> images;
  QueueIn<PropagateStep, kStepRing> propagate{*this, "propagate_steps_to_record", Arrow::kWaits};
  QueueIn<TrackStep, kStepRing> track{*this, "track_steps_to_record", Arrow::kWaits};
  QueueIn<SmoothStep, kStepRing> smooth{*this, "smooth_steps_to_record", Arrow::kWaits};
  QueueIn<MeshStep, kStepRing> mesh{*this, "mesh_steps_to_record", Arrow::kWaits};
  QueueIn<LoopStep, kStepRing> loop{*this, "loop_steps_to_record", Arrow::kWaits};
  QueueIn<MapRecord, kMapFrames> map{*this, "map_steps_to_record", Arrow::kWaits};

  bool turn() override;
  /// Any thread: records lost because there was no room.
  [[nodiscard]] std::uint64_t lost() const;
  [[nodiscard]] const FlightRecorder& recorder() const { return recorder_; }

 private:
  bool writeNext();
  template <typename Queue>
  bool writeSteps(Queue& queue);

  FlightRecorder& recorder_;
  const SensorNode& sensors_;
  std::array<ImagePool::Loan, kMaxCameras> head_;  ///< next image of each camera
};

}  // namespace swiftlet
