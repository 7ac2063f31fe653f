#include "firmware_host/inputs/log/log_feed.hpp"

#include <limits>

namespace swiftlet {
namespace {

constexpr Stamp kEndOfTime{std::numeric_limits<std::int64_t>::max()};
/// IMU samples this long before the first image are fed to a run that starts within a log.
constexpr Duration kImuLead = Duration::fromMilliseconds(100);

}  // namespace

LogFeed::LogFeed(LogSource& source, const LogSection& section, TrackReader* tracks, SceneReader* scenes)
    : source_(source), section_(section), tracks_(tracks), scenes_(scenes), last_(section.last_stamp) {}

void LogFeed::noteImage(Stamp stamp) {
  if (first_image_) return;
  first_image_ = stamp;
  if (!section_.until) return;
  const Stamp until = stamp + Duration::fromSeconds(*section_.until);
  last_ = last_ && *last_ < until ? *last_ : until;
}

bool LogFeed::wantsImu(Stamp stamp) const {
  return section_.from <= 0 || (first_image_ && stamp >= start() - kImuLead);
}

bool LogFeed::nextTracks(Stamp before) {
  if (tracked_ != nullptr) tracks_.take();
  tracked_ = nullptr;
  while (const TrackedFrame* frame = tracks_.dueBefore(before)) {
    noteImage(frame->stamp);
    ++taken_;
    if (!isPast(frame->stamp) && wantsImage(frame->stamp)) {
      tracked_ = frame;
      return true;
    }
    tracks_.take();
  }
  return false;
}

LogFeed::Next LogFeed::next() {
  while (!ended_) {
    if (!has_message_) {
      Spent reading;
      const auto read = [&] { ended_ = !source_.next(message_); };
      // Samples are many and in memory: reading the clock would take longer than reading a sample.
      if (source_.imageIsNext()) {
        reading = measured(read);
      } else {
        read();
      }
      if (ended_) break;
      has_message_ = true;
      if (std::holds_alternative<CameraFrame>(message_)) addTime(times_, StageId::kSource, reading);
    }
    if (const auto* sample = std::get_if<ImuSample>(&message_)) {
      if (isPast(sample->stamp)) break;
      if (nextTracks(sample->stamp - source_.calibration().rig.sampleLead())) return Next::kTracks;
      has_message_ = false;
      if (wantsImu(sample->stamp)) return Next::kSample;
      continue;
    }
    const Stamp stamp = image().stamp;
    noteImage(stamp);
    if (isPast(stamp)) break;
    has_message_ = false;
    ++taken_;
    if (!wantsImage(stamp)) continue;
    scene_ = scenes_ != nullptr && image().camera == 0 ? scenes_->at(stamp) : SceneImages{};
    return Next::kImage;
  }
  ended_ = true;
  return nextTracks(kEndOfTime) ? Next::kTracks : Next::kEnd;
}

}  // namespace swiftlet
