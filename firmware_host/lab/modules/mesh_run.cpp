#include "firmware_host/lab/modules/mesh_run.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "drivers/recorded/label_images.hpp"
#include "drivers/recorded/open_log.hpp"
#include "estimator/core/units.hpp"
#include "estimator/frontend/frontend.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "estimator/odometry/pairing.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/inputs/log/log_feed.hpp"
#include "firmware_host/lab/modules/given_pose_window.hpp"
#include "firmware_host/lab/modules/given_poses.hpp"
#include "firmware_host/outputs/map_files/mesh_files.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/progress.hpp"
#include "mesher/mesh_stage.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

// A flight of half an hour through new surroundings all the time: 100 new landmarks a second.
constexpr std::size_t kCompleteVertices = 200'000;

HorizonLimits completeLimits() { return {kCompleteVertices, 2 * kCompleteVertices, true}; }

GivenPoseSettings windowSettings(const Settings& settings, bool complete) {
  GivenPoseSettings window;
  window.pixel_sigma = settings.odometry.pixel_sigma;
  window.horizon = settings.odometry.horizon;
  window.max_keyframes = settings.effort.keyframes;
  window.keep_sightings = complete;
  return window;
}

/// Landmarks by the given poses, and the meshes of them.
struct Mesher {
  Mesher(const Rig& rig, const GivenPoseSettings& settings, const HorizonLimits& limits,
         const MeshPlanes& planes)
      : window(rig, settings), stage(std::make_unique<MeshStage>(rig, limits, planes)) {}

  GivenPoseWindow window;
  std::unique_ptr<MeshStage> stage;
  LatencyHistogram frame_times;     ///< CPU s of a step
  LatencyHistogram keyframe_times;  ///< likewise, at keyframes
};

TriangleMesh toTriangleMesh(const HorizonMesh& mesh) {
  TriangleMesh out;
  for (const MeshVertex& vertex : mesh.vertices()) {
    out.vertices.push_back(vertex.p_world);
    out.grey.push_back(vertex.grey);
  }
  for (const HorizonMesh::Face& face : mesh.faces()) {
    out.faces.push_back(face.vertex);
    out.labels.push_back(face.label);
  }
  return out;
}

Json timingJson(const LatencyHistogram& cpu) {
  return {{"count", cpu.count()},
          {"cpu",
           {{"p50_ms", cpu.percentile(0.5) * kToMs},
            {"p99_ms", cpu.percentile(0.99) * kToMs},
            {"max_ms", cpu.max() * kToMs}}}};
}

Json landmarksJson(const GivenPoseCounters& counters) {
  return {{"triangulated", counters.triangulated},
          {"sightings_left_out", counters.sightings_left_out},
          {"no_parallax", counters.no_parallax},
          {"no_fit", counters.no_fit}};
}

LogOptions logOptions(const MeshRequest& request, const Settings& settings) {
  LogOptions options;
  options.calibration = request.calibration;
  options.imu_calibration = request.imu_calibration;
  options.calibration_options.accept_unusual_rig = settings.calibration.accept_unusual_rig;
  options.mono = request.mono || !settings.odometry.use_stereo;
  return options;
}

/// What one run is made of, from opening to the summary.
class MeshRun {
 public:
  MeshRun(const MeshRequest& request, const Settings& settings)
      : request_(request),
        settings_(settings),
        source_(openLog(request.log, logOptions(request, settings))),
        rig_(rigInUse(source_->rig(), settings.odometry)) {}

  MeshRunResult operator()() {
    begin();
    run();
    progress_->finish();
    if (!output_) failWithoutPose();
    return end();
  }

 private:
  /// Files that come into being with the first frame that has a pose.
  struct Output {
    explicit Output(const std::filesystem::path& folder)
        : meshes(folder.string()), poses((folder / "trajectory.tum").string()) {
      // What an earlier run left and this one does not write would be taken for this one's.
      std::error_code ignored;
      for (const char* name : {"local_mesh.ply", "complete_mesh.ply", "summary.json"}) {
        std::filesystem::remove(folder / name, ignored);
      }
    }
    MeshSequenceWriter meshes;
    TumWriter poses;
  };

  void begin();
  void run();
  void take(const StereoFrame& frame);
  void mesh(const TrackedFrame& tracked, const GivenPoses::Pose& pose, const ImageView& image);
  void step(Mesher& mesher, const TrackedFrame& tracked, const SE3& T_world_body, const MeshInput& views);
  std::optional<GivenPoses::Pose> poseAt(Stamp stamp);
  void noteJump(std::size_t piece);
  [[noreturn]] void failWithoutPose() const;
  [[nodiscard]] Json timingsJson() const;
  MeshRunResult end();
  [[nodiscard]] std::string file(const char* name) const {
    return std::filesystem::path(request_.out) / name;
  }

  const MeshRequest& request_;
  const Settings& settings_;
  std::unique_ptr<LogSource> source_;
  Rig rig_;
  LogWarnings warnings_;
  std::string poses_name_;
  std::optional<GivenPoses> poses_;
  std::unique_ptr<TrackReader> tracks_;
  std::optional<LabelImages> labels_;
  std::optional<Progress> progress_;
  std::unique_ptr<Frontend> frontend_;
  std::unique_ptr<Mesher> local_, complete_;
  FrontendPrediction prediction_;
  TrackedFrame tracked_;
  LocalMesh frame_mesh_, horizon_mesh_;
  std::optional<Output> output_;
  bool finished_ = true;
  bool has_mesh_ = false;
  std::size_t piece_ = 0;
  std::optional<Stamp> first_image_, last_image_;
  std::uint64_t frames_ = 0, without_pose_ = 0, refused_ = 0, meshed_ = 0, keyframes_ = 0, jumps_ = 0,
                labelled_ = 0;
};

void MeshRun::begin() {
  NamedTrajectory trajectory = openTrajectory(request_.trajectory, request_.log, *source_, warnings_);
  poses_name_ = trajectory.name;
  poses_.emplace(std::move(trajectory.poses), Duration::fromSeconds(request_.max_gap));
  if (poses_->jumps() > 0) {
    warnings_.add(fmt::format("{}: the poses jump {} times, first at {}: a new mesh begins after each",
                              poses_name_, poses_->jumps(), formatSeconds(poses_->firstJump())));
  }
  std::size_t steps = source_->imageCount();
  if (!source_->trackFile().empty()) {
    steps = surveyTrackFile(source_->trackFile()).frames;
    tracks_ = std::make_unique<TrackReader>(source_->trackFile());
  } else {
    frontend_ = std::make_unique<Frontend>(rig_, FrontendSettings{});
  }
  labels_.emplace(request_.log, ImageSize{rig_.camera[0].width(), rig_.camera[0].height()}, warnings_);
  warnAll(source_->warnings());
  warnAll(warnings_.lines());
  local_ = std::make_unique<Mesher>(
      rig_, windowSettings(settings_, false), HorizonLimits{},
      MeshPlanes{settings_.odometry.regularity_enabled, settings_.odometry.plane_point_sigma});
  if (request_.complete) {
    complete_ =
        std::make_unique<Mesher>(rig_, windowSettings(settings_, true), completeLimits(), MeshPlanes{});
  }
  progress_.emplace("mesh", request_.show_progress ? steps : 0);
}

void MeshRun::run() {
  LogFeed feed(*source_, {request_.from, request_.until, std::nullopt}, tracks_.get());
  PairingSettings pairing_settings;
  pairing_settings.cameras = rig_.camera_count;
  pairing_settings.tolerance = Duration::fromSeconds(settings_.pairing.tolerance_ms * 1e-3);
  pairing_settings.patience = Duration::fromSeconds(settings_.pairing.patience_ms * 1e-3);
  Pairing pairing(pairing_settings);
  StereoFrame frame;
  for (;;) {
    if (request_.stop != nullptr && request_.stop->load(std::memory_order_relaxed)) {
      finished_ = false;
      return;
    }
    const LogFeed::Next next = feed.next();
    if (next == LogFeed::Next::kEnd) break;
    if (next == LogFeed::Next::kTracks) {
      if (const auto pose = poseAt(feed.tracks().stamp)) mesh(feed.tracks(), *pose, {});
    } else if (next == LogFeed::Next::kImage) {
      if (pairing.push(feed.image(), frame).ok()) take(frame);
    } else if (pairing.expire(feed.sample().stamp, frame).ok()) {
      take(frame);
    }
    progress_->update(feed.taken());
  }
  if (pairing.flush(frame).ok()) take(frame);
}

std::optional<GivenPoses::Pose> MeshRun::poseAt(Stamp stamp) {
  ++frames_;
  if (!first_image_) first_image_ = stamp;
  last_image_ = stamp;
  const auto pose = poses_->at(stamp);
  if (!pose) ++without_pose_;
  return pose;
}

void MeshRun::take(const StereoFrame& frame) {
  const auto pose = poseAt(frame.stamp);
  if (!pose) return;
  noteJump(pose->piece);
  local_->window.predict(pose->T_world_body, prediction_);
  if (!frontend_->step(frame, prediction_, settings_.odometry.max_features, tracked_).ok()) {
    ++refused_;
    return;
  }
  mesh(tracked_, *pose, frame.image[0]);
}

/// What was tracked before a jump has no place in the poses after it.
void MeshRun::noteJump(std::size_t piece) {
  if (meshed_ > 0 && piece != piece_) {
    ++jumps_;
    local_->window.startEpoch();
    if (complete_) complete_->window.startEpoch();
    if (frontend_) frontend_->reset();
  }
  piece_ = piece;
}

void MeshRun::mesh(const TrackedFrame& tracked, const GivenPoses::Pose& pose, const ImageView& image) {
  noteJump(pose.piece);
  if (!output_) output_.emplace(request_.out);
  MeshInput views;
  views.image = image;
  views.labels = labels_->at(tracked.stamp);
  labelled_ += views.labels.empty() ? 0 : 1;
  step(*local_, tracked, pose.T_world_body, views);
  if (complete_) step(*complete_, tracked, pose.T_world_body, views);
  ++meshed_;
  keyframes_ += tracked.keyframe ? 1 : 0;
  local_->stage->frameMesh(frame_mesh_);
  local_->stage->horizonMesh(horizon_mesh_);
  has_mesh_ = has_mesh_ || !frame_mesh_.faces.empty();
  output_->poses.write(tracked.stamp, pose.T_world_body);
  output_->meshes.write(tracked.keyframe, frame_mesh_, tracked.keyframe ? &horizon_mesh_ : nullptr,
                        local_->stage->hull());
}

void MeshRun::step(Mesher& mesher, const TrackedFrame& tracked, const SE3& T_world_body,
                   const MeshInput& views) {
  mesher.window.add(tracked, T_world_body);
  MeshInput input = views;
  input.window = &mesher.window.window();
  input.tracks = &tracked;
  // Refusals are in the stage's counters; the meshes are then as they were.
  const Spent spent = measured([&] { static_cast<void>(mesher.stage->step(input)); });
  (tracked.keyframe ? mesher.keyframe_times : mesher.frame_times).add(spent.cpu);
}

void MeshRun::failWithoutPose() const {
  if (!first_image_) {
    throw InputError(request_.log, 0, "", "no image in the part of the log that was asked for",
                     "Give another --from or --until");
  }
  throw InputError(poses_name_, 0, "timestamp",
                   fmt::format("no image has a pose: the poses go from {} to {}, the images from {} to {}",
                               formatSeconds(poses_->begin()), formatSeconds(poses_->end()),
                               formatSeconds(*first_image_), formatSeconds(*last_image_)),
                   fmt::format("Both need stamps of one clock, and poses at most --max-gap={:g} s apart",
                               request_.max_gap));
}

Json MeshRun::timingsJson() const {
  Json json;
  json["frames"] = timingJson(local_->frame_times);
  json["keyframes"] = timingJson(local_->keyframe_times);
  if (complete_) {
    json["complete_frames"] = timingJson(complete_->frame_times);
    json["complete_keyframes"] = timingJson(complete_->keyframe_times);
  }
  return json;
}

MeshRunResult MeshRun::end() {
  output_->poses.close();
  writePly(file("local_mesh.ply"), swiftlet::toTriangleMesh(horizon_mesh_));
  Json json;
  json["version"] = versionJson();
  json["run"] = {{"command", "mesh"},
                 {"log", request_.log},
                 {"trajectory", poses_name_},
                 {"cameras", rig_.camera_count},
                 {"finished", finished_},
                 {"first_image_ns", first_image_->ns},
                 {"last_image_ns", last_image_->ns}};
  json["frames"] = {{"images", frames_},       {"without_pose", without_pose_}, {"refused", refused_},
                    {"meshed", meshed_},       {"keyframes", keyframes_},       {"jumps", jumps_},
                    {"with_labels", labelled_}};
  json["landmarks"] = landmarksJson(local_->window.counters());
  json["counters"] = toJson(local_->stage->counters(), local_->stage->horizon().counters());
  json["local_mesh"] = {{"vertices", horizon_mesh_.vertices.size()}, {"faces", horizon_mesh_.faces.size()}};
  if (complete_) {
    const HorizonMesh& mesh = complete_->stage->horizon();
    writePly(file("complete_mesh.ply"), toTriangleMesh(mesh));
    json["complete_keyframes"] = {{"vertices", mesh.vertices().size()},
                                  {"faces", mesh.faces().size()},
                                  {"landmarks", landmarksJson(complete_->window.counters())},
                                  {"counters", toJson(complete_->stage->counters(), mesh.counters())}};
  }
  json["timing"] = timingsJson();
  json["warnings"] = source_->warnings();
  for (const std::string& line : warnings_.lines()) json["warnings"].push_back(line);
  writeJson(file("summary.json"), json);
  return {json, finished_, has_mesh_};
}

}  // namespace

MeshRunResult runMesh(const MeshRequest& request, const Settings& settings) {
  return MeshRun(request, settings)();
}

}  // namespace swiftlet
