#pragma once
// The selected part of a log, message by message: the input of both executors.

#include <cstdint>
#include <functional>
#include <optional>

#include "drivers/recorded/log_source.hpp"
#include "drivers/recorded/track_file.hpp"
#include "firmware_host/inputs/log/scene_reader.hpp"
#include "firmware_host/inputs/log/track_feeder.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {

struct LogSection {
  double from = 0;                  ///< s after the log's first image
  std::optional<double> until;      ///< s after the log's first image; images up to and including it
  std::optional<Stamp> last_stamp;  ///< like `until`, as a stamp: nothing later is fed
};

class LogFeed {
 public:
  /// `tracks` (may be null) replaces images, which the source must not deliver then. `scenes` (may be null):
  /// depth and labels for the images of camera 0.
  LogFeed(LogSource& source, const LogSection& section, TrackReader* tracks, SceneReader* scenes = nullptr);

  enum class Next : std::uint8_t { kSample, kImage, kTracks, kEnd };
  /// The next message of the section. Images are valid as LogSource documents, tracks until the next call.
  Next next();
  [[nodiscard]] const ImuSample& sample() const { return std::get<ImuSample>(message_); }
  [[nodiscard]] const CameraFrame& image() const { return std::get<CameraFrame>(message_); }
  /// Depth and labels of image(); may be empty.
  [[nodiscard]] const SceneImages& scene() const { return scene_; }
  [[nodiscard]] const TrackedFrame& tracks() const { return *tracked_; }

  /// Images, or frames of tracks, passed so far, including those outside the section.
  [[nodiscard]] std::uint64_t taken() const { return taken_; }
  /// Time of reading and decoding, per image.
  [[nodiscard]] const StageTimes& times() const { return times_[static_cast<std::size_t>(StageId::kSource)]; }

 private:
  void noteImage(Stamp stamp);
  [[nodiscard]] bool isPast(Stamp stamp) const { return last_ && stamp > *last_; }
  [[nodiscard]] bool wantsImage(Stamp stamp) const { return section_.from <= 0 || stamp >= start(); }
  [[nodiscard]] bool wantsImu(Stamp stamp) const;
  [[nodiscard]] Stamp start() const { return *first_image_ + Duration::fromSeconds(section_.from); }
  bool nextTracks(Stamp before);

  LogSource& source_;
  LogSection section_;
  TrackFeeder tracks_;
  SceneReader* scenes_;
  SceneImages scene_;
  const TrackedFrame* tracked_ = nullptr;
  SensorMessage message_;
  bool has_message_ = false;  ///< already read; waits until earlier tracks are taken
  bool ended_ = false;
  std::optional<Stamp> first_image_;
  std::optional<Stamp> last_;
  std::uint64_t taken_ = 0;
  StageTable times_;
};

}  // namespace swiftlet
