#include "firmware_host/lab/modules/place_run.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "drivers/recorded/open_log.hpp"
#include "estimator/core/units.hpp"
#include "estimator/geometry/so3.hpp"
#include "estimator/odometry/odometry_inputs.hpp"
#include "estimator/odometry/pairing.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/inputs/log/log_feed.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"
#include "firmware_host/lab/modules/given_poses.hpp"
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

LogOptions logOptions(const PlaceRequest& request, const Settings& settings) {
  LogOptions options;
  options.calibration = request.calibration;
  options.imu_calibration = request.imu_calibration;
  options.calibration_options.accept_unusual_rig = settings.calibration.accept_unusual_rig;
  options.mono = !settings.odometry.use_stereo;
  return options;
}

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

/// What the stages need beside an image, made when its size is known.
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
  std::vector<Kept> kept;  ///< by the database's slots
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
    if (isPlainImageFolder(request_.input)) {
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
  void takePoses(Trajectory trajectory);
  [[nodiscard]] bool stopped();
  void take(const StereoFrame& frame, const Rig& rig, bool all);
  void see(const StereoFrame& frame, const GivenPoses::Pose& pose, const Rig& rig);
  void judge(const PlaceCandidate& candidate, Stamp stamp, const SE3& T_world_body);
  [[nodiscard]] std::string verifiedText(const SE3& truth, bool judged);
  [[noreturn]] void failWithoutPose() const;
  PlaceRunResult end();

  const PlaceRequest& request_;
  const Settings& settings_;
  const Vocabulary vocabulary_;
  LogWarnings warnings_;
  std::vector<std::string> log_warnings_;
  std::string poses_name_;
  std::optional<GivenPoses> poses_;
  std::unique_ptr<Stages> stages_;
  std::optional<LineFile> rows_;
  std::optional<GivenPoses::Pose> last_;
  Stamp last_stamp_;
  bool verifies_ = false;
  bool finished_ = true;
  std::uint64_t images_ = 0, without_pose_ = 0, without_features_ = 0;
  PlaceTally tally_;
};

bool PlaceRun::stopped() {
  if (request_.stop != nullptr && request_.stop->load(std::memory_order_relaxed)) finished_ = false;
  return !finished_;
}

void PlaceRun::takePoses(Trajectory trajectory) {
  poses_.emplace(std::move(trajectory), Duration::fromSeconds(request_.max_gap));
  if (poses_->jumps() > 0) {
    warnings_.add(fmt::format("{}: the poses jump {} times, first at {}: pairs across a jump are not judged",
                              poses_name_, poses_->jumps(), formatSeconds(poses_->firstJump())));
  }
  warnAll(warnings_.lines());
}

void PlaceRun::runFolder() {
  if (request_.trajectory.empty()) {
    throw InputError(request_.input, 0, "", "a folder of images has no poses", "Give them with --trajectory");
  }
  if (!request_.calibration.empty()) {
    throw InputError("--calibration", 0, "", "a plain folder of images gives no depths to verify with",
                     "Leave the calibration out (retrieval only), or give a log with two cameras");
  }
  LogCounters counters;
  poses_name_ = request_.trajectory;
  const Trajectory trajectory = readTrajectory(request_.trajectory, counters, warnings_);
  const std::vector<PlaceImage> files = stampedImages(request_.input, trajectory);
  takePoses(trajectory);
  ImageFile image;
  Progress progress("place", request_.show_progress ? files.size() : 0);
  std::optional<ImageSize> size;
  Rig rig;
  for (std::size_t i = 0; i < files.size() && !stopped(); ++i) {
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
                       "All images of a folder must have one size");
    }
    size = found;
    take(frame, rig, true);
  }
  progress.finish();
}

void PlaceRun::runLog() {
  const std::unique_ptr<LogSource> source = openLog(request_.input, logOptions(request_, settings_));
  if (!source->trackFile().empty()) {
    throw InputError(request_.input, 0, "", "the log holds feature tracks, no images",
                     "Places are recognized by images");
  }
  const Rig rig = rigInUse(source->rig(), settings_.odometry);
  verifies_ = rig.camera_count > 1;
  NamedTrajectory trajectory = openTrajectory(request_.trajectory, request_.input, *source, warnings_);
  poses_name_ = trajectory.name;
  takePoses(std::move(trajectory.poses));
  LogFeed feed(*source, {}, nullptr);
  PairingSettings pairing_settings;
  pairing_settings.cameras = rig.camera_count;
  pairing_settings.tolerance = Duration::fromSeconds(settings_.pairing.tolerance_ms * 1e-3);
  pairing_settings.patience = Duration::fromSeconds(settings_.pairing.patience_ms * 1e-3);
  Pairing pairing(pairing_settings);
  Progress progress("place", request_.show_progress ? source->imageCount() : 0);
  StereoFrame frame;
  for (LogFeed::Next next = feed.next(); next != LogFeed::Next::kEnd && !stopped(); next = feed.next()) {
    const bool paired = next == LogFeed::Next::kImage ? pairing.push(feed.image(), frame).ok()
                                                      : pairing.expire(feed.sample().stamp, frame).ok();
    if (paired) take(frame, rig, false);
    progress.update(feed.taken());
  }
  if (finished_ && pairing.flush(frame).ok()) take(frame, rig, false);
  progress.finish();
  log_warnings_ = source->warnings();
  warnAll(log_warnings_);
}

/// `all`: whether it has moved or not.
void PlaceRun::take(const StereoFrame& frame, const Rig& rig, bool all) {
  ++images_;
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
    std::filesystem::create_directories(request_.out);
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
  // A pair whose other image is missing has no depths: candidates then fail for want of them.
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
  throw InputError(poses_name_, 0, "timestamp",
                   fmt::format("none of the {} images has a pose and features: the poses go from {} to {}",
                               images_, formatSeconds(poses_->begin()), formatSeconds(poses_->end())),
                   fmt::format("Both need stamps of one clock, and poses at most --max-gap={:g} s apart",
                               request_.max_gap));
}

PlaceRunResult PlaceRun::end() {
  Json json;
  json["version"] = versionJson();
  json["run"] = {{"command", "place"},        {"input", request_.input},
                 {"trajectory", poses_name_}, {"vocabulary_words", vocabulary_.words()},
                 {"verified", verifies_},     {"finished", finished_}};
  const PlaceDatabaseCounts& counts = stages_->place.database().counts();
  json["images"] = {{"seen", images_},
                    {"without_pose", without_pose_},
                    {"without_features", without_features_},
                    {"keyframes", counts.added},
                    {"forgotten", counts.removed}};
  tally_.write(json);
  json["warnings"] = log_warnings_;
  for (const std::string& line : warnings_.lines()) json["warnings"].push_back(line);
  writeJson((std::filesystem::path(request_.out) / "summary.json").string(), json);
  return {json, finished_};
}

}  // namespace

PlaceRunResult runPlace(const PlaceRequest& request, const Settings& settings) {
  return PlaceRun(request, settings)();
}

}  // namespace swiftlet
