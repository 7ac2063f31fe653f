#include "tests/drivers/recorded/asl_fixture.hpp"

#include <png.h>
#include <turbojpeg.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <iterator>

namespace swiftlet::test {

TempFolder::TempFolder() {
  std::string name = (fs::temp_directory_path() / "swiftlet_recorded_XXXXXX").string();
  REQUIRE(mkdtemp(name.data()) != nullptr);
  path_ = name;
}

TempFolder::~TempFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

void writeText(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream out(path, std::ios::binary);
  out << text;
  REQUIRE(out.good());
}

std::string readText(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  REQUIRE(in);
  return {std::istreambuf_iterator<char>(in), {}};
}

void writeBytes(const fs::path& path, const std::vector<std::uint8_t>& bytes) {
  writeText(path, std::string(bytes.begin(), bytes.end()));
}

namespace {

std::vector<std::uint8_t> encode(const void* pixels, int width, int height, png_uint_32 format) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = format;
  png_alloc_size_t size = 0;
  REQUIRE(png_image_write_to_memory(&image, nullptr, &size, 0, pixels, 0, nullptr) != 0);
  std::vector<std::uint8_t> bytes(size);
  REQUIRE(png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels, 0, nullptr) != 0);
  bytes.resize(size);
  return bytes;
}

}  // namespace

std::vector<std::uint8_t> encodePng(const std::vector<std::uint8_t>& pixels, int width, int height) {
  return encode(pixels.data(), width, height, PNG_FORMAT_GRAY);
}

std::vector<std::uint8_t> encodePng16(const std::vector<std::uint16_t>& pixels, int width, int height) {
  return encode(pixels.data(), width, height, PNG_FORMAT_LINEAR_Y);
}

std::vector<std::uint8_t> encodeJpeg(const std::vector<std::uint8_t>& pixels, int width, int height) {
  constexpr int kQuality = 95;
  tjhandle handle = tjInitCompress();
  unsigned char* out = nullptr;
  unsigned long size = 0;
  REQUIRE(tjCompress2(handle, pixels.data(), width, 0, height, TJPF_GRAY, &out, &size, TJSAMP_GRAY, kQuality,
                      0) == 0);
  std::vector<std::uint8_t> bytes(out, out + size);
  tjFree(out);
  tjDestroy(handle);
  return bytes;
}

std::vector<std::uint8_t> pattern(int width, int height, int seed) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) pixels.push_back(static_cast<std::uint8_t>(seed * 7 + 2 * x + 3 * y));
  }
  return pixels;
}

namespace {

std::string cameraYaml(double x) {
  return "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, " + std::to_string(x) +
         ",\n         0.0, 1.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.0,\n         0.0, 0.0, 0.0, 1.0]\n"
         "rate_hz: 20\nresolution: [64, 48]\ncamera_model: pinhole\nintrinsics: [40.0, 40.0, 32.0, 24.0]\n"
         "distortion_model: radial-tangential\ndistortion_coefficients: [0.0, 0.0, 0.0, 0.0]\n";
}

constexpr const char* kImuYaml =
    "sensor_type: imu\nrate_hz: 200\ngyroscope_noise_density: 1.6968e-04\ngyroscope_random_walk: 1.9393e-05\n"
    "accelerometer_noise_density: 2.0000e-3\naccelerometer_random_walk: 3.0000e-3\n";

}  // namespace

fs::path AslFixture::image(int camera, int i) const {
  return mav0() / ("cam" + std::to_string(camera)) / "data" / (std::to_string(stamp(i)) + extension);
}

AslFixture::AslFixture(int frame_count, const char* file_extension)
    : frames(frame_count), extension(file_extension) {
  for (int camera = 0; camera < 2; ++camera) {
    const fs::path base = mav0() / ("cam" + std::to_string(camera));
    writeText(base / "sensor.yaml", cameraYaml(camera == 0 ? 0.0 : 0.11));
    std::string csv = "#timestamp [ns],filename\n";
    for (int i = 0; i < frames; ++i) {
      csv += std::to_string(stamp(i)) + "," + std::to_string(stamp(i)) + extension + "\n";
      const std::vector<std::uint8_t> pixels = pattern(kWidth, kHeight, 2 * i + camera);
      writeBytes(image(camera, i), extension == ".png" ? encodePng(pixels, kWidth, kHeight)
                                                       : encodeJpeg(pixels, kWidth, kHeight));
    }
    writeText(base / "data.csv", csv);
  }
  writeText(mav0() / "imu0" / "sensor.yaml", kImuYaml);
  std::string imu =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],"
      "a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
  for (std::int64_t t = kStart - kImagePeriod; t <= stamp(frames); t += kImuPeriod) {
    imu += std::to_string(t) + ",0.01,-0.02,0.03,0.1,0.2,9.8\n";
  }
  writeText(imuCsv(), imu);
}

Delivered readAll(LogSource& log) {
  Delivered out;
  SensorMessage message;
  while (log.next(message)) {
    if (const auto* sample = std::get_if<ImuSample>(&message)) {
      out.samples.push_back(*sample);
      out.order.emplace_back("i");
      continue;
    }
    const auto& frame = std::get<CameraFrame>(message);
    out.frames.push_back(frame);
    out.order.push_back("c" + std::to_string(frame.camera));
    std::vector<std::uint8_t> pixels;
    for (int y = 0; y < frame.image.height; ++y) {
      pixels.insert(pixels.end(), frame.image.row(y), frame.image.row(y) + frame.image.width);
    }
    out.pictures.push_back(std::move(pixels));
  }
  return out;
}

}  // namespace swiftlet::test
