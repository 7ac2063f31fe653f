#include "firmware_host/lab/modules/posed_log.hpp"

#include <fmt/format.h>

#include "drivers/recorded/open_log.hpp"
#include "drivers/recorded/track_file.hpp"
#include "estimator/odometry/pairing.hpp"
#include "firmware_host/realtime/console.hpp"
#include "firmware_host/realtime/progress.hpp"

namespace swiftlet {

PosedLog::PosedLog(const PosedLogRequest& request, const Settings& settings)
    : request_(request),
      source_(openLog(request.log, request.options(settings))),
      poses_(openTrajectory(request.trajectory, request.log, *source_, warnings_),
             Duration::fromSeconds(request.max_gap)) {
  pairing_ = settings.pairing.of(rig().camera_count);
}

bool PosedLog::run(const char* what, const Handlers& handlers) {
  warnAll(source_->warnings());
  warnAll(warnings_.lines());
  std::optional<TrackReader> tracks;
  std::size_t steps = source_->imageCount();
  if (hasTracks() && handlers.tracks) {
    steps = surveyTrackFile(source_->trackFile()).frames;
    tracks.emplace(source_->trackFile());
  }
  LogFeed feed(*source_, request_.section(), tracks ? &*tracks : nullptr);
  Pairing pairing(pairing_);
  Progress progress(what, request_.show_progress ? steps : 0);
  StereoFrame frame;
  for (LogFeed::Next next = feed.next(); next != LogFeed::Next::kEnd; next = feed.next()) {
    if (request_.stopped()) {
      progress.finish();
      return false;
    }
    if (next == LogFeed::Next::kTracks) {
      if (!first_) first_ = feed.tracks().stamp;
      last_ = feed.tracks().stamp;
      handlers.tracks(feed.tracks());
    } else if (next == LogFeed::Next::kImage) {
      if (pairing.push(feed.image(), frame).ok()) give(handlers, frame);
    } else {
      while (pairing.expire(feed.sample().stamp, frame).ok()) give(handlers, frame);
    }
    progress.update(feed.taken());
  }
  while (pairing.flush(frame).ok()) give(handlers, frame);
  progress.finish();
  return true;
}

void PosedLog::give(const Handlers& handlers, const StereoFrame& frame) {
  if (!first_) first_ = frame.stamp;
  last_ = frame.stamp;
  handlers.frame(frame);
}

void PosedLog::failWithoutPose(const char* what, bool any) const {
  if (!first_ || !any) {
    throw InputError(request_.log, 0, "", fmt::format("no {} in the selected part of the log", what),
                     "Give another --from or --until");
  }
  poses_.failWithout(what, *first_, *last_);
}

nlohmann::ordered_json PosedLog::warningsJson() const {
  nlohmann::ordered_json json = source_->warnings();
  for (const std::string& line : warnings_.lines()) json.push_back(line);
  return json;
}

}  // namespace swiftlet
