#include "firmware_host/lab/modules/mesh_run.hpp"

#include <filesystem>
#include <memory>

#include "drivers/recorded/label_images.hpp"
#include "estimator/core/units.hpp"
#include "estimator/frontend/frontend.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/lab/modules/given_pose_window.hpp"
#include "firmware_host/outputs/map_files/mesh_files.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "mesher/mesh_stage.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

// A flight of half an hour through new surroundings: 100 new landmarks per second.
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

/// Landmarks from the given poses, and their meshes.
struct Mesher {
  Mesher(const Rig& rig, const GivenPoseSettings& settings, const HorizonLimits& limits,
         const MeshPlanes& planes)
      : window(rig, settings), stage(std::make_unique<MeshStage>(rig, limits, planes)) {}

  GivenPoseWindow window;
  std::unique_ptr<MeshStage> stage;
  LatencyHistogram frame_times;     ///< CPU time of a step [s]
  LatencyHistogram keyframe_times;  ///< CPU time of a step at keyframes [s]
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

MeshRequest inUse(MeshRequest request, const Settings& settings) {
  request.mono = request.mono || !settings.odometry.use_stereo;
  return request;
}

/// The parts of one run, from opening to the summary.
class MeshRun {
 public:
  MeshRun(const MeshRequest& request, const Settings& settings)
      : request_(inUse(request, settings)), settings_(settings), log_(request_, settings), rig_(log_.rig()) {}

  MeshRunResult operator()() {
    begin();
    finished_ = log_.run("mesh", {[this](const StereoFrame& frame) { take(frame); },
                                  [this](const TrackedFrame& tracks) {
                                    if (const auto pose = poseAt(tracks.stamp)) mesh(tracks, *pose, {});
                                  }});
    if (!output_) log_.failWithoutPose("image", frames_ > 0);
    return end();
  }

 private:
  /// Files that are created with the first frame that has a pose.
  struct Output {
    explicit Output(const std::filesystem::path& folder)
        : claim(folder.string(), RunKind::kMesh, false),
          meshes(folder.string()),
          poses((folder / "trajectory.tum").string()) {}
    RunClaim claim;
    MeshSequenceWriter meshes;
    TumWriter poses;
  };

  void begin();
  void take(const StereoFrame& frame);
  void mesh(const TrackedFrame& tracked, const GivenPoses::Pose& pose, const ImageView& image);
  void step(Mesher& mesher, const TrackedFrame& tracked, const SE3& T_world_body, const MeshInput& views);
  std::optional<GivenPoses::Pose> poseAt(Stamp stamp);
  void noteJump(std::size_t piece);
  [[nodiscard]] Json timingsJson() const;
  MeshRunResult end();
  [[nodiscard]] std::string file(const char* name) const {
    return std::filesystem::path(request_.out) / name;
  }

  const MeshRequest request_;
  const Settings& settings_;
  PosedLog log_;
  const Rig& rig_;
  std::optional<LabelImages> labels_;
  std::unique_ptr<Frontend> frontend_;
  std::unique_ptr<Mesher> local_, complete_;
  FrontendPrediction prediction_;
  TrackedFrame tracked_;
  LocalMesh frame_mesh_, horizon_mesh_;
  std::optional<Output> output_;
  bool finished_ = true;
  bool has_mesh_ = false;
  std::size_t piece_ = 0;
  std::uint64_t frames_ = 0, without_pose_ = 0, refused_ = 0, meshed_ = 0, keyframes_ = 0, jumps_ = 0,
                labelled_ = 0;
};

void MeshRun::begin() {
  refuseRunIn(request_.out, RunKind::kMesh);
  log_.poses().warnOfJumps("a new mesh starts after each", log_.warnings());
  if (!log_.hasTracks()) frontend_ = std::make_unique<Frontend>(rig_, FrontendSettings{});
  labels_.emplace(request_.log, ImageSize{rig_.camera[0].width(), rig_.camera[0].height()}, log_.warnings());
  local_ = std::make_unique<Mesher>(
      rig_, windowSettings(settings_, false), HorizonLimits{},
      MeshPlanes{settings_.odometry.regularity_enabled, settings_.odometry.plane_point_sigma});
  if (request_.complete) {
    complete_ =
        std::make_unique<Mesher>(rig_, windowSettings(settings_, true), completeLimits(), MeshPlanes{});
  }
}

std::optional<GivenPoses::Pose> MeshRun::poseAt(Stamp stamp) {
  ++frames_;
  auto pose = log_.poses().at(stamp);
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

/// Tracks from before a jump do not fit the poses after it.
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
  // Refusals are counted by the stage; its meshes are then unchanged.
  const Spent spent = measured([&] { static_cast<void>(mesher.stage->step(input)); });
  (tracked.keyframe ? mesher.keyframe_times : mesher.frame_times).add(spent.cpu);
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
                 {"trajectory", log_.poses().name()},
                 {"cameras", rig_.camera_count},
                 {"finished", finished_},
                 {"first_image_ns", log_.first()->ns},
                 {"last_image_ns", log_.last()->ns},
                 {"t_imu_minus_t_image_ns", log_.rig().camera_to_imu_shift.ns}};
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
  json["warnings"] = log_.warningsJson();
  writeJson(file("summary.json"), json);
  return {json, finished_, has_mesh_};
}

}  // namespace

MeshRunResult runMesh(const MeshRequest& request, const Settings& settings) {
  return MeshRun(request, settings)();
}

}  // namespace swiftlet
