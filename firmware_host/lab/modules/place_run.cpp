#include "firmware_host/lab/modules/place_run.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "estimator/core/units.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"
#include "firmware_host/lab/modules/place_images.hpp"
#include "firmware_host/lab/modules/place_tally.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/progress.hpp"
#include "mapping/place/feature_depth.hpp"
#include "mapping/place/loop_verification.hpp"
#include "mapping/place/place_stage.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

PlaceDatabaseSettings databaseSettings(const PlaceRequest& request, const Settings& settings) {
  PlaceDatabaseSettings out;
  out.keyframes = request.keyframes;
  out.exclude = request.exclude;
  out.candidates = static_cast<std::size_t>(request.candidates);
  out.min_relative = static_cast<float>(settings.loop_stage.min_similarity);
  return out;
}

Vocabulary vocabularyOf(const PlaceRequest& request, const Settings& settings) {
  const std::string& file = request.vocabulary.empty() ? settings.loop.vocabulary : request.vocabulary;
  return file.empty() ? Vocabulary::shipped() : readVocabulary(file);
}

/// The stages and their data, created when the image size is known.
struct Stages {
  Stages(const Rig& rig, const Vocabulary& vocabulary, const PlaceDatabaseSettings& database, bool verify)
      : place(rig.camera[0], vocabulary, {}, database), kept(place.database().capacity()) {
    if (!verify) return;
    depth = std::make_unique<StereoDepth>(rig);
    verifier = std::make_unique<LoopVerifier>(rig);
  }

  struct Kept {
    PlaceKeyframe keyframe;
    SE3 T_world_body;
  };
  PlaceStage place;
  std::vector<Kept> kept;  ///< indexed by the database's slots
  std::unique_ptr<StereoDepth> depth;
  std::unique_ptr<LoopVerifier> verifier;  ///< null: retrieval only
  PlaceStep step;
  PlaceKeyframe keyframe;
  LoopVerification verification;
};

class PlaceRun {
 public:
  PlaceRun(const PlaceRequest& request, const Settings& settings)
      : request_(request), settings_(settings), vocabulary_(vocabularyOf(request, settings)) {}

  PlaceRunResult operator()() {
    refuseRunIn(request_.out, RunKind::kPlaceList);
    if (isPlainImageFolder(request_.log)) {
      runFolder();
    } else {
      runLog();
    }
    if (!rows_) failWithoutPose();
    return end();
  }

 private:
  void runFolder();
  void runLog();
  void takePoses(GivenPoses poses, LogWarnings& warnings);
  void take(const StereoFrame& frame, const Rig& rig, bool all);
  void see(const StereoFrame& frame, const GivenPoses::Pose& pose, const Rig& rig);
  void judge(const PlaceCandidate& candidate, Stamp stamp, const SE3& T_world_body);
  [[nodiscard]] std::string verifiedText(const SE3& truth, bool judged);
  [[noreturn]] void failWithoutPose() const;
  PlaceRunResult end();

  const PlaceRequest& request_;
  const Settings& settings_;
  const Vocabulary vocabulary_;
  Json warnings_ = Json::array();
  std::optional<GivenPoses> poses_;
  std::unique_ptr<Stages> stages_;
  std::optional<RunClaim> claim_;
  std::optional<LineFile> rows_;
  std::optional<GivenPoses::Pose> last_;
  Stamp last_stamp_, first_image_, last_image_;
  bool verifies_ = false;
  bool finished_ = true;
  std::uint64_t images_ = 0, without_pose_ = 0, without_features_ = 0;
  PlaceTally tally_;
};

void PlaceRun::takePoses(GivenPoses poses, LogWarnings& warnings) {
  poses_ = std::move(poses);
  poses_->warnOfJumps("pairs across a jump are not judged", warnings);
}

void PlaceRun::runFolder() {
  if (request_.trajectory.empty()) {
    throw InputError(request_.log, 0, "", "a folder of images has no poses", "Give them with --trajectory");
  }
  if (!request_.calibration.empty()) {
    throw InputError("--calibration", 0, "", "a plain folder of images has no depth for verification",
                     "Omit the calibration (retrieval only), or give a log with two cameras");
  }
  LogCounters counters;
  LogWarnings warnings;
  const Trajectory trajectory = readTrajectory(request_.trajectory, counters, warnings);
  const std::vector<PlaceImage> files = stampedImages(request_.log, trajectory);
  takePoses({{request_.trajectory, trajectory}, Duration::fromSeconds(request_.max_gap)}, warnings);
  warnAll(warnings.lines());
  warnings_ = warnings.lines();
  ImageFile image;
  Progress progress("recognizing places", request_.show_progress ? files.size() : 0);
  std::optional<ImageSize> size;
  Rig rig;
  for (std::size_t i = 0; i < files.size(); ++i) {
    finished_ = !request_.stopped();
    if (!finished_) break;
    progress.update(i);
    if (!image.read(files[i].path)) {
      throw InputError(files[i].path, 0, "", "not a readable image", "Remove it from the folder");
    }
    StereoFrame frame;
    frame.stamp = files[i].stamp;
    frame.image[0] = image.view();
    const ImageSize found{frame.image[0].width, frame.image[0].height};
    if (!size) rig = pictureRig(found);
    if (size && found != *size) {
      throw InputError(files[i].path, 0, "",
                       fmt::format("{} x {} pixels, the first image has {} x {}", found.width, found.height,
                                   size->width, size->height),
                       "Use images of one size");
    }
    size = found;
    take(frame, rig, true);
  }
  progress.finish();
}

void PlaceRun::runLog() {
  PosedLogRequest request = request_;
  request.mono = !settings_.odometry.use_stereo;
  PosedLog log(request, settings_);
  if (log.hasTracks()) {
    throw InputError(request_.log, 0, "", "the log holds feature tracks but no images",
                     "Give a log with images");
  }
  verifies_ = log.rig().camera_count > 1;
  takePoses(log.poses(), log.warnings());
  finished_ = log.run("place", {[&](const StereoFrame& frame) { take(frame, log.rig(), false); }, {}});
  warnings_ = log.warningsJson();
}

/// `all`: also take the image if it has not moved.
void PlaceRun::take(const StereoFrame& frame, const Rig& rig, bool all) {
  if (images_++ == 0) first_image_ = frame.stamp;
  last_image_ = frame.stamp;
  const auto pose = poses_->at(frame.stamp);
  if (!pose || frame.image[0].empty()) {
    ++without_pose_;
    return;
  }
  if (last_ && !all && pose->piece == last_->piece) {
    const SE3 moved = last_->T_world_body.inverse() * pose->T_world_body;
    const bool enough = moved.translation.norm() >= request_.min_distance ||
                        logSo3(moved.rotation).norm() * kToDegrees >= request_.min_turn_deg ||
                        (frame.stamp - last_stamp_).seconds() >= request_.min_seconds;
    if (!enough) return;
  }
  last_ = pose;
  last_stamp_ = frame.stamp;
  see(frame, *pose, rig);
}

void PlaceRun::see(const StereoFrame& frame, const GivenPoses::Pose& pose, const Rig& rig) {
  if (!stages_) {
    stages_ = std::make_unique<Stages>(rig, vocabulary_, databaseSettings(request_, settings_), verifies_);
  }
  if (!rows_) {
    claim_.emplace(request_.out, RunKind::kPlaceList, false);
    rows_.emplace((std::filesystem::path(request_.out) / "places.csv").string());
    rows_->write(placeColumns());
  }
  TrackedFrame tracked;
  tracked.stamp = frame.stamp;
  tracked.index = images_;
  Stages& s = *stages_;
  const auto epoch = static_cast<std::uint32_t>(pose.piece);
  Status status;
  const Spent recognizing =
      measured([&] { status = s.place.step(frame.image[0], tracked, epoch, s.keyframe, s.step); });
  tally_.recognition.add(recognizing.cpu);
  if (!status.ok()) {
    ++without_features_;
    return;
  }
  std::size_t found = 0;
  // A pair with a missing image has no depths, so its candidates cannot be verified.
  if (s.depth && !frame.image[1].empty()) {
    static_cast<void>(s.depth->fill(frame.image[0], frame.image[1], s.keyframe, found));
  }
  tally_.begin(frame.stamp, epoch, pose.T_world_body);
  for (const PlaceCandidate& candidate : s.step.query.candidates) {
    judge(candidate, frame.stamp, pose.T_world_body);
  }
  tally_.end(request_.exclude);
  if (s.step.slot != PlaceDatabase::kNoSlot) s.kept[s.step.slot] = {s.keyframe, pose.T_world_body};
}

void PlaceRun::judge(const PlaceCandidate& candidate, Stamp stamp, const SE3& T_world_body) {
  Stages& s = *stages_;
  const Stages::Kept& old = s.kept[candidate.slot];
  const bool judged = old.keyframe.epoch == s.keyframe.epoch;
  const SE3 truth = old.T_world_body.inverse() * T_world_body;
  std::string text = fmt::format("{},{},{:.6g},{:.6g},{},", stamp.ns, candidate.stamp.ns, candidate.score,
                                 candidate.relative, candidate.consistent);
  text += judged ? fmt::format("{:.6g},{:.6g}", truth.translation.norm(),
                               logSo3(truth.rotation).norm() * kToDegrees)
                 : ",";
  tally_.addCandidate(truth, judged);
  if (s.verifier) {
    Status status;
    const Spent spent =
        measured([&] { status = s.verifier->verify(old.keyframe, s.keyframe, {}, 1.0, s.verification); });
    tally_.verification.add(spent.cpu);
    tally_.addVerification(s.verification, truth, judged);
    text += verificationText(s.verification, truth, judged);
  }
  rows_->write(text);
}

void PlaceRun::failWithoutPose() const {
  if (images_ == 0) throw InputError(request_.log, 0, "", "has no image", "Give a log with images");
  poses_->failWithout("image with features", first_image_, last_image_);
}

PlaceRunResult PlaceRun::end() {
  Json json;
  json["version"] = versionJson();
  json["run"] = {{"command", "place"},           {"input", request_.log},
                 {"trajectory", poses_->name()}, {"vocabulary_words", vocabulary_.words()},
                 {"verified", verifies_},        {"finished", finished_}};
  const PlaceDatabaseCounts& counts = stages_->place.database().counts();
  json["images"] = {{"seen", images_},
                    {"without_pose", without_pose_},
                    {"without_features", without_features_},
                    {"keyframes", counts.added},
                    {"forgotten", counts.removed}};
  tally_.write(json);
  json["warnings"] = warnings_;
  writeJson((std::filesystem::path(request_.out) / "summary.json").string(), json);
  return {json, finished_};
}

}  // namespace

PlaceRunResult runPlace(const PlaceRequest& request, const Settings& settings) {
  return PlaceRun(request, settings)();
}

}  // namespace swiftlet
