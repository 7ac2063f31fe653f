#include "firmware_host/lab/hil/log_reader.hpp"

#include <algorithm>

#include "firmware_host/interfaces/packed_copy.hpp"

namespace swiftlet {

LogReader::LogReader(LogSource& source) : source_(source), thread_([this] { read(); }) {}

LogReader::~LogReader() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  left_.notify_all();
  thread_.join();
}

std::optional<ImuSample> LogReader::sample() { return take(samples_); }
std::optional<LogReader::Image> LogReader::image(std::size_t camera) { return take(images_.at(camera)); }

template <typename T>
std::optional<T> LogReader::take(std::deque<T>& queue) {
  std::unique_lock lock(mutex_);
  came_.wait(lock, [&] { return !queue.empty() || ended_; });
  if (queue.empty()) {
    if (error_) std::rethrow_exception(error_);
    return std::nullopt;
  }
  std::optional<T> first = std::move(queue.front());
  queue.pop_front();
  lock.unlock();
  left_.notify_one();
  return first;
}

bool LogReader::hasRoom() const {
  return samples_.size() < kSamplesAhead &&
         std::ranges::all_of(images_, [](const auto& queue) { return queue.size() < kImagesAhead; });
}

void LogReader::read() {
  try {
    SensorMessage message;
    while (source_.next(message)) {
      std::unique_lock lock(mutex_);
      left_.wait(lock, [this] { return hasRoom() || stop_; });
      if (stop_) return;
      keep(message);
      lock.unlock();
      came_.notify_one();
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    error_ = std::current_exception();
  }
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  came_.notify_all();
}

void LogReader::keep(const SensorMessage& message) {
  if (const auto* sample = std::get_if<ImuSample>(&message)) {
    samples_.push_back(*sample);
    return;
  }
  const auto& frame = std::get<CameraFrame>(message);
  Image image{frame.stamp, frame.image.width, frame.image.height, {}};
  image.pixels.resize(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  packedCopy(frame.image, image.pixels.data());
  images_.at(frame.camera).push_back(std::move(image));
}

}  // namespace swiftlet
