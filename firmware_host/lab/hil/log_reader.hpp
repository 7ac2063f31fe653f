#pragma once
// Reads and decodes a log ahead on its own thread, so that playing is not delayed: samples, and images of
// each camera, in order. Host side: it locks and allocates.

#include <array>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "drivers/recorded/log_source.hpp"
#include "estimator/core/limits.hpp"

namespace swiftlet {

class LogReader {
 public:
  struct Image {
    Stamp stamp;
    int width = 0;
    int height = 0;
    std::vector<std::uint8_t> pixels;
  };

  explicit LogReader(LogSource& source);
  ~LogReader();
  LogReader(const LogReader&) = delete;
  LogReader& operator=(const LogReader&) = delete;

  /// Waits for the next one; empty at the end. Rethrows the error that ended reading.
  std::optional<ImuSample> sample();
  std::optional<Image> image(std::size_t camera);

 private:
  /// Half a minute of samples at 1 kHz: more than a log's images ever lag behind its samples.
  static constexpr std::size_t kSamplesAhead = 30'000;
  static constexpr std::size_t kImagesAhead = 64;

  void read();
  void keep(const SensorMessage& message);
  [[nodiscard]] bool hasRoom() const;
  template <typename T>
  std::optional<T> take(std::deque<T>& queue);

  LogSource& source_;
  std::mutex mutex_;
  std::condition_variable came_, left_;
  std::deque<ImuSample> samples_;
  std::array<std::deque<Image>, kMaxCameras> images_;
  bool ended_ = false;
  bool stop_ = false;
  std::exception_ptr error_;
  std::thread thread_;
};

}  // namespace swiftlet
