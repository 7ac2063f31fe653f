#include "firmware_host/lab/modules/fuse_run.hpp"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <memory>

#include "drivers/recorded/depth_images.hpp"
#include "drivers/recorded/label_images.hpp"
#include "estimator/core/units.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/outputs/map_files/block_file.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "firmware_host/outputs/map_files/map_output.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/settings/confusion_file.hpp"
#include "firmware_host/settings/map_check.hpp"
#include "mapping/map/map_stage.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

/// CPU time of a step's parts.
struct MapTimes {
  LatencyHistogram depth;
  LatencyHistogram volume;
  LatencyHistogram surface;
  LatencyHistogram distance;
};

Json timingJson(const MapTimes& times) {
  Json json;
  const std::array<std::pair<const char*, const LatencyHistogram*>, 4> parts{{{"depth", &times.depth},
                                                                              {"volume", &times.volume},
                                                                              {"surface", &times.surface},
                                                                              {"distance", &times.distance}}};
  for (const auto& [name, cpu] : parts) {
    json[name] = {{"count", cpu->count()},
                  {"cpu",
                   {{"mean_ms", cpu->mean() * kToMs},
                    {"p50_ms", cpu->percentile(0.5) * kToMs},
                    {"p99_ms", cpu->percentile(0.99) * kToMs},
                    {"max_ms", cpu->max() * kToMs}}}};
  }
  return json;
}

/// The parts of one run, from opening to the summary.
class FuseRun {
 public:
  FuseRun(const FuseRequest& request, const Settings& settings)
      : request_(request),
        settings_(settings),
        log_(request, settings),
        rig_(log_.rig()),
        depth_(request.log, log_.warnings(), log_.source().calibration().T_body_filebody),
        labels_(request.log, {rig_.camera[0].width(), rig_.camera[0].height()}, log_.warnings()) {}

  FuseRunResult operator()() {
    begin();
    finished_ = log_.run("fuse", {[this](const StereoFrame& frame) { take(frame); }, {}});
    if (!poses_out_) log_.failWithoutPose("depth image", moments_ > 0);
    return end();
  }

 private:
  void begin();
  void openKept();
  void take(const StereoFrame& frame);
  void takeSensorUntil(Stamp stamp, const StereoFrame* frame);
  void fuse(Stamp stamp, const StereoFrame* frame, const DepthImageView& depth);
  FuseRunResult end();
  [[nodiscard]] std::string file(const char* name) const {
    return std::filesystem::path(request_.out) / name;
  }

  const FuseRequest& request_;
  const Settings settings_;
  PosedLog log_;
  const Rig& rig_;
  DepthImages depth_;
  LabelImages labels_;
  BlockFile storage_{request_.out};
  std::unique_ptr<MapStage> map_;
  std::optional<RunClaim> claim_;
  std::optional<TumWriter> poses_out_;
  std::optional<KeptMapReport> continued_;
  MapReport report_;
  MapTimes times_;
  bool sensor_ = false;
  std::size_t next_depth_ = 0;  ///< row
  bool any_frame_ = false;
  std::optional<Stamp> last_pair_;
  bool finished_ = true;
  std::uint64_t moments_ = 0, without_pose_ = 0, refused_ = 0, fused_ = 0, labelled_ = 0;
};

void FuseRun::begin() {
  refuseRunIn(request_.out, RunKind::kMap);
  checkMapSettings(settings_.map_stage);
  const std::optional<ConfusionModel> confusion = confusionOf(settings_);
  log_.poses().warnOfJumps("the map starts anew after each", log_.warnings());
  sensor_ =
      request_.depth == DepthSource::kSensor || (request_.depth == DepthSource::kAny && !depth_.empty());
  if (sensor_ && depth_.empty()) {
    throw InputError(request_.log, 0, "", "has no depth images (mav0/depth0)", "Use --depth stereo");
  }
  if (!sensor_ && rig_.camera_count < 2) {
    throw InputError(request_.log, 0, "", "one camera and no depth images: no source of depth",
                     "Give a log with two cameras or with mav0/depth0");
  }
  if (sensor_) {
    DepthImageView camera;
    camera.camera = depth_.sensor().camera;
    camera.T_body_camera = depth_.sensor().T_body_camera;
    map_ = std::make_unique<MapStage>(rig_, settings_.map_stage, &camera, &storage_, MapPoses::kGiven);
  } else {
    map_ = std::make_unique<MapStage>(rig_, settings_.map_stage, nullptr, &storage_, MapPoses::kGiven);
    if (const std::string line = nearDepthWarning(rig_); !line.empty()) log_.warnings().add(line);
  }
  if (confusion) map_->setConfusion(*confusion);
  openKept();
}

void FuseRun::openKept() {
  if (!request_.keep.empty()) {
    // Checked now, not after an hour's work.
    const std::filesystem::path folder = std::filesystem::absolute(request_.keep).parent_path();
    if (!std::filesystem::is_directory(folder) || std::filesystem::is_directory(request_.keep)) {
      throw InputError(request_.keep, 0, "--keep", "is not a file in a folder that exists",
                       "Create the folder first, or give another file");
    }
  }
  if (request_.continued.empty()) return;
  continued_ = readKeptMapFile(request_.continued, *map_);
}

void FuseRun::take(const StereoFrame& frame) {
  if (!any_frame_) {
    any_frame_ = true;
    // Depth images before the requested section are skipped.
    while (next_depth_ < depth_.rows().size() && depth_.rows()[next_depth_].stamp < frame.stamp)
      ++next_depth_;
  }
  if (sensor_) {
    takeSensorUntil(frame.stamp, &frame);
    return;
  }
  if (frame.image[0].empty() || frame.image[1].empty()) return;
  const bool due = !last_pair_ || (frame.stamp - *last_pair_).seconds() >= request_.interval;
  if (!due && labels_.at(frame.stamp).empty()) return;
  last_pair_ = frame.stamp;
  fuse(frame.stamp, &frame, {});
}

/// Takes depth images up to a frame's stamp; the one at the stamp gets the frame's grey values and labels.
void FuseRun::takeSensorUntil(Stamp stamp, const StereoFrame* frame) {
  for (; next_depth_ < depth_.rows().size() && depth_.rows()[next_depth_].stamp <= stamp; ++next_depth_) {
    const Stamp at = depth_.rows()[next_depth_].stamp;
    const DepthImageView view = depth_.at(at);
    if (view.depth != nullptr) fuse(at, at == stamp ? frame : nullptr, view);
  }
}

void FuseRun::fuse(Stamp stamp, const StereoFrame* frame, const DepthImageView& depth) {
  ++moments_;
  const auto pose = log_.poses().at(stamp);
  if (!pose) {
    ++without_pose_;
    return;
  }
  if (!poses_out_) {
    claim_.emplace(request_.out, RunKind::kMap, false);
    poses_out_.emplace(file("trajectory.tum"));
  }
  poses_out_->write(stamp, pose->T_world_body);
  MapInput input;
  input.stamp = stamp;
  input.epoch = (continued_ ? continued_->epoch : 0) + static_cast<std::uint32_t>(pose->piece);
  input.T_map_body = pose->T_world_body;
  input.scan = log_.poses().scanAt(stamp, rig_.readout);
  input.depth = depth;
  if (frame != nullptr) input.image = frame->image;
  if (settings_.map_stage.labels) input.labels = labels_.at(stamp);
  bool taken = false;
  const Spent depth_time = measured([&] { taken = map_->measure(input, {}, report_).ok(); });
  const Spent volume_time = measured(
      [&] { taken = taken && map_->integrate(input, {}, report_).code != StatusCode::kInvalidInput; });
  if (!taken) {
    ++refused_;
    return;
  }
  ++fused_;
  labelled_ += report_.with_labels ? 1 : 0;
  times_.depth.add(depth_time.cpu);
  times_.volume.add(volume_time.cpu);
  const Eigen::Vector3d& vehicle = pose->T_world_body.translation;
  // What is not drawn now is counted in the report and drawn later.
  times_.surface.add(measured([&] { static_cast<void>(map_->draw(vehicle, {}, report_)); }).cpu);
  times_.distance.add(measured([&] { map_->updateDistance(vehicle, {}, report_); }).cpu);
}

Json countsJson(const KeptMapCounts& counts) {
  return {{"blocks", counts.blocks}, {"free_blocks", counts.free_blocks}};
}

FuseRunResult FuseRun::end() {
  poses_out_->close();
  map_->drawRest();
  Json json;
  json["version"] = versionJson();
  json["run"] = {{"command", "fuse"},
                 {"log", request_.log},
                 {"trajectory", log_.poses().name()},
                 {"depth", sensor_ ? "sensor" : "stereo"},
                 {"finished", finished_},
                 {"first_image_ns", log_.first()->ns},
                 {"last_image_ns", log_.last()->ns},
                 {"t_imu_minus_t_image_ns", log_.rig().camera_to_imu_shift.ns}};
  json["moments"] = {{"with_depth", moments_},
                     {"without_pose", without_pose_},
                     {"refused", refused_},
                     {"fused", fused_},
                     {"with_labels", labelled_}};
  json["map"] = writeMap(request_.out, *map_, {});
  if (continued_) {
    json["continued"] = {{"file", request_.continued}, {"held", countsJson(continued_->held)}};
  }
  if (!request_.keep.empty()) {
    json["kept"] = countsJson(writeKeptMapFile(
        request_.keep, *map_, [this](std::uint32_t epoch) { return epoch == map_->epoch(); }));
    json["kept"]["file"] = request_.keep;
  }
  const std::string problem = unreadProblem(request_.out, map_->submaps());
  if (!problem.empty()) log_.warnings().add(problem);
  json["timing"] = timingJson(times_);
  json["warnings"] = log_.warningsJson();
  writeJson(file("summary.json"), json);
  return {json, finished_, json["map"]["mesh"]["faces"].get<std::size_t>() > 0, problem};
}

}  // namespace

FuseRunResult runFuse(const FuseRequest& request, const Settings& settings) {
  return FuseRun(request, settings)();
}

}  // namespace swiftlet
