#pragma once
// Every stage and every arrow of the system, for an executor to drive. See wiring.cpp: it reads as the
// block diagram.
//
// One thread calls these functions, in the order of the stream (see LogSource). An image's memory must
// stay valid for two further images of the same camera. An IMU sample that is newer than a frame still
// waiting for its partner is held back until the frame has gone through, so that a frame never sees
// samples from beyond its stamp.

#include <memory>
#include <vector>

#include "estimator/odometry/odometry.hpp"
#include "estimator/odometry/pairing.hpp"
#include "estimator/smoother/full_smoother.hpp"
#include "firmware_host/pipeline/run_listener.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

class Wiring {
 public:
  Wiring(const Rig& rig, const ImuNoise& noise, const Settings& settings, RunListener& listener);

  void feedImu(const ImuSample& sample);
  void feedImage(const CameraFrame& frame);
  /// In place of images: the back-end alone.
  void feedTracks(const TrackedFrame& tracked);
  /// Lets out what still waits. Nothing may be fed afterwards.
  void finish();

  /// Keep keyframes for full smoothing (call before the first message), and do it (after finish()).
  /// The poses are those of the keyframes after it; empty when nothing could be solved.
  void keepForMap();
  struct MapPose {
    Stamp stamp;
    SE3 T_world_body;
  };
  std::vector<MapPose> solveMap();

  /// Ask for onImuState calls.
  void wantImuStates(bool wanted) { want_imu_states_ = wanted; }

  [[nodiscard]] RunStatistics& statistics() { return statistics_; }

 private:
  void passImu(const ImuSample& sample);
  void passHeldImu(Stamp until);
  void passFrame(const StereoFrame& frame);
  void passTracks(const TrackedFrame& tracked, Spent spent);
  void noteOutput(Stamp stamp, const OdometryOutput& output);
  void noteFault(const Status& status, std::uint64_t& counter);

  Rig rig_;
  ImuNoise noise_;
  OdometrySettings odometry_settings_;
  Pairing pairing_;
  Odometry odometry_;
  std::unique_ptr<FullSmoother> full_smoother_;
  Effort effort_;
  RunListener& listener_;
  bool want_imu_states_ = false;
  FixedVector<ImuSample, kMaxImuPerFrame> held_imu_;
  StereoFrame paired_;
  TrackedFrame tracked_;
  OdometryOutput output_;
  const char* waiting_for_ = "";
  RunStatistics statistics_;
};

}  // namespace swiftlet
