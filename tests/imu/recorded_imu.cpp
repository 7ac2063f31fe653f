#include "tests/imu/recorded_imu.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>

namespace swiftlet::test {
namespace {

struct Row {
  std::int64_t stamp = 0;
  std::vector<double> values;
};

struct PipeCloser {
  void operator()(std::FILE* pipe) const { pclose(pipe); }
};

std::vector<Row> readRows(const std::string& path) {
  std::vector<Row> rows;
  const std::string command = "xz -dc '" + path + "'";
  const std::unique_ptr<std::FILE, PipeCloser> pipe(popen(command.c_str(), "r"));
  if (!pipe) return rows;
  char line[1024];
  while (std::fgets(line, sizeof line, pipe.get()) != nullptr) {
    if (line[0] < '0' || line[0] > '9') continue;
    Row row;
    char* at = nullptr;
    row.stamp = std::strtoll(line, &at, 10);
    while (*at == ',') row.values.push_back(std::strtod(at + 1, &at));
    rows.push_back(std::move(row));
  }
  return rows;
}

Eigen::Vector3d vectorAt(const Row& row, std::size_t i) {
  return {row.values[i], row.values[i + 1], row.values[i + 2]};
}

}  // namespace

std::string dataFolder() {
  const char* folder = std::getenv("SWIFTLET_DATA");
  return folder != nullptr ? folder : SWIFTLET_SOURCE_DIR "/../shared/data";
}

std::string noLogs(const std::string& group) { return "no " + group + " in " + dataFolder(); }

std::vector<std::string> logNames(const std::string& group) {
  std::vector<std::string> names;
  const std::filesystem::path folder = std::filesystem::path(dataFolder()) / group;
  if (!std::filesystem::is_directory(folder)) return names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (std::filesystem::exists(entry.path() / "imu0.csv.xz")) names.push_back(entry.path().filename());
  }
  std::sort(names.begin(), names.end());
  return names;
}

RecordedLog readLog(const std::string& group, const std::string& name) {
  RecordedLog log;
  log.name = name;
  const std::string folder = dataFolder() + "/" + group + "/" + name + "/";
  for (const Row& row : readRows(folder + "imu0.csv.xz")) {
    if (row.values.size() < 6) continue;
    log.imu.push_back({{row.stamp}, vectorAt(row, 0), vectorAt(row, 3)});
  }
  const bool corrected = std::filesystem::exists(folder + "groundtruth_openvins.csv.xz");
  for (const Row& row :
       readRows(folder + (corrected ? "groundtruth_openvins.csv.xz" : "groundtruth.csv.xz"))) {
    if (row.values.size() < 8) continue;
    TruthRow truth;
    truth.stamp = {row.stamp};
    truth.p = vectorAt(row, 0);
    truth.q = Eigen::Quaterniond(row.values[3], row.values[4], row.values[5], row.values[6]).normalized();
    if (row.values.size() >= 16) {
      truth.v = vectorAt(row, 7);
      truth.bias_gyro = vectorAt(row, 10);
      truth.bias_accel = vectorAt(row, 13);
    } else {
      truth.moving = row.values[7] != 0;
    }
    log.truth.push_back(truth);
  }
  return log;
}

}  // namespace swiftlet::test
