#include "tests/firmware_host/inspection/wrong_log.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "drivers/image/image_decoder.hpp"
#include "drivers/recorded/image_files.hpp"
#include "estimator/core/random.hpp"
#include "tests/support/text.hpp"

namespace swiftlet::test {
namespace {

namespace fs = std::filesystem;
using Row = std::vector<std::string>;

std::vector<Row> readCsv(const fs::path& path, std::string& header) {
  std::ifstream file(path);
  std::vector<Row> rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty()) continue;
    if (line.front() == '#') {
      header = line;
      continue;
    }
    Row row;
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) row.push_back(field);
    rows.push_back(row);
  }
  return rows;
}

void writeCsv(const fs::path& path, const std::string& header, const std::vector<Row>& rows) {
  std::ofstream file(path);
  file << header << '\n';
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) file << (i > 0 ? "," : "") << row[i];
    file << '\n';
  }
}

void writeText(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }

/// Replaces what stands between `key` and the next `]`.
std::string withList(const std::string& text, const std::string& key, const std::string& list) {
  const std::size_t begin = text.find('[', text.find(key));
  const std::size_t end = text.find(']', begin);
  if (begin == std::string::npos || end == std::string::npos) throw std::runtime_error("no " + key);
  return text.substr(0, begin) + "[" + list + text.substr(end);
}

Eigen::Vector3d vectorAt(const Row& row, std::size_t first) {
  return {std::stod(row[first]), std::stod(row[first + 1]), std::stod(row[first + 2])};
}

void setVector(Row& row, std::size_t first, const Eigen::Vector3d& value) {
  for (std::size_t i = 0; i < 3; ++i) {
    row[first + i] = fmt::format("{:.12g}", value[static_cast<Eigen::Index>(i)]);
  }
}

class WrongLog {
 public:
  WrongLog(const fs::path& log, std::string mistake, const fs::path& out)
      : from_(log / "mav0"), to_(out / "mav0"), mistake_(std::move(mistake)) {}

  void write() {
    fs::create_directories(to_ / "imu0");
    fs::copy_file(from_ / "imu0/sensor.yaml", to_ / "imu0/sensor.yaml");
    writeImu();
    for (int camera = 0; camera < 2; ++camera) {
      if (fs::exists(from_ / fmt::format("cam{}", camera))) writeCamera(camera);
    }
  }

 private:
  [[nodiscard]] bool is(const char* name) const { return mistake_ == name; }

  void writeImu() {
    std::string header;
    std::vector<Row> rows = readCsv(from_ / "imu0/data.csv", header);
    std::string truth_header;
    const std::vector<Row> truth = readCsv(from_ / "state_groundtruth_estimate0/data.csv", truth_header);
    std::size_t newest = 0;
    for (Row& row : rows) {
      Eigen::Vector3d gyro = vectorAt(row, 1);
      Eigen::Vector3d accel = vectorAt(row, 4);
      Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
      if (is("axes_exchanged")) axes << 0, 1, 0, 1, 0, 0, 0, 0, 1;
      if (is("axis_negated")) axes(1, 1) = -1;
      if (is("axes_turned")) axes << 0, -1, 0, 1, 0, 0, 0, 0, 1;
      if (is("axes_two_negated")) axes.diagonal() << -1, -1, 1;
      gyro = axes * gyro;
      accel = axes * accel;
      if (is("gyro_degrees")) gyro *= 180 / std::numbers::pi;
      if (is("gyro_axis_negated")) gyro.z() = -gyro.z();
      if (is("accel_axes_exchanged")) accel = Eigen::Vector3d(accel.y(), accel.x(), accel.z());
      if (is("accel_axis_negated")) accel.x() = -accel.x();
      if (is("accel_in_g")) accel /= 9.80665;
      if (is("accel_negated")) accel = -accel;
      if (is("accel_without_gravity") && !truth.empty()) {
        while (newest + 1 < truth.size() && std::stoll(truth[newest + 1][0]) <= std::stoll(row[0])) ++newest;
        const Eigen::Quaterniond q(std::stod(truth[newest][4]), std::stod(truth[newest][5]),
                                   std::stod(truth[newest][6]), std::stod(truth[newest][7]));
        accel -= q.conjugate() * Eigen::Vector3d(0, 0, 9.81);
      }
      setVector(row, 1, is("accel_named_first") ? accel : gyro);
      setVector(row, 4, is("accel_named_first") ? gyro : accel);
    }
    if (is("accel_named_first")) header = "#timestamp,ax,ay,az,gx,gy,gz";
    writeCsv(to_ / "imu0/data.csv", header, rows);
  }

  void writeCamera(int camera) {
    const std::string name = fmt::format("cam{}", camera);
    const fs::path source = from_ / fmt::format("cam{}", is("cameras_swapped") ? 1 - camera : camera);
    fs::create_directories(to_ / name / "data");
    std::string yaml = textOf(from_ / name / "sensor.yaml");
    if (is("focal_1.25") || is("focal_0.8")) {
      const double ratio = is("focal_0.8") ? 0.8 : 1.25;
      std::istringstream list(yaml.substr(yaml.find('[', yaml.find("intrinsics:")) + 1));
      std::array<double, 4> values{};
      char comma = 0;
      for (double& value : values) list >> value >> comma;
      yaml =
          withList(yaml, "intrinsics:",
                   fmt::format("{}, {}, {}, {}", ratio * values[0], ratio * values[1], values[2], values[3]));
    }
    if (is("identity_extrinsics")) {
      yaml = withList(yaml,
                      "data:", fmt::format("1, 0, 0, {}, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1", 0.11 * camera));
    }
    writeText(to_ / name / "sensor.yaml", yaml);
    std::string header;
    std::vector<Row> rows = readCsv(source / "data.csv", header);
    Random random(7);
    std::vector<Row> kept;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      Row row = rows[i];
      std::string file = row[1];
      while (!file.empty() && (file.back() == '\r' || file.back() == ' ')) file.pop_back();
      if (is("images_dropped") && i % 7 == 3) continue;
      const fs::path link = to_ / name / "data" / (row[0] + fs::path(file).extension().string());
      // Every fourth image shows what the one before shows.
      const bool doubled = is("images_doubled") && i % 4 == 3;
      std::string shown = doubled ? rows[i - 1][1] : file;
      while (!shown.empty() && (shown.back() == '\r' || shown.back() == ' ')) shown.pop_back();
      if (is("exposure_jumps")) {
        writeScaled(source / "data" / shown, link, (i / 8) % 2 == 0 ? 1.0 : 0.55);
      } else {
        fs::create_symlink(fs::absolute(source / "data" / shown), link);
      }
      std::int64_t stamp = std::stoll(row[0]);
      if (is("clock_5s")) stamp += 5'000'000'000;
      if (is("clock_minus_5s")) stamp -= 5'000'000'000;
      if (is("clock_50ms")) stamp += 50'000'000;
      if (is("clock_minus_50ms")) stamp -= 50'000'000;
      if (is("clock_of_boot")) stamp -= std::stoll(rows[0][0]) - 12'000'000'000;
      // Arrival: a delay that is mostly short.
      if (is("stamps_jitter")) stamp += static_cast<std::int64_t>(-6e6 * std::log(1 - random.uniform()));
      kept.push_back({std::to_string(stamp), link.filename().string()});
    }
    writeCsv(to_ / name / "data.csv", header, kept);
  }

  void writeScaled(const fs::path& image, const fs::path& out, double gain) {
    const std::vector<std::uint8_t> bytes = bytesOf(image);
    ImageSize size{0, 0};
    ImageDecoder decoder;
    static_cast<void>(decoder.decode(bytes, {1, 1}, pixels_.data(), size));
    pixels_.resize(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height));
    if (decoder.decode(bytes, size, pixels_.data(), size) != DecodeResult::kOk)
      throw std::runtime_error(image);
    for (std::uint8_t& pixel : pixels_) pixel = static_cast<std::uint8_t>(std::lround(gain * pixel));
    writeJpeg(out, pixels_.data(), size.width, size.height, 92);
  }

  const fs::path from_;
  const fs::path to_;
  const std::string mistake_;
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(1);
};

}  // namespace

const std::vector<Mistake>& mistakes() {
  static const std::vector<Mistake> all = {
      {"none", ""},
      {"gyro_degrees", "gyro in deg/s"},
      {"accel_in_g", "in g?"},
      {"accel_without_gravity", "accelerometer without gravity"},
      {"accel_negated", "accelerometer negated"},
      {"clock_5s", "image stamps of another clock"},
      {"clock_minus_5s", "image stamps of another clock"},
      {"clock_50ms", "image stamps shifted"},
      {"clock_minus_50ms", "image stamps shifted"},
      {"clock_of_boot", "do not overlap in time"},
      {"stamps_jitter", "image stamps jitter"},
      {"cameras_swapped", "cameras swapped"},
      {"axes_exchanged", "IMU axes left-handed"},
      {"axis_negated", "IMU axes left-handed"},
      {"gyro_axis_negated", "IMU axes left-handed"},
      {"axes_turned", "IMU axes exchanged or negated"},
      {"axes_two_negated", "IMU axes exchanged or negated"},
      {"accel_axes_exchanged", "accelerometer axes exchanged or negated"},
      {"accel_axis_negated", "accelerometer axes exchanged or negated"},
      {"identity_extrinsics", "camera and IMU with identity extrinsics"},
      {"exposure_jumps", "exposure jumps"},
      {"images_doubled", "images doubled"},
      {"images_dropped", "images dropped"},
      {"focal_1.25", "wrong focal length"},
      {"focal_0.8", "wrong focal length"},
      {"accel_named_first", ""},
  };
  return all;
}

void wrongLog(const std::filesystem::path& log, const std::string& mistake,
              const std::filesystem::path& out) {
  WrongLog(log, mistake, out).write();
}

}  // namespace swiftlet::test
