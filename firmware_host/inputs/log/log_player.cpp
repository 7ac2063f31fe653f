#include "firmware_host/inputs/log/log_player.hpp"

#include <algorithm>

#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {

std::vector<SensorInput::Thread> LogPlayer::threads(SensorSink& sink, const RunControl& control) {
  return {{"sensor", Level::kSensor, [this, &sink, &control] { play(sink, control); }},
          {"source", Level::kAhead, [this, &control] { read(control); }}};
}

void LogPlayer::finish() {
  if (read_error_) std::rethrow_exception(read_error_);
}

void LogPlayer::read(const RunControl& control) {
  try {
    std::uint64_t images = 0;
    for (;;) {
      while (ahead_.size() >= kReadAhead ||
             images - images_out_.load(std::memory_order_acquire) >= kImagesAhead) {
        if (control.stopped()) break;
        sleepFor(Duration::fromMilliseconds(1));
      }
      const LogFeed::Next next = control.stopped() ? LogFeed::Next::kEnd : feed_.next();
      if (next == LogFeed::Next::kEnd) break;
      Ahead* message = ahead_.beginPush();
      message->kind = next == LogFeed::Next::kSample ? Kind::kSample : Kind::kImage;
      message->taken = feed_.taken();
      if (message->kind == Kind::kSample) {
        message->sample = feed_.sample();
      } else {
        message->image = feed_.image();
        message->scene = feed_.scene();
        ++images;
      }
      ahead_.commitPush();
    }
  } catch (...) {
    read_error_ = std::current_exception();
  }
  read_done_.store(true, std::memory_order_release);
}

void LogPlayer::play(SensorSink& sink, const RunControl& control) {
  for (;;) {
    const bool done = read_done_.load(std::memory_order_acquire);
    Ahead* message = ahead_.front();
    if (message == nullptr) {
      if (done) {
        sink.expectEnd();
        break;
      }
      sleepFor(Duration::fromMilliseconds(1));
      continue;
    }
    if (control.stopped()) break;
    const Stamp arrival = message->kind == Kind::kSample ? message->sample.stamp : message->image.arrival;
    const Stamp stamp = message->kind == Kind::kSample ? message->sample.stamp : message->image.stamp;
    if (!begun_) begin(arrival);
    const double due = hostTime(arrival);
    if (due > wallSeconds()) sleepUntil(due);
    const HostTimes host{hostTime(stamp), wallSeconds()};
    lateness_.add(std::max(host.arrival - due, 0.0));
    if (message->kind == Kind::kSample) {
      sink.takeImu(message->sample, arrival, host);
    } else {
      sink.takeScene(message->scene);
      sink.takeImage(message->image, host);
      images_out_.fetch_add(1, std::memory_order_release);
      taken_.store(message->taken, std::memory_order_relaxed);
    }
    ahead_.pop();
  }
}

void LogPlayer::begin(Stamp first) {
  begun_ = true;
  first_ = first;
  // Lets the other threads fall asleep first.
  constexpr double kLead = 0.05;  // s
  zero_ = wallSeconds() + kLead;
  to_host_ns_.store((Duration::fromSeconds(zero_) - (first - Stamp{})).ns, std::memory_order_relaxed);
}

}  // namespace swiftlet
