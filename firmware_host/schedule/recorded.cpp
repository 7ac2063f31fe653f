#include "firmware_host/schedule/recorded.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <set>
#include <vector>

namespace swiftlet {
namespace {

class Repeat {
 public:
  Repeat(RecordingSource& recording, Graph& graph, RecordedEfforts& efforts)
      : recording_(recording), steps_(recording.steps()), graph_(graph), efforts_(efforts) {
    graph.propagate().fix.keepAll();
    graph.track().window.keepAll();
    graph.smooth().planes.keepAll();
    if (graph.mesh() != nullptr) graph.mesh()->window.keepAll();
    if (graph.map() != nullptr) graph.map()->worlds.keepAll();
    for (const MapStep& step : steps_.map) {
      if (!step.end) mapped_.insert(step.frame);
    }
  }

  RepeatReport operator()(const RunControl& control) {
    for (bool any = true; any && why_.empty();) {
      if (control.stopped()) {
        report_.finished = false;
        return report_;
      }
      any = turns();
      if (control.progress) control.progress(2 * report_.frames);
    }
    if (why_.empty() && track_ < steps_.track.size()) {
      stop(fmt::format("the tracking input of frame {} is not in the recording", steps_.track[track_].frame));
    }
    if (why_.empty() && smooth_ < steps_.smooth.size()) {
      stop(fmt::format("the smoothing input of frame {} is not in the recording",
                       steps_.smooth[smooth_].frame));
    }
    end();
    report_.stopped_early = why_;
    return report_;
  }

 private:
  /// One pass over all nodes. Returns whether any did something.
  bool turns() {
    bool any = propagate();
    any = track() || any;
    any = smooth() || any;
    any = mesh() || any;
    any = loop() || any;
    any = map() || any;
    while (graph_.log().turn()) any = true;
    return any;
  }

  /// The recording ends or has a gap. Only the first reason is kept.
  bool stop(const std::string& why) {
    if (why_.empty()) why_ = why;
    return false;
  }

  /// Feeds the next sample to all its readers. False: there is none, or no room.
  bool feed() {
    if (fed_ >= recording_.imuCount() || !graph_.sensors().imu.hasRoom()) return false;
    if (recording_.imuNumber(fed_) != fed_ + 1) {
      return stop(fmt::format("IMU sample {} is not in the recording", fed_ + 1));
    }
    const RecordedImu& imu = recording_.imu(fed_++);
    const double now = wallSeconds();
    SensorNode& sensors = graph_.sensors();
    sensors.takeImu(imu.sample, imu.arrival, {now, now});
    if (timeline_starts_.size() < sensors.timeline()) timeline_starts_.push_back(fed_);
    return true;
  }
  /// Feeds samples up to this number and allows the reader to take them. False: not all are available yet.
  bool bring(SampleIn& samples, std::uint64_t number) {
    while (fed_ < number) {
      if (!feed()) return false;
    }
    samples.limit(number);
    return true;
  }
  /// Time line of a frame whose newest sample has this number.
  [[nodiscard]] std::uint32_t timelineAt(std::uint64_t number) const {
    const auto after = std::upper_bound(timeline_starts_.begin(), timeline_starts_.end(), number);
    return static_cast<std::uint32_t>(after - timeline_starts_.begin());
  }

  [[nodiscard]] bool image(std::size_t camera, std::uint64_t number, CameraFrame& out) {
    if (recording_.image(camera, number, out)) return true;
    return stop(fmt::format("image {} of camera {} is not in the recording", number, camera));
  }
  [[nodiscard]] bool images(const std::array<std::uint64_t, kMaxCameras>& number,
                            std::array<ImageView, kMaxCameras>& out) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      out[c] = {};
      if (number[c] == 0) continue;
      CameraFrame frame;
      if (!image(c, number[c], frame)) return false;
      out[c] = frame.image;
    }
    return true;
  }

  bool propagate() {
    PropagateNode& node = graph_.propagate();
    if (propagate_ == steps_.propagate.size()) {
      node.samples.limit(SampleIn::kNoLimit);
      return node.turn();
    }
    const PropagateStep& step = steps_.propagate[propagate_];
    if (node.samples.taken() < step.samples) return bring(node.samples, step.samples) && node.turn();
    if (!node.fix.expect(step.fix)) return false;
    ++propagate_;
    node.samples.limit(propagate_ < steps_.propagate.size() ? steps_.propagate[propagate_].samples
                                                            : SampleIn::kNoLimit);
    node.turn();
    return true;
  }

  bool track() {
    TrackNode& node = graph_.track();
    if (track_ == steps_.track.size() || !node.tracked.hasRoom()) return false;
    const TrackStep& step = steps_.track[track_];
    if (!node.window.expect(step.window)) return false;
    if (!bring(node.samples, step.samples)) {
      node.turn();  // takes surplus samples to make room
      return false;
    }
    StereoFrame frame;
    frame.stamp = step.stamp;
    frame.index = step.frame;
    frame.number = step.image;
    frame.timeline = timelineAt(step.samples);
    if (!images(step.image, frame.image)) return false;
    node.frames.tell(frame);
    node.copies.tell(mapped_.contains(step.frame));
    efforts_.track.tell(step.effort);
    node.turn();
    ++track_;
    ++report_.frames;
    return true;
  }

  bool smooth() {
    SmoothNode& node = graph_.smooth();
    const TrackMessage* message = node.tracked.front();
    if (message == nullptr || message->kind != TrackMessage::Kind::kFrame) return node.turn();
    if (smooth_ == steps_.smooth.size()) return stop("the smoother's steps end before the tracker's");
    const SmoothStep& step = steps_.smooth[smooth_];
    if (step.frame != message->tracked.index) {
      return stop(fmt::format("the smoother's step for frame {} is missing", message->tracked.index));
    }
    if (!bring(node.samples, step.samples) || !node.planes.expect(step.planes)) return false;
    efforts_.smooth.tell(step.effort);
    node.turn();
    ++smooth_;
    return true;
  }

  bool mesh() {
    MeshNode* node = graph_.mesh();
    if (node == nullptr || mesh_ == steps_.mesh.size()) return false;
    const MeshStep& step = steps_.mesh[mesh_];
    if (!node->window.expect(step.window)) return false;
    if (step.image > 0 && !image(0, step.image, mesh_image_.frame)) return false;
    mesh_image_.frame.number = step.image;
    node->image.tell(step.image > 0 ? &mesh_image_ : nullptr);
    node->turn();
    ++mesh_;
    return true;
  }

  bool loop() {
    LoopNode* node = graph_.loop();
    if (node == nullptr) return false;
    const KeyframeMessage* message = node->keyframes.front();
    if (message == nullptr) return false;
    if (loop_ == steps_.loop.size() || message->window_number < steps_.loop[loop_].window) {
      node->keyframes.pop();
      return true;
    }
    const LoopStep& step = steps_.loop[loop_];
    if (message->window_number != step.window) {
      return stop(fmt::format("keyframe {}, which loop closure used, is missing", step.frame));
    }
    keyframe_.frame = step.frame;
    keyframe_.number = step.image;
    if (!images(step.image, keyframe_.image)) return false;
    node->images.tell(atHand(step.image) ? &keyframe_ : nullptr);
    node->turn();
    ++loop_;
    return true;
  }

  bool map() {
    MappingNode* node = graph_.map();
    if (node == nullptr) return false;
    const MapMessage* message = node->frames.front();
    const bool more = map_ < steps_.map.size() && !steps_.map[map_].end;
    if (message == nullptr) return false;
    if (!more || message->frame < steps_.map[map_].frame) {
      node->frames.pop();
      return true;
    }
    const MapStep& step = steps_.map[map_];
    if (message->frame != step.frame) {
      return stop(fmt::format("frame {}, which the map used, is missing", step.frame));
    }
    if (!node->worlds.expect(step.correction)) return false;
    for (; spare_turns_ < step.spare_turns; ++spare_turns_) node->spareTurn();
    spare_turns_ = 0;
    keyframe_.frame = step.frame;
    keyframe_.number = step.image;
    if (!images(step.image, keyframe_.image)) return false;
    node->images.tell(atHand(step.image) ? &keyframe_ : nullptr);
    if (!recording_.mapScene(map_, scene_.images)) scene_.images = {};
    scene_.images.stamp = message->stamp;
    node->scenes.tell(scene_.images.empty() ? nullptr : &scene_);
    node->turn();
    ++map_;
    return true;
  }

  [[nodiscard]] static bool atHand(const std::array<std::uint64_t, kMaxCameras>& number) {
    return number != std::array<std::uint64_t, kMaxCameras>{};
  }

  /// Ends the nodes once none takes another step.
  void end() {
    SmoothNode& smooth = graph_.smooth();
    while (smooth.tracked.front() != nullptr) smooth.tracked.pop();  // tracked, never smoothed
    propagate_ = steps_.propagate.size();
    track_ = steps_.track.size();
    while (fed_ < recording_.imuCount()) {
      if (!feed()) {  // no room: let nodes without further frames take samples
        graph_.track().turn();
        smooth.turn();
        graph_.log().turn();
        if (!feed()) break;
      }
      propagate();
    }
    graph_.sensors().endInput();
    if (MappingNode* node = graph_.map(); node != nullptr && !node->done()) {
      const bool told = map_ < steps_.map.size() && steps_.map[map_].end;
      for (std::uint64_t i = 0; told && i < steps_.map[map_].spare_turns; ++i) node->spareTurn();
      if (told) static_cast<void>(node->worlds.expect(steps_.map[map_].correction));
      node->end();
    }
    // The other nodes end by themselves.
    for (bool any = true; any;) {
      any = false;
      for (Node* node : graph_.nodes()) any = (!node->done() && node->turn()) || any;
    }
  }

  RecordingSource& recording_;
  const RecordedSteps& steps_;
  Graph& graph_;
  RecordedEfforts& efforts_;
  std::size_t fed_ = 0;  ///< samples fed
  /// Number of the first sample of each time line after the first.
  std::vector<std::uint64_t> timeline_starts_;
  // Number of steps taken.
  std::size_t propagate_ = 0, track_ = 0, smooth_ = 0, mesh_ = 0, loop_ = 0, map_ = 0;
  std::set<std::uint64_t> mapped_;  ///< frames that the map took
  std::uint64_t spare_turns_ = 0;   ///< spare turns of `map` before its next step
  ImageSlot mesh_image_;
  KeyframeImages keyframe_;
  SceneSlot scene_;
  std::string why_;
  RepeatReport report_;
};

}  // namespace

RepeatReport runRecorded(RecordingSource& recording, Graph& graph, RecordedEfforts& efforts,
                         const RunControl& control) {
  return std::make_unique<Repeat>(recording, graph, efforts)->operator()(control);
}

}  // namespace swiftlet
