#pragma once
// Every stage and every arrow of the system, with what each thread does with them. See wiring.cpp: it reads
// as the block diagram.
//
// One function a thread: takeImu (the IMU's), takeImage (each camera's), takeScene (camera 0's), endInput
// (the last of them); propagate, track, smooth, mesh (flight path); loop, map, log, record (low priority).
// Each takes what waits on its arrows, at most one frame, and says whether it did anything. An executor calls
// them: from one thread in turn (lockstep.hpp), or each from its own (threaded.hpp). The arrows are in fixed
// memory and nobody waits on them; who sleeps until something comes is the executor's matter. Nothing on the
// flight path allocates or locks once the first message has been taken.
//
// IMU samples go to their readers at once. `track` and `smooth` take those not later than the frame that they
// work on, so that a frame never sees samples from beyond its stamp. From a log they come before the frame;
// from devices they may come after it, and `track` waits for them, not longer than Options::sample_patience.

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "estimator/core/newest_shared.hpp"
#include "estimator/odometry/pairing.hpp"
#include "estimator/odometry/propagation_stage.hpp"
#include "estimator/odometry/smooth_stage.hpp"
#include "estimator/odometry/track_stage.hpp"
#include "firmware_host/pipeline/arrows.hpp"
#include "firmware_host/pipeline/effort_source.hpp"
#include "firmware_host/pipeline/fault_counts.hpp"
#include "firmware_host/pipeline/held_frames.hpp"
#include "firmware_host/pipeline/live_outlet.hpp"
#include "firmware_host/pipeline/run_log.hpp"
#include "firmware_host/settings/settings.hpp"
#include "mapping/loop/loop_stage.hpp"
#include "mapping/map/map_stage.hpp"
#include "mesher/mesh_stage.hpp"

namespace swiftlet {

class ArmingMonitor;
class FlightRecorder;
class MemoryTable;

/// Bytes that malloc has given out, at the point of construction; members between two of them took the
/// difference.
struct HeapMark {
  HeapMark();
  std::int64_t bytes;
};

/// Counted by the thread that writes it; for others once that thread has ended.
struct WiringCounters {
  struct Sensor {
    std::uint64_t imu_samples = 0;
    std::array<std::uint64_t, kMaxCameras> images{};
    std::array<std::uint64_t, kMaxCameras> images_dropped{};  ///< at a full ring: tracking did not look
    std::array<std::uint64_t, kMaxCameras> images_lost{};     ///< no slot was free
    std::array<std::uint64_t, kMaxCameras> images_wrong_size{};
    std::array<std::uint64_t, kMaxCameras> images_unrecorded{};
    std::uint64_t images_unmeshed = 0;  ///< of camera 0, at a full ring or quota: the mesh did not look
    std::uint64_t scenes = 0;           ///< depth or labels
    std::uint64_t scenes_dropped = 0;   ///< at a full ring or quota: the map did not look
    std::uint64_t labels_wrong_size = 0;
    std::uint64_t depths_wrong_size = 0;
  } sensor;
  struct Propagate {
    std::uint64_t samples = 0;
    std::uint64_t refused = 0;
    FaultCounts faults;
  } propagate;
  struct Track {
    std::uint64_t dropped = 0;          ///< frames that went by while others were in work
    std::uint64_t without_samples = 0;  ///< frames that went on although their samples had not come
    PairingCounters pairing;
  } track;
  struct Mesh {
    std::uint64_t skipped = 0;        ///< windows that a newer one overtook
    std::uint64_t without_image = 0;  ///< steps whose image was gone, or never came
  } mesh;
  struct Map {
    std::uint64_t frames = 0;         ///< that were to be mapped
    std::uint64_t without_image = 0;  ///< of them, skipped: others came before they were looked at
    std::uint64_t without_scene = 0;  ///< of them, whose depth or labels were gone
    std::uint64_t refused = 0;        ///< by the stage
    FaultCounts faults;
  } map;
};

/// What one of the sensors did of late.
struct SensorActivity {
  std::uint64_t messages = 0;
  std::uint64_t reversed_stamps = 0;
  Stamp newest{std::numeric_limits<std::int64_t>::min()};
  double arrival = 0;  ///< host time of the newest

  void note(Stamp stamp, double host_arrival);
};

/// What the sensors did of late, for whoever asks.
struct SensorFacts {
  std::uint64_t samples = 0;
  std::uint64_t reversed_stamps = 0;  ///< at or before the one before
  Stamp newest_sample{std::numeric_limits<std::int64_t>::min()};
  std::array<Stamp, kMaxCameras> newest_image{Stamp{std::numeric_limits<std::int64_t>::min()},
                                              Stamp{std::numeric_limits<std::int64_t>::min()}};
  std::array<double, kMaxCameras> image_arrival{};  ///< host time; 0: none yet
};

class Wiring {
 public:
  struct Options {
    bool imu_states = false;               ///< ask for RunListener::onImuState
    bool meshes = false;                   ///< ask for RunListener::onMesh
    FlightRecorder* recorder = nullptr;    ///< null: nothing is recorded
    EffortSource* track_effort = nullptr;  ///< null: the settings' effort, always
    EffortSource* smooth_effort = nullptr;
    const DepthImageView* depth_sensor = nullptr;  ///< of the map; null: none, depth from the cameras
    std::optional<ConfusionModel> confusion;       ///< of the map's labels; empty: the settings' certainty
    SurfaceSink* spill = nullptr;  ///< takes surface for which the map has no room; null: it is lost
    const Vocabulary* vocabulary = nullptr;  ///< of loop closure; null: the shipped one; outlives the wiring
    ArmingMonitor* arming = nullptr;         ///< null: nobody asks whether the vehicle may be armed
    /// For which `track` waits, after a frame's arrival, for the samples up to its stamp, on the host's
    /// clock; 0: never, for then whoever feeds the wiring hands them over first.
    Duration sample_patience{0};
    LiveOutlets outlets;  ///< each gets the newest of everything; they outlive the wiring
    /// Over which labels come after their image; the map holds frames for them. Null: it does not wait.
    LabelExchange* labels = nullptr;
    /// Called by `log` each time: what the input has to say of itself, to the log. True: there was something.
    std::function<bool(RunLog&)> remarks;
    /// Called after a stage's work with its CPU seconds, within its wall time: tests slow stages down.
    std::function<void(StageId, double)> drag;
  };

  Wiring(const Rig& rig, const ImuNoise& noise, const Settings& settings, RunLog& log,
         const Options& options);

  // Sensors. The image is copied; one of another size than the calibration's is counted and goes no further.
  void takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host);
  void takeImage(const CameraFrame& image, const HostTimes& host);
  /// The same where the pixels are not grey bytes in rows: `image.image` says the size, `pixels` writes them.
  void takeImage(const CameraFrame& image, const HostTimes& host, const PixelWriter& pixels);
  /// Depth and labels of the image of camera 0 that comes next; copied. Without a map: nothing happens.
  void takeScene(const SceneImages& scene);
  /// In place of images: the back-end alone. Lockstep only; false while the smoother has no room.
  bool takeTracks(const TrackedFrame& tracked);
  void endInput() { input_ended_.store(true, std::memory_order_release); }

  // Threads.
  bool propagate();
  bool track();
  bool smooth();
  bool mesh();
  bool loop();
  bool map();
  bool log();
  bool record();

  // What an executor waits for.
  [[nodiscard]] bool trackDone() const { return track_done_.load(std::memory_order_acquire); }
  [[nodiscard]] bool propagateDone() const { return propagate_done_.load(std::memory_order_acquire); }
  [[nodiscard]] bool smoothDone() const { return smooth_done_.load(std::memory_order_acquire); }
  [[nodiscard]] bool meshDone() const { return mesh_done_.load(std::memory_order_acquire); }
  [[nodiscard]] bool loopDone() const { return loop_done_.load(std::memory_order_acquire); }
  [[nodiscard]] bool mapDone() const { return map_done_.load(std::memory_order_acquire); }
  [[nodiscard]] bool logDone() const { return log_done_; }
  /// Any thread: nobody calls log() any more, so nothing waits for room in front of it.
  void abandonLog() { log_abandoned_.store(true, std::memory_order_release); }
  [[nodiscard]] bool recordDone() const { return record_done_; }
  /// Tracked frames that wait for `smooth`.
  [[nodiscard]] std::size_t trackedWaiting() const { return tracked_ring_.size(); }

  [[nodiscard]] const WiringCounters& counters() const { return counters_; }
  /// Null where meshing is switched off; once the thread `mesh` has ended.
  [[nodiscard]] const MeshStage* meshStage() const { return mesh_.get(); }
  /// Null where loop closure is switched off; once the thread `loop` has ended.
  [[nodiscard]] const LoopStage* loopStage() const { return loop_.get(); }
  /// Null where mapping is switched off; once the thread `map` has ended, but for the distance field, which
  /// any one thread may read at any time.
  [[nodiscard]] MapStage* mapStage() const { return map_.get(); }
  /// Null where nobody sends labels after their images; once the thread `map` has ended.
  [[nodiscard]] const HeldFrames* heldFrames() const { return held_.get(); }
  /// Earlier epochs whose worlds loop closure has tied to the newest; as mapStage().
  [[nodiscard]] std::span<const std::uint32_t> tiedEpochs() const {
    if (!to_map_) return {};
    const auto& tied = to_map_->correction.value().tied;
    return {tied.data(), tied.size()};
  }
  /// Losses at full arrows, by name; at the end.
  void addLosses(std::map<std::string, std::uint64_t>& losses) const;
  /// What was reserved for what, by the constructor.
  void addReservations(MemoryTable& table) const;
  /// Any thread.
  [[nodiscard]] SensorFacts sensorFacts() const;
  /// Of the IMU's thread, after takeImu: the sample for which `track` waits has come.
  [[nodiscard]] bool awaitedSampleCame() const { return newest_imu_.load() >= awaited_imu_.load(); }
  [[nodiscard]] const StageTable& times() const { return times_; }

 private:
  struct Camera {
    ImagePool pool{ImagePool::Quotas{kTrackQuota, kMeshQuota, kRecordQuota}};
    ImageRing ring;
    SensorActivity sensed;  ///< of the camera's thread
    NewestShared<SensorActivity> facts;
    // Of `track`: what it holds, in order.
    std::array<ImagePool::Loan, kTrackQuota> held;
    std::size_t held_count = 0;
    bool has_head = false;  ///< the last of `held` was not yet given to pairing
  };

  // track
  void takeArrivals();
  [[nodiscard]] bool awaitsSamples();
  bool popHead(std::size_t camera);
  void pair(const CameraFrame& frame);
  void queueFrame(const StereoFrame& frame);
  void release(const StereoFrame& frame);
  [[nodiscard]] const CameraFrame& headOf(std::size_t camera) const;
  [[nodiscard]] HostTimes hostTimesOf(const StereoFrame& frame) const;
  [[nodiscard]] int waitingFrames() const;
  bool trackFrame();
  bool endTracking();
  void smoothFrame(const TrackMessage& message, FrameResult& out);
  void publishWindow(const TrackMessage& message);

  // mesh
  void handToMesh(SlotHandle handle);
  void meshFrame(const MeshMessage& message);
  [[nodiscard]] bool findMeshImage(std::uint64_t number);
  void publishMesh(bool keyframe);

  // loop, map
  [[nodiscard]] bool wantsMap(const StereoFrame& frame, bool keyframe);
  [[nodiscard]] bool copyImages(const StereoFrame& frame, bool to_loop, bool to_map);

  // loop
  void handKeyframe(const TrackMessage& message);
  [[nodiscard]] bool findKeyframeImages(std::uint64_t frame);

  // map
  void publishMap();
  void correctMap(const MapMessage& message);
  void stepCorrection();
  void drawMap();
  void publishSurface(Stamp stamp);
  template <typename Work>
  void timed(StageId stage, Work&& work);
  void handFrame(const TrackMessage& message, const SmoothedWindow& window);
  void mapFrame(const MapMessage& message, const std::array<ImageView, kMaxCameras>& image,
                const SceneImages& scene);
  void holdFrames();
  bool mapHeldFrame();
  bool mapLeftOver(bool ended);
  [[nodiscard]] bool findMapImages(std::uint64_t frame);
  [[nodiscard]] bool findScene(Stamp stamp);

  void watchArming(const FrameResult& result);

  Rig rig_;
  RunLog& log_;
  FlightRecorder* recorder_;
  ArmingMonitor* arming_;
  Verdict told_;
  LiveOutlets outlets_;
  ConstantEffort full_effort_;
  EffortSource* track_effort_;
  EffortSource* smooth_effort_;
  Duration sample_patience_;
  Duration sample_period_;
  std::function<bool(RunLog&)> remarks_;
  std::function<void(StageId, double)> drag_;

  // Stages.
  PropagationStage propagation_;
  Pairing pairing_;
  HeapMark before_track_;
  TrackStage track_;
  HeapMark before_smooth_;
  SmoothStage smooth_;
  HeapMark before_mesh_;
  std::unique_ptr<MeshStage> mesh_;  ///< null: switched off
  HeapMark before_loop_;
  std::unique_ptr<LoopStage> loop_;  ///< null: switched off
  HeapMark before_map_;
  std::unique_ptr<MapStage> map_;  ///< null: switched off
  HeapMark after_map_;

  // Arrows.
  ImuRing imu_to_propagate_, imu_to_track_, imu_to_smooth_, imu_to_log_;
  NewestShared<SensorActivity> imu_facts_;
  std::array<Camera, kMaxCameras> camera_;
  TrackRing tracked_ring_;
  Newest<StateFix> fix_;
  Newest<SmoothedWindow> window_;
  MeshImageRing image_to_mesh_;  ///< of camera 0
  Newest<MeshMessage> window_to_mesh_;
  Newest<LocalMesh> local_mesh_;
  Newest<PlaneReport> planes_;
  std::unique_ptr<KeyframePool> keyframe_images_;  ///< null where neither loop closure nor map is on
  std::unique_ptr<LoopArrows> to_loop_;            ///< null: switched off
  std::unique_ptr<MapArrows> to_map_;              ///< null: switched off
  std::unique_ptr<HeldFrames> held_;               ///< of `map`; null where no labels are waited for
  std::unique_ptr<MeshRing> meshes_;               ///< null where nobody wants them
  std::unique_ptr<StateRing> states_;              ///< null where nobody wants them
  ResultRing results_;
  std::unique_ptr<RecorderArrows> to_recorder_;

  // Of one thread each.
  SensorActivity imu_sensed_;
  struct {
    std::uint64_t fix = 0;
    NavState state;
  } propagating_;
  struct {
    FixedVector<StereoFrame, kWaitingFrames> waiting;
    StereoFrame paired;
    std::uint64_t samples = 0;
    std::uint64_t window = 0;
    int dropped = 0;
    Stamp newest_sample;
  } tracking_;
  struct {
    std::uint64_t samples = 0;
    std::uint64_t planes = 0;
    std::uint64_t windows = 0;  ///< published
    FrameResult unread;         ///< written where the log has no room
  } smoothing_;
  struct {
    std::uint64_t window = 0;
    ImagePool::Loan image;  ///< at the head of the ring
  } meshing_;
  struct {
    KeyframePool::Loan images;  ///< at the head of the ring
    LoopReport unread;          ///< written where the log has no room
  } closing_;
  struct {
    KeyframePool::Loan images;  ///< at the head of the ring
    ScenePool::Loan scene;      ///< likewise
    bool from_sensor = false;   ///< depth comes from a sensor alone
    std::uint64_t correction = 0;
    FixedVector<RefinedPose, kMaxStates> refined;
    CorrectionStep corrected;
    Eigen::Vector3d vehicle = Eigen::Vector3d::Zero();  ///< in the map
    MapReport report;
  } mapping_;

  std::atomic<std::int64_t> newest_imu_{std::numeric_limits<std::int64_t>::min()};
  /// Once newest_imu_ is there `track` may go on; the latest stamp of all while it does not wait.
  std::atomic<std::int64_t> awaited_imu_{std::numeric_limits<std::int64_t>::max()};
  std::atomic<bool> input_ended_{false}, propagate_done_{false}, track_done_{false}, smooth_done_{false},
      mesh_done_{false}, loop_done_{false}, map_done_{false};
  std::atomic<bool> log_abandoned_{false};
  bool log_done_ = false, record_done_ = false;
  WiringCounters counters_;
  StageTable times_;
};

}  // namespace swiftlet
