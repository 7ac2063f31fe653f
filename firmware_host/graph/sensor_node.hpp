#pragma once
// Entry of sensor messages into the graph: samples go to queues; images, depth and labels into slots.
//
// Threads: takeImu from the IMU's, takeImage from each camera's own (one thread may have both), takeScene
// from camera 0's, endInput from the last of them. The node has no turn: it ends when the input does. Images
// are copied; an image whose size differs from the calibration's is counted and dropped. Messages whose
// stamps have jumped (estimator/odometry/stamp_guard.hpp) are counted and go only to the recording: a
// repetition of the run decides on them again.

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>

#include "estimator/core/newest_shared.hpp"
#include "estimator/odometry/stamp_guard.hpp"
#include "firmware_host/graph/graph_options.hpp"
#include "firmware_host/graph/images.hpp"
#include "firmware_host/graph/messages.hpp"
#include "firmware_host/graph/node.hpp"
#include "firmware_host/supervisor/equal_readings.hpp"
#include "firmware_host/supervisor/flight_facts.hpp"

namespace swiftlet {

struct ImuNews {
  SensorNews news;
  std::uint64_t equal = 0;  ///< consecutive samples with equal readings
};

class SensorNode final : public Node {
 public:
  explicit SensorNode(const GraphContext& context);

  Out<ImuArrival> imu{*this};
  Out<ImuArrival> imu_as_delivered{*this};  ///< including those held out
  Out<SceneNote> scene_notes{*this};
  void imagesTo(std::size_t camera, ImageIn& in) { lend(camera, in, camera_[camera].track); }
  void imagesTo(std::size_t camera, MeshImageIn& in) { lend(camera, in, camera_[camera].mesh); }
  void imagesTo(std::size_t camera, RecordedImageIn& in) { lend(camera, in, camera_[camera].record); }
  void scenesTo(SceneIn& in);
  /// Makes the memory of all images resident. Call before the threads start.
  void touchImages();

  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host);
  void takeImage(const CameraFrame& image, const HostTimes& host);
  /// Depth and labels of camera 0's next image. Ignored without a map.
  void takeScene(const SceneImages& scene);
  void endInput() { finish(); }
  bool turn() override { return false; }

  /// Any thread: stamp of the newest sample; the earliest possible stamp before the first.
  [[nodiscard]] Stamp newestSample() const { return Stamp{newest_imu_.load()}; }
  /// The IMU's thread: time line of the newest sample.
  [[nodiscard]] std::uint32_t timeline() const { return imu_guard_.timeline(); }
  /// Any thread: recent activity of the sensors.
  void look(FlightFacts& facts) const;

  /// For use after the sensors have ended.
  struct Counters {
    std::uint64_t samples = 0;           ///< including those held out; so are images
    std::uint64_t samples_held_out = 0;  ///< stamp far ahead
    std::array<std::uint64_t, kMaxCameras> images{};
    std::array<std::uint64_t, kMaxCameras> images_held_out{};  ///< stamp far from the IMU's
    std::array<std::uint64_t, kMaxCameras> images_lost{};      ///< no free slot
    std::array<std::uint64_t, kMaxCameras> images_wrong_size{};
    std::uint64_t labels_wrong_size = 0;
    std::uint64_t depths_wrong_size = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }
  void report(RunStatistics& statistics) const override;
  void addLosses(std::map<std::string, std::uint64_t>& losses) const override;

 private:
  struct Camera {
    std::shared_ptr<ImagePool> pool;
    ImageIn* track = nullptr;
    MeshImageIn* mesh = nullptr;
    RecordedImageIn* record = nullptr;
    // For the camera's thread.
    ImageGuard guard;
    SensorNews sensed;
    NewestShared<SensorNews> news;
  };

  template <typename Reader>
  void lend(std::size_t camera, Reader& in, Reader*& kept) {
    in.lendFrom(*camera_[camera].pool);
    kept = &in;
    connect(*this, in);
  }
  void fillScene(const SceneImages& from, SceneSlot& slot);

  const GraphContext& context_;
  ImageFeed* const view_;  ///< null: no images are shown
  const ImagePool::Quotas quotas_;
  std::array<Camera, kMaxCameras> camera_;
  std::unique_ptr<ScenePool> scenes_;  ///< null without a map
  SceneIn* scene_in_ = nullptr;
  StampGuard imu_guard_;
  NewestShared<ImuTime> imu_time_;  ///< for the cameras' threads
  ImuNews imu_sensed_;
  NewestShared<ImuNews> imu_news_;
  EqualReadings equal_readings_;
  std::atomic<std::int64_t> newest_imu_{std::numeric_limits<std::int64_t>::min()};
  Counters counters_;
};

}  // namespace swiftlet
