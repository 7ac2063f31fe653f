#include "firmware_host/pipeline/lockstep.hpp"

#include <limits>

#include "firmware_host/pipeline/track_feeder.hpp"

namespace swiftlet {
namespace {

constexpr Stamp kEndOfTime{std::numeric_limits<std::int64_t>::max()};
/// A run that starts within a log gets this much of the IMU before its first image.
constexpr Duration kImuLead = Duration::fromMilliseconds(100);

/// Which part of the stream is wanted. The log's first image sets the zero of `from` and `until`.
class Section {
 public:
  explicit Section(const ReplayPlan& plan) : plan_(plan), last_(plan.last_stamp) {}

  void noteImage(Stamp stamp) {
    if (first_image_) return;
    first_image_ = stamp;
    if (!plan_.until) return;
    const Stamp until = stamp + Duration::fromSeconds(*plan_.until);
    last_ = last_ && *last_ < until ? *last_ : until;
  }
  [[nodiscard]] bool isPast(Stamp stamp) const { return last_ && stamp > *last_; }
  [[nodiscard]] bool wantsImage(Stamp stamp) const { return plan_.from <= 0 || stamp >= start(); }
  [[nodiscard]] bool wantsImu(Stamp stamp) const {
    return plan_.from <= 0 || (first_image_ && stamp >= start() - kImuLead);
  }

 private:
  [[nodiscard]] Stamp start() const { return *first_image_ + Duration::fromSeconds(plan_.from); }

  const ReplayPlan& plan_;
  std::optional<Stamp> first_image_;
  std::optional<Stamp> last_;
};

}  // namespace

bool runLockstep(LogSource& source, Wiring& wiring, const ReplayPlan& plan) {
  Section section(plan);
  TrackFeeder tracks(plan.tracks);
  std::uint64_t taken = 0;
  const auto pass_tracks_before = [&](Stamp stamp) {
    while (const TrackedFrame* frame = tracks.dueBefore(stamp)) {
      section.noteImage(frame->stamp);
      if (!section.isPast(frame->stamp) && section.wantsImage(frame->stamp)) wiring.feedTracks(*frame);
      tracks.take();
      ++taken;
      if (plan.progress) plan.progress(taken);
    }
  };
  SensorMessage message;
  bool stopped = false;
  while (true) {
    stopped = plan.stop != nullptr && plan.stop->load(std::memory_order_relaxed);
    if (stopped) break;
    bool more = false;
    const Spent reading = measured([&] { more = source.next(message); });
    if (!more) break;
    if (const auto* sample = std::get_if<ImuSample>(&message)) {
      if (section.isPast(sample->stamp)) break;
      pass_tracks_before(sample->stamp);
      if (section.wantsImu(sample->stamp)) wiring.feedImu(*sample);
      continue;
    }
    const auto& frame = std::get<CameraFrame>(message);
    addTime(wiring.statistics().times, StageId::kSource, reading);
    section.noteImage(frame.stamp);
    if (section.isPast(frame.stamp)) break;
    if (section.wantsImage(frame.stamp)) wiring.feedImage(frame);
    ++taken;
    if (plan.progress) plan.progress(taken);
  }
  if (!stopped) pass_tracks_before(kEndOfTime);
  wiring.finish();
  return !stopped;
}

}  // namespace swiftlet
