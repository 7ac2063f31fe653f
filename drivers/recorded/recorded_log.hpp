#pragma once
// Common base of all stored logs: samples and image entries are listed in order, images are fetched one at a
// time into a small pool. A format (ASL folder, bag) fills the lists and implements fetch(). Memory: 56 bytes
// per sample, about 100 per image entry, kImageSlots images per camera.

#include <array>
#include <string>
#include <vector>

#include "drivers/image/image_decoder.hpp"
#include "drivers/recorded/log_source.hpp"

namespace swiftlet {

class RecordedLog : public LogSource {
 public:
  [[nodiscard]] const Calibration& calibration() const override { return calibration_; }
  bool next(SensorMessage& message) override;
  void seek(Stamp stamp) override;
  [[nodiscard]] bool imageIsNext() const override;
  [[nodiscard]] std::size_t imageCount() const override { return images_.size(); }
  [[nodiscard]] std::size_t frameCount() const override { return frame_count_; }
  [[nodiscard]] std::optional<std::pair<Stamp, Stamp>> sampleSpan() const override {
    if (samples_.empty()) return std::nullopt;
    return std::pair(samples_.front().stamp, samples_.back().stamp);
  }
  [[nodiscard]] const LogCounters& counters() const override { return counters_; }
  [[nodiscard]] const std::vector<std::string>& warnings() const override { return warnings_.lines(); }

 protected:
  struct ImageEntry {
    Stamp stamp;
    std::uint32_t camera = 0;
    std::uint32_t index = 0;  ///< within the camera
  };
  struct Fetched {
    DecodeResult result = DecodeResult::kDamaged;
    bool missing = false;
    ImageSize found;
    std::string name;  ///< for messages
  };

  explicit RecordedLog(const LogOptions& options) : options_(options) {}

  /// Decodes the image of `entry` into `out` (expected.width * expected.height bytes).
  virtual Fetched fetch(const ImageEntry& entry, ImageSize expected, std::uint8_t* out) = 0;

  /// Call once the lists are complete: corrects samples and rotates them to body axes, checks rates against
  /// the calibration, sorts the images, allocates the pool.
  void prepare(const std::string& name);

  LogOptions options_;
  Calibration calibration_;
  std::vector<ImuSample> samples_;
  std::vector<ImageEntry> images_;
  LogCounters counters_;
  LogWarnings warnings_;

 private:
  struct Pool {
    std::vector<std::uint8_t> memory;
    std::size_t slot = 0;
  };

  bool deliverImage(const ImageEntry& entry, SensorMessage& message);
  void checkRates(const std::string& name);
  void takeImageSizes();

  std::array<Pool, kMaxCameras> pools_;
  std::size_t next_sample_ = 0;
  std::size_t next_image_ = 0;
  std::size_t frame_count_ = 0;
};

}  // namespace swiftlet
