#include "firmware_host/pipeline/reproduce.hpp"

#include <fmt/format.h>

#include <deque>
#include <limits>
#include <memory>

#include "estimator/odometry/propagation_stage.hpp"
#include "estimator/odometry/smooth_stage.hpp"
#include "estimator/odometry/track_stage.hpp"
#include "firmware_host/pipeline/arrows.hpp"
#include "mapping/loop/loop_stage.hpp"
#include "mesher/mesh_stage.hpp"

namespace swiftlet {
namespace {

constexpr Stamp kEndOfTime{std::numeric_limits<std::int64_t>::max()};

class Repeat {
 public:
  Repeat(RecordingSource& recording, const Settings& settings, RunLog& log, bool imu_states,
         const Vocabulary* vocabulary)
      : recording_(recording),
        log_(log),
        imu_states_(imu_states),
        propagation_(recording.imuNoise(), settings.odometry),
        track_(recording.rig(), recording.imuNoise(), settings.odometry),
        smooth_(recording.rig(), recording.imuNoise(), settings.odometry) {
    if (settings.mesh.enabled) {
      mesh_ = std::make_unique<MeshStage>(
          rigInUse(recording.rig(), settings.odometry), HorizonLimits{},
          MeshPlanes{settings.odometry.regularity_enabled, settings.odometry.plane_point_sigma});
    }
    if (settings.loop.enabled) {
      loop_ = std::make_unique<LoopStage>(rigInUse(recording.rig(), settings.odometry), settings.loop_stage,
                                          LoopLimits{},
                                          vocabulary != nullptr ? *vocabulary : Vocabulary::shipped());
    }
  }

  ReproduceReport operator()(const RunControl& control) {
    const RecordedSteps& steps = recording_.steps();
    for (const TrackStep& step : steps.track) {
      if (control.stopped()) {
        report_.finished = false;
        return report_;
      }
      if (!smoothUntil(step.window) || !trackFrame(step)) break;
      ++report_.frames;
      if (control.progress) control.progress(2 * report_.frames);
    }
    while (report_.stopped_early.empty() && (!tracked_.empty()) && smoothNext()) {
    }
    finish();
    return report_;
  }

 private:
  /// False, with the reason kept, where the recording ends or has a hole.
  bool stop(std::string why) {
    if (report_.stopped_early.empty()) report_.stopped_early = std::move(why);
    return false;
  }

  template <typename Take>
  bool takeSamples(std::uint64_t& taken, std::uint64_t wanted, Take&& take) {
    for (; taken < wanted; ++taken) {
      const std::size_t next = static_cast<std::size_t>(taken);
      if (next >= recording_.imuCount() || recording_.imuNumber(next) != taken + 1) {
        return stop(fmt::format("IMU sample {} is not in the recording", taken + 1));
      }
      take(recording_.imu(next).sample);
    }
    return true;
  }

  bool smoothUntil(std::uint64_t window) {
    while (windows_ < window) {
      if (!smoothNext()) return false;
    }
    return true;
  }

  bool trackFrame(const TrackStep& step) {
    StereoFrame frame;
    frame.stamp = step.stamp;
    frame.index = step.frame;
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      CameraFrame image;
      if (step.image[c] == 0) continue;
      if (!recording_.image(c, step.image[c], image)) {
        return stop(fmt::format("image {} of camera {} is not in the recording", step.image[c], c));
      }
      frame.image[c] = image.image;
      frame.number[c] = step.image[c];
    }
    if (step.window != window_taken_) {
      window_taken_ = step.window;
      track_.take(window_);
    }
    if (!takeSamples(track_samples_, step.samples, [&](const ImuSample& s) { track_.addImu(s); }))
      return false;
    FrameResult& result = tracked_.emplace_back();
    result.track_step = step;
    result.track_status = track_.step(frame, step.effort, result.tracked);
    if (!result.track_status.ok()) result.kind = TrackMessage::Kind::kFrameRefused;
    result.dropped = static_cast<int>(step.frame - next_frame_);
    next_frame_ = step.frame + 1;
    return true;
  }

  bool smoothNext() {
    if (tracked_.empty()) return stop("a window is missing that tracking predicted from");
    FrameResult& result = tracked_.front();
    if (result.kind == TrackMessage::Kind::kFrame) {
      const auto& steps = recording_.steps().smooth;
      if (smooth_steps_ >= steps.size()) return stop("the smoother's steps end before the tracker's");
      result.step = steps[smooth_steps_++];
      if (result.step.frame != result.track_step.frame) {
        return stop(fmt::format("the smoother's step for frame {} is missing", result.track_step.frame));
      }
      if (!takeSamples(smooth_samples_, result.step.samples,
                       [&](const ImuSample& s) { smooth_.addImu(s); })) {
        return false;
      }
      if (!takePlanes(result.step.planes)) return false;
      result.status = smooth_.step(result.tracked, result.step.effort, result.output);
      StateFix fix;
      smooth_.fix(fix);
      propagateUpTo(++windows_, fix);
      tellSamples(result.track_step.stamp);
      log_.onResult(result);
      smooth_.trim();
      smooth_.window(window_);
      mesh_message_.window = window_;
      mesh_message_.tracked = result.tracked;
      if (!meshNext() || !loopNext()) return false;
    } else {
      log_.onResult(result);
    }
    tracked_.pop_front();
    return true;
  }

  bool takePlanes(std::uint64_t number) {
    if (number == planes_taken_) return true;
    // `reports_` ends with the one published last.
    while (!reports_.empty() && reports_published_ - reports_.size() + 1 < number) reports_.pop_front();
    if (reports_.empty() || reports_published_ - reports_.size() + 1 != number) {
      return stop(fmt::format("plane report {} is missing, which the smoother took", number));
    }
    planes_taken_ = number;
    smooth_.take(reports_.front());
    return true;
  }

  /// The mesher took this window, or skipped it.
  bool meshNext() {
    const auto& steps = recording_.steps().mesh;
    if (!mesh_ || mesh_steps_ >= steps.size()) return true;
    if (steps[mesh_steps_].window != windows_) {
      mesh_skipped_ += mesh_message_.hasPose() ? 1U : 0U;
      return true;
    }
    const MeshStep& step = steps[mesh_steps_++];
    MeshInput input;
    input.window = &mesh_message_.window;
    input.tracks = &mesh_message_.tracked;
    CameraFrame image;
    if (step.image > 0) {
      if (!recording_.image(0, step.image, image)) {
        return stop(fmt::format("image {} of camera 0 is not in the recording", step.image));
      }
      input.image = image.image;
    }
    without_image_ += step.image == 0 ? 1 : 0;
    if (mesh_->step(input).code == StatusCode::kInvalidInput) return true;
    MeshResult& result = mesh_result_;
    result.keyframe = mesh_message_.tracked.keyframe;
    mesh_->frameMesh(result.frame);
    if (result.keyframe) mesh_->horizonMesh(result.horizon);
    mesh_->horizonMesh(local_mesh_);
    has_mesh_ = true;
    if (const PlaneReport* planes = mesh_->newPlanes()) {
      reports_.push_back(*planes);
      ++reports_published_;
    }
    result.hull.clear();
    for (const Eigen::Vector2f& corner : mesh_->hull()) static_cast<void>(result.hull.tryPushBack(corner));
    log_.onMesh(result);
    return true;
  }

  /// Loop closure took this keyframe, or missed it.
  bool loopNext() {
    const auto& steps = recording_.steps().loop;
    if (!loop_ || loop_steps_ >= steps.size() || steps[loop_steps_].window != windows_) return true;
    const LoopStep& step = steps[loop_steps_++];
    KeyframeLink link;
    smooth_.link(window_, link);
    LoopInput input;
    input.tracks = &mesh_message_.tracked;
    input.window = &window_;
    input.link = &link;
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      CameraFrame image;
      if (step.image[c] == 0) continue;
      if (!recording_.image(c, step.image[c], image)) {
        return stop(fmt::format("image {} of camera {} is not in the recording", step.image[c], c));
      }
      input.image[c] = image.image;
    }
    LoopReport report;
    static_cast<void>(loop_->step(input, LoopEffort{}, report));
    log_.onLoop(report);
    return true;
  }

  /// Fixes that propagation took: the samples before fix `number`'s taking, then the fix.
  void propagateUpTo(std::uint64_t number, const StateFix& fix) {
    const auto& steps = recording_.steps().propagate;
    if (propagate_steps_ >= steps.size() || steps[propagate_steps_].fix != number) return;
    propagate(steps[propagate_steps_++].samples);
    propagation_.take(fix);
  }

  void propagate(std::uint64_t samples) {
    NavState state;
    // A hole in the samples ends the other stages with its reason.
    for (; propagate_samples_ < samples && propagate_samples_ < recording_.imuCount(); ++propagate_samples_) {
      const Status status =
          propagation_.step(recording_.imu(static_cast<std::size_t>(propagate_samples_)).sample, &state);
      if (status.ok() && imu_states_) log_.onImuState(state);
    }
  }

  void tellSamples(Stamp until) {
    if (!log_.wantsImu()) return;
    while (told_samples_ < recording_.imuCount() && recording_.imu(told_samples_).sample.stamp <= until) {
      log_.onImu(recording_.imu(told_samples_++).sample);
    }
  }

  void finish() {
    propagate(recording_.imuCount());
    tellSamples(kEndOfTime);
    FrameResult result;
    result.kind = TrackMessage::Kind::kEnd;
    result.track_step.stamp = kEndOfTime;
    smooth_.finish(result.output);
    log_.onResult(result);
    if (has_mesh_) log_.onLocalMesh(local_mesh_);
    if (loop_) log_.keepLoops(*loop_);
    RunStatistics& statistics = log_.statistics();
    if (mesh_) {
      statistics.mesh = {mesh_->counters(), mesh_->horizon().counters(), mesh_skipped_, without_image_};
    }
    statistics.imu_samples = recording_.imuCount();
    for (const TrackStep& step : recording_.steps().track) {
      for (const std::uint64_t image : step.image) statistics.images += image > 0 ? 1U : 0U;
    }
  }

  RecordingSource& recording_;
  RunLog& log_;
  bool imu_states_;
  PropagationStage propagation_;
  TrackStage track_;
  SmoothStage smooth_;
  std::unique_ptr<MeshStage> mesh_;  ///< null: switched off
  std::deque<PlaneReport> reports_;  ///< not older than the one that the smoother took last
  std::uint64_t reports_published_ = 0;
  std::uint64_t planes_taken_ = 0;
  MeshMessage mesh_message_;
  MeshResult mesh_result_;
  std::unique_ptr<LoopStage> loop_;  ///< null: switched off
  std::size_t loop_steps_ = 0;
  std::size_t mesh_steps_ = 0;
  std::uint64_t without_image_ = 0;
  std::uint64_t mesh_skipped_ = 0;
  LocalMesh local_mesh_;   ///< newest, over the horizon
  bool has_mesh_ = false;  ///< it is one
  SmoothedWindow window_;
  std::uint64_t windows_ = 0;  ///< published so far; window_ is the last of them
  std::uint64_t window_taken_ = 0;
  std::deque<FrameResult> tracked_;
  std::size_t smooth_steps_ = 0;
  std::size_t propagate_steps_ = 0;
  std::uint64_t track_samples_ = 0, smooth_samples_ = 0, propagate_samples_ = 0;
  std::size_t told_samples_ = 0;
  std::uint64_t next_frame_ = 0;
  ReproduceReport report_;
};

}  // namespace

ReproduceReport reproduce(RecordingSource& recording, const Settings& settings, RunLog& log, bool imu_states,
                          const RunControl& control, const Vocabulary* vocabulary) {
  return std::make_unique<Repeat>(recording, settings, log, imu_states, vocabulary)->operator()(control);
}

}  // namespace swiftlet
