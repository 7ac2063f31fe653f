#pragma once
// A small EuRoC folder on disk, whole or with chosen damage.

#include <catch2/catch.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "tests/support/input_error.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace fs = std::filesystem;
}

namespace swiftlet::test {

/// A folder under the system's temporary one, removed at the end.
class TempFolder {
 public:
  TempFolder();
  ~TempFolder();
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

void writeText(const fs::path& path, const std::string& text);
std::string readText(const fs::path& path);

/// Grey pictures as files in memory.
std::vector<std::uint8_t> encodePng(const std::vector<std::uint8_t>& pixels, int width, int height);
std::vector<std::uint8_t> encodePng16(const std::vector<std::uint16_t>& pixels, int width, int height);
std::vector<std::uint8_t> encodeJpeg(const std::vector<std::uint8_t>& pixels, int width, int height);
void writeBytes(const fs::path& path, const std::vector<std::uint8_t>& bytes);

/// A gradient that depends on `seed`, so that every picture differs from every other.
std::vector<std::uint8_t> pattern(int width, int height, int seed);

/// 64x48 pictures at 20 Hz, samples at 200 Hz from 50 ms before the first image to 50 ms after the last.
struct AslFixture {
  static constexpr int kWidth = 64;
  static constexpr int kHeight = 48;
  static constexpr std::int64_t kStart = 1403636579763555584;
  static constexpr std::int64_t kImagePeriod = 50'000'000;
  static constexpr std::int64_t kImuPeriod = 5'000'000;

  explicit AslFixture(int frames = 6, const char* extension = ".png");

  [[nodiscard]] fs::path mav0() const { return folder.path() / "mav0"; }
  [[nodiscard]] fs::path image(int camera, int i) const;
  [[nodiscard]] std::int64_t stamp(int i) const { return kStart + i * kImagePeriod; }
  [[nodiscard]] std::string imuCsv() const { return (mav0() / "imu0" / "data.csv").string(); }

  TempFolder folder;
  int frames;
  std::string extension;
};

/// Everything a log gives, in order; the pictures' first pixels stand for them.
struct Delivered {
  std::vector<ImuSample> samples;
  std::vector<CameraFrame> frames;
  std::vector<std::vector<std::uint8_t>> pictures;
  std::vector<std::string> order;  ///< "i" or "c0"/"c1" for each message
};
Delivered readAll(LogSource& log);

/// Kalibr's files for one camera of the fixture's size.
inline constexpr const char* kKalibrIllustration =
    "cam0:\n  T_cam_imu:\n  - [1.0, 0.0, 0.0, 0.0]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]\n"
    "  distortion_model: equidistant\n  intrinsics: [40.0, 40.0, 32.0, 24.0]\n  resolution: [64, 48]\n"
    "  timeshift_cam_imu: 0.002\n";
inline constexpr const char* kKalibrImu =
    "update_rate: 200.0\naccelerometer_noise_density: 2.0e-03\naccelerometer_random_walk: 3.0e-03\n"
    "gyroscope_noise_density: 1.6968e-04\ngyroscope_random_walk: 1.9393e-05\n";

}  // namespace swiftlet::test
