#include "drivers/simulated/given_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "drivers/input/read_file.hpp"
#include "drivers/input/unpack_xz.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kMaxGap = 0.5;  // s, largest gap between poses that is bridged

struct Row {
  double t = 0;  // s since the first row
  SE3 pose;
};

std::string readText(const std::string& path) {
  std::string text = readFile(path, "");
  return isXz(text) ? unpackXz(path, text) : text;
}

std::vector<Row> parseRows(const std::string& text, const std::string& path) {
  constexpr int kFields = 7;  // p xyz, q wxyz
  std::vector<Row> rows;
  std::int64_t first_ns = 0;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.empty() || line[0] == '#' || line[0] == '\r') continue;
    const char* cursor = line.c_str();
    char* end = nullptr;
    const std::int64_t ns = std::strtoll(cursor, &end, 10);
    std::array<double, kFields> value{};
    bool good = end != cursor;
    for (std::size_t i = 0; good && i < kFields; ++i) {
      cursor = *end == ',' ? end + 1 : end;
      value[i] = std::strtod(cursor, &end);
      good = end != cursor && std::isfinite(value[i]);
    }
    if (!good) throw InputError(path, number, "", "not a pose (stamp, p xyz, q wxyz)", "");
    if (rows.empty()) first_ns = ns;
    Row row;
    row.t = static_cast<double>(ns - first_ns) * 1e-9;
    row.pose =
        SE3(Eigen::Quaterniond(value[3], value[4], value[5], value[6]), {value[0], value[1], value[2]});
    if (!rows.empty() && (row.t <= rows.back().t || row.t > rows.back().t + kMaxGap)) {
      throw InputError(path, number, "stamp", "must increase by at most 0.5 s per row", "");
    }
    rows.push_back(row);
  }
  return rows;
}

}  // namespace

SplineTrajectory readGivenMotion(const std::string& path, double skip, double duration) {
  const std::vector<Row> rows = parseRows(readText(path), path);
  const double last = rows.empty() ? 0.0 : rows.back().t;
  const double end = duration > 0 ? std::min(last, skip + duration) : last;
  const auto count = static_cast<std::int64_t>(std::floor((end - skip) / kGivenMotionSpacing));
  if (skip < 0 || count < 1) throw InputError(path, 0, "", "has no motion in the selected span", "");
  std::vector<SE3> samples;
  std::size_t row = 1;
  for (std::int64_t k = 0; k <= count; ++k) {
    const double t = skip + kGivenMotionSpacing * static_cast<double>(k);
    while (row + 1 < rows.size() && rows[row].t < t) ++row;
    const Row& a = rows[row - 1];
    const Row& b = rows[row];
    const double share = (t - a.t) / (b.t - a.t);
    const Eigen::Vector3d turn = logSo3(a.pose.rotation.conjugate() * b.pose.rotation);
    samples.emplace_back(a.pose.rotation * expSo3(share * turn),
                         a.pose.translation + share * (b.pose.translation - a.pose.translation));
  }
  return SplineTrajectory::interpolate(0.0, kGivenMotionSpacing, samples);
}

}  // namespace swiftlet
